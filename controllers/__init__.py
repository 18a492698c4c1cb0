"""Planners by name. Each is one file; what they share is in scan_filters, steering, speed and friction_guard.

A planner needs no entry here to be raced: `--controller path/to/file.py:ClassName` does too.
"""

CONTROLLERS = {
    "gap_finder": "gap_finder:GapFinder",
}
"""Name -> "module:Class" of this folder."""
