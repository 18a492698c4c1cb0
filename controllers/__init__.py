"""Planners by name, each in one file, and what they share.

Their eyes are in `scan_filters` and `gaps`, their hands in `steering` and `speed`; `driving` makes what they wish for
safe, by `stopping_paths`, `escape` and `friction_guard`; `compiled_planner` makes controllers of them, for
one world or for many.

A planner needs no entry here to be raced: `--controller path/to/file.py:ClassName` does too.
"""

CONTROLLERS = {
    "disparity_extender": "disparity_extender:DisparityExtender",
    "disparity_selection": "disparity_selection:DisparitySelection",
    "follow_the_gap": "follow_the_gap:FollowTheGap",
    "gap_finder": "gap_finder:GapFinder",
    "pure_pursuit": "pure_pursuit:PurePursuit",
    "threshold_gap": "threshold_gap:ThresholdGap",
    "wall_follow": "wall_follow:WallFollow",
    "weighted_gap": "weighted_gap:WeightedGap",
    "widest_gap": "widest_gap:WidestGap",
}
"""Name -> "module:Class" of this folder."""
