"""Words of other tools that newcomers type -> the command here that does it."""

from __future__ import annotations

_COURSES = "`fg-mujoco track list` lists the circuits, `fg-mujoco track scenes` the scenes"
_MAP = f"`fg-mujoco race --track map.yaml` races on a map of your own; {_COURSES}"
_NEW = "`fg-mujoco track new` makes a track"
_PLANNERS = "`fg-mujoco controllers` lists the planners"
_VEHICLES = "`fg-mujoco vehicles` lists the cars"
_VIEW = "`fg-mujoco view` shows a race as it goes, with --web in a browser"
_RACE = "`fg-mujoco race` runs a race without a window; `fg-mujoco view` opens one"
_PICTURES = "`fg-mujoco render` makes pictures and videos of a run, and `fg-mujoco race --video FILE` of the race"
_REPORT = "`fg-mujoco race --out DIR` draws a run and writes its page, `fg-mujoco report DIR` writes it again"
_STUDY = "`fg-mujoco compare` races planners on several courses, `fg-mujoco rollout` one in many worlds"
_LEARN = "`fg-mujoco train` trains a policy; environments are made in Python: gymnasium.make('fg_mujoco/F1Tenth-v0')"
_ROS = "`fg-mujoco race --controller ros:path/to/node.py` races a node of ROS, `fg-mujoco bag` reads a bag"
_BAG = "`fg-mujoco export` writes a run as a bag"
_F110 = "`python -m fg_mujoco.addons.gym2d script.py` runs a script of f1tenth_gym"

_OF_WORDS = {
    _COURSES: ("circuit", "circuits", "courses", "scenes", "tracks"),
    _MAP: ("map", "maps"),
    _NEW: ("generate", "make", "new"),
    _PLANNERS: ("algorithms", "planner", "planners"),
    _VEHICLES: ("car", "cars", "models"),
    f"{_COURSES}; {_PLANNERS}; {_VEHICLES}": ("list", "ls"),
    _VIEW: (
        "display", "gui", "human", "live", "play", "show", "view", "vis", "visualise", "visualize", "viz", "watch",
        "window",
    ),
    _RACE: ("headless", "launch", "no_gui", "no_render", "run", "sim", "simulate", "start"),
    _PICTURES: ("fps", "movie", "picture", "record", "render", "screenshot", "video"),
    _REPORT: ("plot", "plots"),
    _STUDY: ("bench", "benchmark", "num_envs", "num_worlds", "test"),
    "`fg-mujoco compare` races planners and policies over courses, speeds and friction": ("eval",),
    "`fg-mujoco study SUITE.toml PLANNER` drives planners through a suite or a lab": ("suite",),
    _LEARN: ("gym", "gymnasium", "learn", "ppo", "rl"),
    _ROS: ("ros", "ros2", "rosbag"),
    _BAG: ("convert",),
    _F110: ("f110", "f1tenth_gym"),
    "`fg-mujoco --version` prints the version": ("version",),
}  # fmt: skip
_COMMANDS = {word: command for command, words in _OF_WORDS.items() for word in words}


def command_for(given: str) -> str | None:
    """Return the sentence that names the command for what was given as a command or an option; None: none is known."""
    return _COMMANDS.get(given.lstrip("-").casefold().replace("-", "_"))
