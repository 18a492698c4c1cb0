"""Stages: what stands between a planner's reference and the car's command.

    def creep(tick: Tick) -> None:
        tick.command[1] = min(tick.command[1], 1.0)

    CREEP = Stage(text="at most 1 m/s", after_driving=creep)
    STAGES["creep"] = "my_package.my_module:CREEP"
    fg.race("oval", "gap_finder", assist="full+creep")

`assist` chooses the stages of a planner:

    assist="none"            the planner alone, with the speed laws of its source
    assist="grip"            the same with the friction limiter
    assist="safe"            speed laws, sight, safety filter, prediction, recovery and friction limiter
    assist="full"            the same with guidance and remember: the default
    assist="sight,limiter"   stages of one's own choice, in any order
    assist="grip+sight"      names of stages and of assists may be joined, by a comma or by +
    assist="full-prediction" and stages may be left out

They are called in their own order, not in that of the text. A planner's class says in `source_laws` which speed laws
its source has, and in `assists` which of the four assists mean something else for it.

A stage that no planner uses is not imported. It is called in the order of the
steps of `Stage`; in between every planner sees, refers and begins its decision (planner_batch). A step is a
function, which is called for one world at a time, or one of the native core (NativeStep).
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import ControllerError, SettingsError, accepted_names
from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core
from fg_mujoco.registry import Registry

from ..perception.scan_filters import IntermediateScans
from .planner_settings import Record

SAFE = (
    "mean_range", "distance_ahead", "sight", "safety_filter", "prediction", "recovery", "limiter",
)  # fmt: skip
"""Stages of the assist `safe`."""

ASSISTS: Mapping[str, tuple[str, ...]] = {
    "none": (),
    "grip": ("limiter",),
    "safe": SAFE,
    "full": (*SAFE, "guidance", "remember"),
}
"""The four assists; `none` and `grip` have the speed laws of the planner's source besides."""

_DECISION = "fg_mujoco.controllers.control.decision:"

STAGES: Registry[object] = Registry(
    "stage",
    SettingsError,
    "fg_mujoco.stages",
    {
        "mean_range": f"{_DECISION}MEAN_RANGE_STAGE",
        "distance_ahead": f"{_DECISION}DISTANCE_AHEAD_STAGE",
        "friction_law": f"{_DECISION}FRICTION_LAW_STAGE",
        "prediction": f"{_DECISION}PREDICTION_STAGE",
        "guidance": f"{_DECISION}GUIDANCE_STAGE",
        "imu": f"{_DECISION}IMU_STAGE",
        "limiter": f"{_DECISION}LIMITER_STAGE",
        "sight": f"{_DECISION}SIGHT_STAGE",
        "safety_filter": f"{_DECISION}SAFETY_FILTER_STAGE",
        "recovery": f"{_DECISION}RECOVERY_STAGE",
        "remember": "fg_mujoco.controllers.safety.lap_raceline:REMEMBER",
    },
)
"""Stages by name, each a `stages.Stage`, in the order of their calls; other packages may register theirs.

Of those that write the command the last one does: with sight, what the limiter does is a part of its work.
"""


def names_in(assist: object, what: str = "assist") -> tuple[tuple[str, str], ...]:
    """Return the signs, + or -, and the names that a text joins, each of a stage or an assist.

    Raises:
      SettingsError: no text, an empty part, an unknown name, or one that stands there twice.
    """
    parts = re.split("([,+-])", assist) if isinstance(assist, str) else [""]
    names = [part.strip() for part in parts[::2]]
    for name in names:
        if name not in ASSISTS and name not in STAGES and not (name and STAGES.entry_points(name)):
            said = f"{what} is {assist!r}" if len(names) < 2 else f"{what} {assist!r}: there is no stage {name!r}"
            accepted = accepted_names(name, (*ASSISTS, *STAGES.names()), ", or several joined by commas")
            raise SettingsError(f"{said}; {accepted}")
        if names.count(name) > 1:
            raise SettingsError(f"{what} {assist!r} has {name} twice; accepted: each stage once")
    return tuple(("-" if sign == "-" else "+", name) for sign, name in zip(("+", *parts[1::2]), names, strict=True))


def stages_of(assist: str, source_laws: Sequence[str], assists: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Return the names of the stages that an assist means for a planner, in the order of their work.

    Args:
      assist: as in `names_in`.
      source_laws: names of the speed laws that the planner's source has.
      assists: those of the four assists that mean something else for the planner.

    Raises:
      SettingsError: as in `names_in`, or a law that is no stage.
    """
    chosen: set[str] = set()
    for sign, name in names_in(assist):
        laws = source_laws if name in ("none", "grip") and name not in assists else ()
        meant = {*laws, *assists.get(name, ASSISTS.get(name, (name,)))}
        chosen = chosen | meant if sign == "+" else chosen - meant
    order = list(STAGES)  # those of other packages come last
    return tuple(sorted(chosen, key=lambda name: (order.index(name) if name in order else len(order), name)))


PLACES = ("before_reference", "after_reference", "guide", "after_guidance", "drive", "after_driving")
"""Names of the steps of a Stage, in the order of their calls."""

NO_MEMORY = np.dtype([("unused", np.int8)])
"""Type of the record of a stage, or of a planner, that keeps nothing."""


class Tick(NamedTuple):
    """What a stage knows of one world in one tick, and what it writes to. The fields of a record are attributes."""

    geometry: Record  # of the scan, of type SCAN_GEOMETRY; it and `odometry` are in the velocity frame (slip) from
    odometry: Record  # `guide` on, for a car whose tires need slip angles; of type ODOMETRY
    ranges: FloatArray  # readings (n,) [m], without NaN or inf
    ranges_without_cars: FloatArray  # the same for guidance: a planner that sees other cars has taken them out
    ranges_without_movers: FloatArray  # the same without what moves; undefined where `memory.predictions` has no rows
    driver: Record  # the planner's car, settings and limits, of type DRIVER
    line: FloatArray  # the planner's line through the map (points, columns); no points without a map
    trajectories: NDArray[np.void]  # (1,) braking trajectories of type TRAJECTORIES; undefined without `sight`
    reference: Record  # of type REFERENCE, written to
    memory: Record  # what driving keeps from tick to tick, of type DRIVING_MEMORY, written to
    state: Record  # what this stage keeps from tick to tick, of its `state_type`, written to
    debug: IntermediateScans  # for pictures; written to
    command: FloatArray  # (2,) steering angle [rad] and speed [m/s], written to
    record: Record  # of type TICK, with the records above; a stage that writes the command sets `record.decided`


@dataclass(frozen=True)
class NativeStep:
    """A step of the native core, by its name in native/controllers/control/steps.cpp."""

    name: str

    def call(self, table: int) -> tuple[int, int]:
        """Return the address of its code, and that of the table that it is called with, see `call_all`."""
        return core.STEPS[self.name], table


Step = Callable[[Tick], None] | NativeStep
"""A function of a stage, or a step of the native core."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A stage of driving.

    Attributes:
      text: what it does, in one line.
      needs: names of the stages without which it can do nothing.
      needs_friction: whether it has no meaning for a planner that assumes no friction limit, mu = inf.
      before_reference: step that is called before the planner refers; None: none is called then.
      after_reference: the same once the planner has referred.
      guide: the same once the decision has begun.
      after_guidance: the same; if it decides, it sets `tick.record.decided`.
      drive: writes the command, unless there is one. Of a planner's stages only the last one that has it is called.
      after_driving: the same once there is a command.
      state_type: type of the stage's memory in a world, which is zero at the beginning.

    Raises:
      ControllerError: what is called at a place is no function of a Tick.
    """

    text: str = ""
    needs: tuple[str, ...] = ()
    needs_friction: bool = False
    before_reference: Step | None = None
    after_reference: Step | None = None
    guide: Step | None = None
    after_guidance: Step | None = None
    drive: Step | None = None
    after_driving: Step | None = None
    state_type: np.dtype[np.void] = NO_MEMORY

    def __post_init__(self) -> None:
        for name in PLACES:
            step = getattr(self, name)
            if step is None or isinstance(step, NativeStep):
                continue
            said = f"Stage.{name} is {getattr(step, '__name__', step)!r}"
            try:
                inspect.signature(step).bind(None)
            except TypeError as error:
                raise ControllerError(f"{said} ({error}); accepted: a function of (tick: Tick)") from error


class BatchArrays(NamedTuple):
    """The arrays of a batch of n worlds, in the order of its table."""

    geometry: NDArray[np.void]  # (1,) of type SCAN_GEOMETRY
    measured: FloatArray  # (n, beams) [m]
    odometry: NDArray[np.void]  # (n,) of type ODOMETRY
    running: NDArray[np.bool_]  # (n,)
    ticks: NDArray[np.void]  # (n,) of type TICK
    lines: FloatArray  # (points, columns) of the lines through the map, of all planners
    trajectories: NDArray[np.void]  # (tables,) of type TRAJECTORIES, of all planners
    ranges: FloatArray  # (n, beams) [m]; this and the following as in Tick
    ranges_without_cars: FloatArray
    ranges_without_movers: FloatArray
    debug: FloatArray
    commands: FloatArray


STAGE_ARRAYS = ("batch", "active", "states")
"""Names of the arrays of one stage: the table of its batch, the worlds that have the stage, and its states."""
