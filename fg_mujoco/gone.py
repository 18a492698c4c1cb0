"""What went, and what serves instead: said in the line that refuses a command, an option, a setting or a file of it."""

from __future__ import annotations

_ESTIMATE = "terms of the setting privileged, which the critic sees, and parts with a history"
_LEAGUE = "`opponents` and `rules` of `fg-mujoco compare` or of a suite, and pandas on its runs.csv"
_MAPPING = "slam_toolbox on the car, whose maps `fg-mujoco race --track map.yaml` races on"
_POSE = "--pose rate=10,delay=.05,noise_std=.02,drift=.01 of the car, the true pose with the errors that are stated"
_SELF_PLAY = "the setting opponents of the environment; policy files are opponents, too"

GONE = {
    "--trust": "--controller FILE (in Python controller=): a run folder never loads a planner by itself",
    "bag --map": _MAPPING,
    "bag --match": _MAPPING,
    "bag --resolution": _MAPPING,
    "bag --scan-topic": _MAPPING,
    "bag --track": _MAPPING,
    "bag --vehicle": _MAPPING,
    "estimate": _ESTIMATE,
    "fg-mujoco evaluate": "`fg-mujoco compare`, with lists for --mu and --max-speed, and --assist once for each",
    "fg-mujoco grade": "`fg-mujoco study LAB.toml FILE.py`",
    "fg-mujoco league": _LEAGUE,
    "fg-mujoco map": _MAPPING,
    "fg-mujoco overtake": "`fg-mujoco study examples/scenarios/overtaking.toml PLANNER`, or another suite of duels",
    "fg-mujoco scenarios": "`fg-mujoco study SUITE.toml PLANNER`",
    "heats": _LEAGUE,
    "identify --front-drive": "the drive line of --vehicle: its driven axles and its centre (docs/howto/own_car.md)",
    "learn": "planner_mu, and `fg-mujoco friction mismatch`, which says what a wrong one costs",
    "policy.json": "policy.onnx, which save_policy and trainings write; examples/own_policy.py shows how",
    "rospy": "a node of ROS 2 (rclpy), since ROS 1 ended in May 2025; bags of ROS 1 are read",
    "self_play": _SELF_PLAY,
    "serve rosbridge": "`fg-mujoco serve ros2`, and ROS's own rosbridge_server beside it",
    "setting particles": _POSE,
    "setting pose": _POSE,
    "setting pose_map": _POSE,
    "setting pose_start": _POSE,
    "train --estimate": _ESTIMATE,
    "train --self-play": _SELF_PLAY,
    "train --trust": "nothing: a checkpoint that is named runs its code, as SECURITY.md says",
}
"""What somebody may still give, as `COMMAND`, `COMMAND --option`, `--option` of any, setting or file -> what
serves instead.

A command or a planner's setting whose name is a word of other meanings, too, stands here with `fg-mujoco` or `setting`
before it.
"""


def gone(given: str) -> str | None:
    """Return the line that refuses what went, in the words of an error; None: it is there, or never was."""
    option = given.rpartition(" ")[2]
    for name in (given, given.removeprefix("fg-mujoco "), *([option] if option.startswith("--") else [])):
        if name in GONE:
            return f"{name!r} is gone; instead: {GONE[name]}"
    return None
