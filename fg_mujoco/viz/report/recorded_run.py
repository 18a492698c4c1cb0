"""The input of a report: a run folder, a Run or a RaceResult, read into the same fields."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco

from ...errors import ModelError, RunFolderError
from ...messages import CarParameters, FloatArray
from ...racing.crash import Crash
from ...racing.result import RaceResult
from ...racing.run_folder import SUMMARY, Run, read_run, summary_json
from ...simulation.planner_adapter import short
from ...simulation.telemetry import TELEMETRY
from ...simulation.termination import WrongWay
from ...simulation.world import CAR_PREFIX
from ...vehicle.car import car_parameters


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedRun:
    """A race as it was recorded."""

    source: str  # a folder, or what else it was read from
    summary: dict[str, Any] = field(repr=False)  # as in summary.json
    telemetry: FloatArray = field(repr=False)  # (ticks, len(TELEMETRY))
    model: mujoco.MjModel = field(repr=False)  # of its world

    def column(self, name: str) -> FloatArray:
        """Return one column of the telemetry, shape (ticks,)."""
        return self.telemetry[:, TELEMETRY.index(name)]

    @property
    def mu(self) -> float:
        """Friction coefficient of the tires [-]."""
        return float(self.summary["mu"])

    @property
    def lap_times(self) -> tuple[float, ...]:
        """Of the laps that were completed [s]."""
        return tuple(float(time) for time in self.summary["lap_times_s"])

    @property
    def end(self) -> float:
        """Simulated time at the end [s]."""
        return float(self.summary["sim_time_s"])

    @property
    def wrong_way(self) -> WrongWay | None:
        """Where the car turned; None: the race did not end by going the wrong way."""
        told = self.summary.get("wrong_way")  # older runs lack it
        return None if told is None else WrongWay(**told)

    @property
    def planner_failure(self) -> dict[str, Any] | None:
        """How the planner failed, as in summary.json; None: it did not."""
        told: dict[str, Any] | None = self.summary.get("planner_failure")  # older runs lack it
        return told

    @property
    def crash(self) -> Crash | None:
        """What the car hit; None: the race did not end in a crash."""
        told = self.summary.get("crash")  # older runs lack it
        return None if told is None else Crash(**told)

    @cached_property
    def car(self) -> CarParameters:
        """Of the car that was raced."""
        return car_parameters(self.model, CAR_PREFIX)


def _is_finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and -_GREATEST <= value <= _GREATEST


def _is_place(value: Any) -> bool:
    return isinstance(value, dict) and set(value) == set(_WRONG_WAY) and all(map(_is_finite, value.values()))


def _is_figures(value: Any) -> bool:
    return isinstance(value, dict) and all(each is None or _is_finite(each) for each in value.values())


def _is_crash(value: Any) -> bool:
    texts = ("into", "geom")
    return (
        isinstance(value, dict)
        and set(value) == set(_CRASH)
        and all(isinstance(value[name], str) if name in texts else _is_finite(value[name]) for name in value)
    )


def _is_failure(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and {"error", "time_s", "file", "line", "traceback"} <= set(value)
        and _is_finite(value["time_s"])
        and (value["line"] is None or _is_finite(value["line"]))
        and all(isinstance(each, str) or each is None for name, each in value.items() if name not in ("time_s", "line"))
    )


_GREATEST = 1e9
_WRONG_WAY = tuple(field.name for field in fields(WrongWay))
_CRASH = tuple(field.name for field in fields(Crash))
_TEXT = ("a text", lambda value: isinstance(value, str))
_TRUTH = ("true or false", lambda value: isinstance(value, bool))
_COUNT = ("a whole number from 0", lambda value: _is_finite(value) and isinstance(value, int) and value >= 0)
_NUMBER = (f"a number within {_GREATEST:.0e}", _is_finite)
_NUMBERS = ("a list of numbers", lambda value: isinstance(value, list) and all(map(_is_finite, value)))

_NEEDED: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "track": _TEXT, "controller": _TEXT, "laps_requested": _COUNT, "laps_completed": _COUNT, "finished": _TRUTH,
    "end_reason": _TEXT, "lap_times_s": _NUMBERS, "collisions": _COUNT, "max_slide_m_s": _NUMBER,
    "slide_time_fraction": _NUMBER, "mean_speed_m_s": _NUMBER, "max_speed_m_s": _NUMBER, "sim_time_s": _NUMBER,
    "mu": _NUMBER, "speed_limit_m_s": _NUMBER, "trajectory_sha256": _TEXT,
}  # fmt: skip
"""What a report is made of, by name: what is accepted, and what says whether a value is."""


def read_recorded(source: RaceResult | Run | str | Path) -> RecordedRun:
    """Return a race to be reported.

    Raises:
      RunFolderError: a folder that is none of `race --out`, lacks a file, or is of another version.
    """
    if isinstance(source, RaceResult):
        return RecordedRun(
            source=f"{source.track}, {source.controller}", summary=json.loads(summary_json(source)),
            telemetry=source.telemetry, model=source.world.model,
        )  # fmt: skip
    run = source if isinstance(source, Run) else read_run(source)
    missing = [name for name in _NEEDED if run.summary.get(name) is None]
    if missing:
        raise RunFolderError(
            f"{run.folder / SUMMARY}: has no {', '.join(missing)}; accepted: as this version's `race --out` wrote it"
        )
    wrong = (f"wrong_way, of {', '.join(_WRONG_WAY)}", lambda value: value is None or _is_place(value))
    crash = (f"crash, of {', '.join(_CRASH)}", lambda value: value is None or _is_crash(value))
    failure = ("planner_failure, as a race wrote it", lambda value: value is None or _is_failure(value))
    figure = ("a number", lambda value: value is None or _is_finite(value))
    times = ("numbers by name", lambda value: value is None or _is_figures(value))
    optional = {
        "wrong_way": wrong, "crash": crash, "planner_failure": failure, "decision_times": times,
        "clamped_commands": figure, "decision_limit_s": figure, "max_lateral_slide_m_s": figure,
    }  # fmt: skip
    for name, (accepted, accepts) in (_NEEDED | optional).items():
        if not accepts(value := run.summary.get(name)):
            raise RunFolderError(f"{run.folder / SUMMARY}: {name} is {short(value)}; accepted: {accepted}")
    try:
        model = mujoco.MjModel.from_xml_string(run.xml)
        recorded = RecordedRun(source=str(run.folder), summary=run.summary, telemetry=run.telemetry, model=model)
        _ = recorded.car
    except (ValueError, OSError, ModelError) as error:
        reason = " ".join(str(error).split())
        raise RunFolderError(f"{run.scene}: cannot be read: {reason}; accepted: as `race --out` wrote it") from error
    return recorded
