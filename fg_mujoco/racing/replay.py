"""The proof that a run was driven as its folder says: it is simulated again, and what follows from that is compared.

report = replay("runs/oval")
assert report.holds
print(report.proved, report.unproved)

The scene, the first state and the controls are taken as given. From these follow every state, the telemetry, and the
figures of the summary that depend on what was driven. `replay` runs no planner, so that it says nothing of its
decisions; `decisions_again` does.
"""

from __future__ import annotations

import contextlib
import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from ..arguments import explain_class
from ..course.course import Course
from ..course.files import kept_folder
from ..display import brief
from ..errors import FgMujocoError
from ..messages import CarParameters, FloatArray
from ..simulation.course_loading import load_track
from ..simulation.engine import Engine
from ..simulation.planner_adapter import plan
from ..simulation.planner_failure import one_line
from ..simulation.telemetry import COMMAND, TELEMETRY, recorded_command
from ..simulation.termination import END_REASONS
from ..simulation.world import World, shows
from ..vehicle.motion import drive
from ..vehicle.vehicle import Vehicle
from .resimulation import Recording, load_world, recorded_planner, resimulate
from .result import (
    COURSE_FIGURES,
    EVENTS,
    OF_CAR_0,
    History,
    Trajectory,
    course_figures,
    driven_figures,
    track_figures,
    trajectory_sha256,
    world_figures,
)
from .rules import RaceRecord, race_control
from .run_folder import NOT_SIMULATED, SCENE, STATES, SUMMARY, TELEMETRY_FILE, Run, of_car, read_run
from .summary import as_json, versions

_FROM_OUTSIDE = ("interrupted", "failed", "planner_failed", "decision_limit")  # reasons that no simulation tells
_OF_PLANNERS = ("planner_failed", "decision_limit")
_OF_THE_COURSE = ("lap", "progress_m", "offset_m")  # columns of the telemetry
_WALL_TIMES = ("wall_time_s", "realtime_factor", "decision_times")
_VERSIONS = {"fg_mujoco_version": "fg_mujoco", "mujoco_version": "MuJoCo", "platform": "the platform"}
_ASKED_FOR = "no planner is run"


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Something in a folder that is not what the replay gives; its text is one line."""

    name: str  # of the file and what it is in there
    recorded: str
    recomputed: str

    def __str__(self) -> str:
        return f"{self.name}: recorded {self.recorded}, recomputed {self.recomputed}"


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class ReplayReport:
    """Comparison of a replay with what was recorded; its text is one line, and `lines` has all of it."""

    identical: bool  # every bit of every state, and the summary's trajectory_sha256
    ticks: int
    trajectory_sha256: str  # of what was replayed
    proved: Mapping[str, tuple[str, ...]]  # by file: columns of the telemetry, keys of the summary
    unproved: Mapping[str, str]  # why not, by what is not proved
    differences: tuple[Difference, ...]
    first_difference: int | None = None  # tick, from 1, that first ends in another state; None: none does
    time: float | None = None  # [s] at its end
    greatest_difference: float | None = None  # there, of any component of the state
    versions: str = ""  # that differ where the states do, recorded and present ones; "": none is another one

    def __repr__(self) -> str:
        return brief(self, str(self))

    @property
    def holds(self) -> bool:
        """Whether nothing in the folder differs from the replay."""
        return self.identical and not self.differences

    @property
    def lines(self) -> tuple[str, ...]:
        """The figures that are proved, those that are not and why, and those that differ, for people."""
        columns = {TELEMETRY_FILE: f"all {len(TELEMETRY)} columns"} if self._all_columns else {}
        proved = [f"{file}: {columns.get(file, ', '.join(names))}" for file, names in self.proved.items()]
        reasons: dict[str, list[str]] = {}
        for name, reason in self.unproved.items():
            reasons.setdefault(reason, []).append(name)
        not_proved = [f"{', '.join(names)} ({reason})" for reason, names in reasons.items()]
        said = (("proved", proved), ("not proved", not_proved), ("DIFFERS", map(str, self.differences)))
        return tuple(f"{what}: {line}" for what, lines in said for line in lines)

    @property
    def _all_columns(self) -> bool:
        return len(self.proved.get(TELEMETRY_FILE, ())) == len(TELEMETRY)

    def __str__(self) -> str:
        if self.first_difference is not None:
            return (
                f"not identical: differs from tick {self.first_difference} of {self.ticks} on, at t = {self.time:.3f} "
                f"s by up to {self.greatest_difference:.3g} in a component of the state{self.versions}"
            )
        if not self.identical:
            return f"not identical: the states are, but {SUMMARY} has not their hash, {self.trajectory_sha256}"
        differ = f"; {len(self.differences)} of its figures differ" if self.differences else ""
        return (
            f"bit-identical: {self.ticks} ticks of the recorded commands, trajectory_sha256 "
            f"{self.trajectory_sha256}{differ}"
        )


def replay(folder: str | Path) -> ReplayReport:
    """Simulate a run again from its first state and recorded controls, and compare all that follows, bit for bit.

    Raises:
      RunFolderError: the folder is not a run folder, or is damaged.
    """
    run = read_run(folder)
    world = load_world(run)
    differences, no_course = [], ""
    try:
        course = raced_course(run, world.parameters)
    except FgMujocoError as error:
        no_course = f"the course cannot be made again: {error}"
    else:
        if shows(run.xml, course):
            world.track = course
        else:
            no_course = f"{course.name} has other walls than {SCENE}"
            recorded = _text(run.summary.get("track"))
            differences.append(Difference(name=f"{SUMMARY}, track", recorded=recorded, recomputed=no_course))
    again = _Again(run, world)
    states = again.trajectory["states"]
    differs = (states.view(np.uint64) != run.states.view(np.uint64)).any(axis=1)  # as bits: NaN is NaN, -0 is not 0
    if differs.any():
        first = int(differs.argmax())
        reason = "the states are not those of the replay"
        return ReplayReport(
            identical=False, ticks=len(run.ctrl), trajectory_sha256=trajectory_sha256(states, run.ctrl), proved={},
            unproved=dict.fromkeys((TELEMETRY_FILE, SUMMARY), reason), differences=tuple(differences),
            first_difference=first, time=float(run.time[first]),
            greatest_difference=float(np.abs(states[first] - run.states[first]).max()), versions=_other_versions(run),
        )  # fmt: skip
    return _compared(run, again, differences, no_course)


def _other_versions(run: Run) -> str:
    """Return in words which versions of a run are others here; "": none."""
    others = [
        f"{_VERSIONS[name]} (recorded {recorded}, here {here})"
        for name, here in versions().items()
        if (recorded := run.summary.get(name)) != here
    ]
    return f"; other versions: {', '.join(others)}" if others else ""


@kept_folder()
def decisions_again(folder: str | Path, controller: str) -> str:
    """Return a line that says whether a planner answers the recorded commands of car 0 again, and if not tried, why.

    The planner gets the scans and odometry of the race. One that reads a clock, or draws numbers without a seed,
    answers otherwise.

    Args:
      folder: of the run.
      controller: the planner's text; without settings in brackets it has those that the run recorded.

    Raises:
      RunFolderError: the folder is not a run folder, or is damaged.
    """
    run = read_run(folder)
    asked = differing = 0
    if (reason := run.summary.get("end_reason")) in _FROM_OUTSIDE:  # the planner might end this process, too
        return f"planner not asked again: its race ended as {reason!r}"
    try:
        world = load_world(run)
        planner = recorded_planner(run.summary, world.model, controller=controller, where=str(folder))
        for tick in resimulate(cast(Recording, run), world):
            if hasattr(planner, "look_round"):
                planner.look_round(tick.surroundings(world))
            with contextlib.redirect_stdout(sys.stderr):  # what it prints is not the replay's
                answer = plan(planner, tick.sensed.scan, tick.sensed.odometry)
            asked, differing = asked + 1, differing + (recorded_command(answer) != tick.command)
    except Exception as error:  # the planner's code is not ours
        return f"planner not asked again: {one_line(error)}"
    if differing:
        said = "it depends on more than its scans, such as a clock, or its code has changed"
        return f"planner asked again: other commands in {differing} of {asked} decisions; {said}"
    return f"planner asked again: the same commands in all {asked} decisions"


def raced_course(run: Run, car: CarParameters) -> Course:
    """Return the course that a run says it was raced on, made again from its name or file.

    Args:
      run: what was recorded.
      car: that a scene is made for where the vehicle of the summary is not there.

    Raises:
      TrackError: there is none.
    """
    settings = run.summary.get("settings") or {}
    source, vehicle = (settings.get(name) or run.summary.get(name) for name in ("track", "vehicle"))
    try:
        found = Vehicle.load(str(vehicle))
        if found.sha256 == run.summary.get("vehicle_sha256"):
            car = found.parameters
    except FgMujocoError:  # a file that is not here
        pass
    return load_track(str(source), car=car)


class _Again:
    """A run that was driven again.

    Args:
      run: what was recorded.
      world: of its scene; with its course, the race is judged.

    Attributes:
      engine: at the end.
      trajectory: its states, controls and telemetry.
      over: the tick in which the race was over by its rules, and why; None: it went on to the end of the recording.
    """

    def __init__(self, run: Run, world: World) -> None:
        settings = run.summary.get("settings")
        self.limit_known = isinstance(settings, dict)
        limit = settings.get("time_limit") if isinstance(settings, dict) else math.inf
        laps = run.summary.get("laps_requested") or 1
        self.engine = engine = Engine(world, laps=laps, time_limit=limit)
        engine.load(run.states[0], timed=True)
        history = History(engine)
        self.ends = [len(run.ctrl)] * engine.cars_per_world  # the tick in which the race of each car was over
        self.rows = run.summary.get("cars") or [{}]
        names = [str(row.get("name", "car_0")) for row in self.rows]
        self.control = RaceRecord(engine, names=names)
        if world.track is not None:
            self.control = race_control(engine, names=names, rules=run.summary.get("rules") or "none")
        self.over: tuple[int, str] | None = None if engine.running.any() else (0, self._reason)
        self._drive_again(run, history)
        self.trajectory: Trajectory = history.arrays()
        self.telemetries = [history.arrays(row)["telemetry"] for row in range(engine.cars_per_world)]

    def _drive_again(self, run: Run, history: History) -> None:
        """Drive the cars as they were; what ended a race from outside ends it when it did."""
        engine, rows, summary = self.engine, self.rows, run.summary
        ended = [float(row.get("end_time_s", run.time[-1])) for row in rows]  # older runs of one car lack it
        ends = np.searchsorted(run.time, np.array(ended) - 1e-9)
        columns, commanded = slice(COMMAND, COMMAND + 2), np.empty(run.ctrl.shape[1])
        commands = np.stack([run.telemetry[:, columns], *(other[:, columns] for other in run.others)], axis=1)
        reasons = [str(row.get("end_reason", summary.get("end_reason"))) for row in rows]
        over = np.zeros(len(rows), np.bool_)
        for tick, controls in enumerate(run.ctrl):
            engine.sense()
            self._end_from_outside(reasons, ends == tick, before=True)
            if engine.world.track is None or not engine.running.any():
                engine.running[0] = True
            for car, (steering_angle, speed) in enumerate(commands[tick].tolist()):
                drive(steering_angle, speed, engine.world.cars[car].constants, commanded)
            engine.drive(controls=controls[np.newaxis])
            same = commanded.tobytes() == controls.tobytes()
            engine.telemetry[:, columns] = commands[tick] if same else controls.reshape(-1, 2)
            alone = len(rows) == 1 and not self.control.puts_back_at_walls
            if alone:  # a race of one car keeps the tick in which it finishes
                history.append()
            engine.judge()
            self._end_from_outside(reasons, ends == tick + 1, before=False)
            self.control.after_tick()
            if not alone:
                history.append()
            for car in map(int, np.flatnonzero(~engine.running & ~over)):
                self.ends[car], over[car] = history.ticks, True
            if self.over is None and over.all() and engine.world.track is not None:
                self.over = (history.ticks, self._reason)
        self._end_from_outside(reasons, ends == len(run.ctrl), before=True)
        if not len(run.ctrl):  # it was interrupted before the first tick
            self._end_from_outside(reasons, ends == 0, before=False)
        self.control.finish()

    def _end_from_outside(self, reasons: Sequence[str], which: Any, *, before: bool) -> None:
        """End the races of some cars, (m,), whose reasons no simulation tells: of planners before a tick is driven."""
        for car in map(int, np.flatnonzero(which & self.engine.running)):
            reason = reasons[car]
            if self.from_outside(reason) and (reason in _OF_PLANNERS) == before:
                self.engine.monitor.end(np.arange(len(reasons)) == car, reason)

    @property
    def _reason(self) -> str:
        return END_REASONS[self.engine.monitor.reasons[0]]

    def figures(self, *, on_course: bool) -> dict[str, Any]:
        """Return the figures of the summary that follow from the trajectory, and from the course where it is there."""
        rows = []
        for car, recorded in enumerate(self.rows):
            put_back = self.control.wall_contacts[car]
            figures: dict[str, Any] = {**driven_figures(self.engine, self.telemetries[car], car, put_back)}
            if on_course:
                figures |= course_figures(self.engine, self._to_the_end_of(car), car)
                touched = (str(recorded.get("name")) in contact.cars for contact in self.control.contacts)
                figures["collisions_car"] = sum(touched)
            rows.append(figures)
        own = {name: rows[0][name] for name in OF_CAR_0 if name in rows[0]}
        found = {**own, "collisions": rows[0]["collisions_wall"], **world_figures(self.trajectory)}
        if not on_course:
            return found
        both = zip(self.rows, rows, strict=True)
        found["cars"] = [{name: figures.get(name, value) for name, value in row.items()} for row, figures in both]
        return found | track_figures(self.engine) | {name: getattr(self.control, name) for name in EVENTS}

    def _to_the_end_of(self, car: int) -> Trajectory:
        """Return the trajectory up to where the race of a car was over."""
        ticks, own = self.ends[car], self.trajectory
        telemetry = self.telemetries[car][:ticks]
        return {"telemetry": telemetry, "states": own["states"][: ticks + 1], "ctrl": own["ctrl"][:ticks]}

    def from_outside(self, reason: object) -> bool:
        """Return whether a race ends for a reason that its states do not tell."""
        return reason in _FROM_OUTSIDE or (reason == "time_limit" and not self.limit_known)


def _compared(run: Run, again: _Again, found: list[Difference], no_course: str) -> ReplayReport:
    """Return the figures that are proved of a run whose states are those of its replay."""
    summary = run.summary
    recorded_end = summary.get("end_reason")
    differences = [*found, *_of_the_files(run, again, no_course)]
    unproved: dict[str, str] = {}
    figures = again.figures(on_course=not no_course)
    recomputed = json.loads(as_json(figures))
    for name, value in recomputed.items():
        if name in summary and _text(summary[name]) != _text(value):
            differences.append(
                Difference(name=f"{SUMMARY}, {name}", recorded=_text(summary[name]), recomputed=_text(value))
            )
    if not no_course and again.from_outside(recorded_end):
        unproved["end_reason"] = "nothing else had ended the race; its states do not say what did"
    unproved["clamped_commands"] = f"counted in {TELEMETRY_FILE}; the actuators do not show by how much"
    unproved |= {name: _why_not(name, no_course) for name in summary if name not in recomputed}
    unproved |= {name: f"not in {SUMMARY}" for name in recomputed if name not in summary}
    columns = TELEMETRY
    if no_course:
        columns = tuple(name for name in TELEMETRY if name not in _OF_THE_COURSE)
        unproved |= {f"{TELEMETRY_FILE}, {name}": no_course for name in _OF_THE_COURSE}
    unproved |= {name: "no simulation makes it" for name in NOT_SIMULATED if (run.folder / name).exists()}
    parted = {difference.name for difference in differences}
    proved = {
        STATES: tuple(name for name in ("time", "state", "ctrl") if f"{STATES}, {name}" not in parted),
        TELEMETRY_FILE: tuple(name for name in columns if f"{TELEMETRY_FILE}, {name}" not in parted),
        SUMMARY: tuple(
            name for name in recomputed if name in summary and not {name, f"{SUMMARY}, {name}"} & {*unproved, *parted}
        ),
    }
    return ReplayReport(
        identical=figures["trajectory_sha256"] == summary.get("trajectory_sha256"), ticks=len(run.ctrl),
        trajectory_sha256=figures["trajectory_sha256"], proved=proved, unproved=unproved,
        differences=tuple(differences),
    )  # fmt: skip


def _of_the_files(run: Run, again: _Again, no_course: str) -> Iterable[Difference]:
    """Yield what differs in the arrays of a run: each column where it first does."""
    telemetry, ticks = again.trajectory["telemetry"], len(run.ctrl)
    if again.over is not None and again.over[0] < ticks:
        tick, reason = again.over
        yield Difference(name=f"{STATES}, ticks", recorded=f"{ticks}", recomputed=f"{tick}, then over: {reason}")
    columns = [(f"{STATES}, time", run.time, again.trajectory["states"][:, 0])]
    columns += [
        (f"{TELEMETRY_FILE}, {name}", run.telemetry[:, k], telemetry[:, k])
        for k, name in enumerate(TELEMETRY)
        if not (no_course and name in _OF_THE_COURSE)
    ]
    for car, (other, own) in enumerate(zip(run.others, again.telemetries[1:], strict=True), start=1):
        file = of_car(TELEMETRY_FILE, car)
        columns += [
            (f"{file}, {name}", other[:, k], own[:, k])
            for k, name in enumerate(TELEMETRY)
            if not (no_course and name in _OF_THE_COURSE)
        ]
    for name, recorded, recomputed in columns:
        differs = _bits(recorded) != _bits(recomputed)
        if differs.any():
            row = int(differs.argmax())
            place = f" in row {row + 1}, the first of {int(differs.sum())}"
            yield Difference(name=name, recorded=f"{recorded[row]!r}{place}", recomputed=f"{recomputed[row]!r}")


def _bits(values: FloatArray) -> Any:
    """Return numbers as bits, all NaN alike."""
    return np.where(np.isnan(values), math.nan, values).view(np.uint64)


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True)


def _why_not(name: str, no_course: str) -> str:
    if no_course and name in (*COURSE_FIGURES, "cars"):
        return no_course
    if name in _WALL_TIMES:
        return "wall times"
    if name == "files":
        return "checksums, which tell damage and not who wrote them"
    return "versions" if name in ("schema", *_VERSIONS) else _ASKED_FOR
