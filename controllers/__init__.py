"""Planners by name, each in one file, and what they share.

Their eyes are in `scan_filters`, their hands in `steering` and `speed`; `driving` makes what they wish for safe, by
`stopping_paths` and `friction_guard`; `compiled_planner` makes controllers of them, for one world or for many.

A planner needs no entry here to be raced: `--controller path/to/file.py:ClassName` does too.
"""

CONTROLLERS = {
    "gap_finder": "gap_finder:GapFinder",
}
"""Name -> "module:Class" of this folder."""
