"""The exception tree. Every message says what was wrong, where it came from, and what would be accepted.

`GONE` has what went, and what serves instead: said in the line that refuses a command, an option, a setting or a file
of it.
"""

from __future__ import annotations

import difflib
import shlex
import sys
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

_LEAST_PART = 3  # letters of a part by which a name is found

_UNITS = ("_m", "_s", "_m_s", "_m_s2", "_rad", "_rad_s", "_N", "_V", "_A")
"""Ends of the names of columns and results."""

_OTHER_WORDS: dict[str, tuple[str, ...]] = {
    "acc": ("linear_acceleration",), "agent": ("controller", "entries", "opponent"),
    "agents": ("agents", "opponent", "entries"), "algorithm": ("controller", "controllers"), "angle": ("bearings",),
    "angles": ("bearings",), "angular_z": ("yaw_rate",), "best_lap": ("lap_times_s",), "car": ("vehicle",),
    "cars": ("vehicle", "entries"), "circuit": ("track", "tracks"), "collided": ("collisions", "crash"),
    "course": ("track", "tracks"), "crashed": ("crash", "collisions"), "delta": ("steering_angle",), "dir": ("out",),
    "driver": ("controller",), "duration": ("sim_time_s", "time_limit"), "envs": ("num_envs", "n"),
    "folder": ("out",), "friction": ("mu",), "heading": ("pose",), "imu": ("angular_velocity",),
    "lap_time": ("lap_times_s",), "laps": ("laps_completed",), "laptime": ("lap_times_s",), "linear_x": ("speed",),
    "map": ("track", "tracks"), "maps": ("tracks", "track"), "maximum_speed": ("max_speed",), "n_laps": ("laps",),
    "noise": ("range_noise_std", "lidar_noise"), "num_agents": ("agents", "opponent", "entries"),
    "num_cars": ("agents", "opponent", "entries"), "num_envs": ("num_envs", "n"), "num_laps": ("laps",),
    "num_worlds": ("n",), "number": ("n",), "observation": ("step",), "odometry": ("step",),
    "opponents": ("opponent", "entries"), "orientation": ("pose",), "output": ("out",), "output_dir": ("out",),
    "planner": ("controller", "controllers"), "planners": ("controllers", "controller"),
    "policy": ("controller", "controllers"), "pose_theta": ("pose",), "pose_x": ("pose",), "pose_y": ("pose",),
    "position": ("pose", "trajectory"), "record": ("video",), "save": ("out",), "scan": ("step",),
    "scene": ("track", "scenes", "tracks"), "scenes": ("track",), "size": ("length", "width"),
    "speed": ("max_speed", "speed_m_s"),
    "steer": ("steering_angle",), "steering": ("steering_angle", "steering_angle_rad"), "success": ("finished",),
    "theta": ("pose", "heading"), "throttle": ("speed",), "time": ("stamp", "sim_time_s", "time_s"),
    "time_limit": ("duration",), "timeout": ("time_limit",), "times": ("lap_times_s",), "timestamp": ("stamp",),
    "tracks": ("track",), "trajectory": ("states",), "twist": ("speed",), "v": ("speed", "max_speed"),
    "v_max": ("max_speed",),
    "vel": ("speed", "max_speed"), "velocity": ("speed", "max_speed"), "vmax": ("max_speed",),
    "wheel_speed": ("wheel_speeds",), "wheelbase": ("vehicle",), "world": ("track",), "worlds": ("n",),
    "x": ("pose", "x_m"), "y": ("pose", "y_m"), "yaw": ("pose", "heading"),
}  # fmt: skip
"""Words of other packages -> words of this one: the first that is a known name is meant."""


def nearest(name: object, known: Iterable[str], *, cutoff: float = 0.6) -> str | None:
    """Return the name that was probably meant.

    That is the one that only lacks its unit, else the word here for what others call it, else the most similar of the
    known names, else the only one that holds it.

    None: no name is similar, and none or several hold the one that was given.

    Args:
      name: as it was given.
      known: names to choose from; capitals, hyphens and underscores make no difference, nor do hyphens in front.
      cutoff: least similarity, from 0 to 1 (difflib's ratio).
    """
    spelt = {_spelling(each): each for each in reversed(list(known))}
    given = _spelling(str(name))
    others = (*(given + unit.casefold() for unit in _UNITS), *_OTHER_WORDS.get(given, ()))
    found = [each for each in (given, *others) if each in spelt][:1]
    found = found or difflib.get_close_matches(given, spelt, n=1, cutoff=cutoff)
    if not found:
        held = [each for each in spelt if len(given) >= _LEAST_PART and given in each]
        found = held if len(held) == 1 else []
    return spelt[found[0]] if found else None


def accepted_names(name: object, known: Iterable[str], others: str = "", *, besides: Iterable[str] = ()) -> str:
    """Return the end of a message that refuses a name: "accepted: oval, tight; did you mean 'oval'?".

    Of a name of what went it says what serves instead.

    Args:
      name: as it was given.
      known: names that are accepted.
      others: what else is accepted, in words, such as ", or path/to/file.xml".
      besides: further names that may have been meant, too many for the list.
    """
    if (went := gone(str(name))) is not None:
        return went
    known = list(known)
    meant = nearest(name, [*known, *besides])
    hint = "" if meant is None or meant == name else f"; did you mean {meant!r}?"
    return f"accepted: {', '.join(known)}{others}{hint}"


def with_unit(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that is `name`, or is that and a unit, such as "speed_m_s"; None: there is none."""
    known = tuple(known)
    return next((each for each in (name, *(name + unit for unit in _UNITS)) if each in known), None)


def _spelling(name: str) -> str:
    return name.casefold().lstrip("-").replace("-", "_")


class FgMujocoError(Exception):
    """Anything this package refuses; the command line prints it in one line and exits 2."""


class MessageError(FgMujocoError, ValueError):
    """A scan, command or odometry message with a value that no sensor or actuator has."""


class SettingsError(FgMujocoError, ValueError):
    """A setting outside its accepted range, or a combination that cannot work."""


class ArgumentError(SettingsError, TypeError):
    """An argument that a function or a class does not take, or one that it lacks."""


class TrackError(FgMujocoError, ValueError):
    """A track that cannot be read, or that no car can drive."""


class ModelError(FgMujocoError, ValueError):
    """An MJCF model that lacks a part the simulation needs, or has one it cannot represent."""


class ControllerError(FgMujocoError):
    """A controller that cannot be loaded, cannot be built, or answers something else than a command."""


class PlannerError(ControllerError):
    """A planner that failed while it drove: it raised, or answered something else than a command.

    Attributes:
      failure: PlannerFailure: the line of the planner's file, its traceback, and the scan that it was given.
    """

    def __init__(self, message: str, failure: Any = None) -> None:
        super().__init__(message)
        self.failure = failure


class RunFolderError(FgMujocoError, OSError):
    """A run folder that cannot be written, or is not one."""


class BagError(FgMujocoError, OSError):
    """A bag that cannot be read or written, or a message in it that cannot be what it says."""


class MissingExtraError(FgMujocoError, ImportError):
    """An optional part that is not installed; the message says what needs it, and the command that installs it."""


def missing_extra(needs: str, extra: str) -> MissingExtraError:
    """Return the error for an extra that is not installed.

    Args:
      needs: what needs which packages, such as "pictures need matplotlib".
      extra: its name in pyproject.toml.
    """
    return MissingExtraError(f"{needs}: {install_command(extra)}")


def install_command(extra: str) -> str:
    """Return the shell command that installs an extra for the Python that runs, from any folder.

    Nothing is published yet. So it installs from the clone that this package was imported from; without a clone it
    names the packages of the extra. Once there is a release, this function is the only code to change.
    """
    clone = Path(__file__).parents[1]
    if (clone / "pyproject.toml").is_file():
        what = ["-e", f"{clone}[{extra}]"]
    else:
        from importlib import metadata  # takes longer to import than all of this

        marker = f'extra == "{extra}"'
        what = [line.partition(";")[0].strip() for line in metadata.requires("fg-mujoco") or () if marker in line]
    return shlex.join([sys.executable or "python3", "-m", "pip", "install", *what])


class DecisionLimitReached(BaseException):
    """A decision that took longer than its limit. No Exception: a planner that catches those does not catch it."""


def is_of_planner(error: BaseException) -> bool:
    """Return whether an exception is the planner's fault, and not Ctrl-C or the decision limit."""
    return not isinstance(error, (DecisionLimitReached, KeyboardInterrupt))


class FinalWarning(UserWarning):
    """A warning that a command prints at its end, below the results, where it explains them."""


class Note(UserWarning):
    """The meaning of a file, as it was read: a command prints it in one line; Python code sees it with a filter."""


warnings.filterwarnings("ignore", category=Note, append=True)


class EngineError(FgMujocoError, RuntimeError):
    """A part of the machinery that fails: MuJoCo's engine, or a cluster that cannot be reached or lost what it had."""


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
