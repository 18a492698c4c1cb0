"""The planners, one file each, and what they share.

- control: the base classes of planners, the stages of a tick, steering, speed laws, settings;
- perception: filters of a scan, gaps in it, targets that move, and the local map;
- safety: predictions, guidance, the line of a known lap, braking trajectories, the safety filter, recovery and the
  friction limiter.

Of fg_mujoco they import messages, errors and the native core, which a planner on a real car has, too. Planners that
follow lines or overtake are in `addons/drivers`.

A planner needs no entry here to be raced: `--controller path/to/file.py:ClassName` does too, and an installed package
may register its own (entry point group `fg_mujoco.controllers`).
"""

CONTROLLERS = {
    "disparity_extender": "disparity_extender:DisparityExtender",
    "disparity_selection": "disparity_selection:DisparitySelection",
    "follow_the_gap": "follow_the_gap:FollowTheGap",
    "gap_finder": "gap_finder:GapFinder",
    "threshold_gap": "threshold_gap:ThresholdGap",
    "wall_follow": "wall_follow:WallFollow",
    "weighted_gap": "weighted_gap:WeightedGap",
    "widest_gap": "widest_gap:WidestGap",
}
"""Name -> "module:Class" of this folder."""

BASELINES = {
    "hard_left": "baselines:HardLeft",
    "random": "baselines:Random",
    "straight": "baselines:Straight",
}
"""The same of planners that look at nothing, with which tables compare the others."""
