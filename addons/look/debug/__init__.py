"""Why the car did what it did: each decision of a recorded run, with its scan, its command, and what held it.

    seen = debug("runs/oval", at=3.2)
    print(seen.chosen.why_speed)
    seen.write_page("debug.html")

`decisions` drives the run again and asks its planner, and `debug_page` writes the decisions as one HTML page to step
through.
"""

from .debugged_run import DebuggedRun, debug
from .decisions import Decision

__all__ = ["DebuggedRun", "Decision", "debug"]
