"""Why the car did what it did: each decision of a recorded run, with its scan, its command, and what held it."""

from .debugged_run import DebuggedRun, debug
from .decisions import Decision

__all__ = ["DebuggedRun", "Decision", "debug"]
