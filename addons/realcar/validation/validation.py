"""Validates a model against recorded drives: windows of 1, 2 and 5 s, and steady states, nothing fitted."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

from ..drives.drive_recording import RecordedDrive
from ..drives.reading import read_drives
from ..identification.fit import require_scipy
from .agreement import UNITS, Agreement, agreements, joined, rms, steady_task, task_of
from .car_model import CarModel
from .unknown import AGREES, unknown_parts
from .windows import (
    HOLD_SPEED,
    LENGTHS,
    PERIOD,
    STEADY_MEAN,
    DriveMotion,
    SteadyState,
    Window,
    motion_of,
    steady_states_of,
    windows_of,
)

COMMANDS, HELD, STEADY = "recorded commands", "recorded speed held", "steady states"
"""How models are driven: by the recorded commands of steering and of speed or acceleration; by the recorded steering at
the recorded speed, smoothed, which leaves the motor and its controller out; and at the steering and speed of a steady
state."""

_SPIN = 0.7  # [rad] of sideslip: a car that has spun
_SAME_STEERING, _SAME_SPEED = 0.02, 0.2  # [rad], [m/s] within which steady states are one


@dataclass(frozen=True, kw_only=True)
class SteadyAgreement:
    """A steady state as it was recorded, the mean of all that are alike, and as the model settled."""

    steering: float  # [rad]
    speed: float  # [m/s]
    count: int  # how many were recorded
    yaw_rate: float  # [rad/s] recorded
    model_yaw_rate: float  # [rad/s]
    lateral_acceleration: float  # [m/s^2] recorded: speed times yaw rate
    model_lateral_acceleration: float  # [m/s^2]
    slip_angle: float  # [rad] recorded, smoothed
    model_slip_angle: float  # [rad]
    model_speed: float  # [m/s] at which it settled
    spun: bool  # whether the model spun, in any of them


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Validation:
    """How well a model agrees with recorded drives."""

    model: str
    car: CarParameters
    friction: float  # [-] of the tires, or their greatest peak
    drives: tuple[RecordedDrive, ...]
    left_out: tuple[str, ...]  # drives without a window, and why
    windows: dict[float, int]  # length [s] -> how many there are
    agreements: dict[tuple[str, float], tuple[Agreement, ...]]  # how it was driven and length [s]; 0: steady states
    steady: tuple[SteadyAgreement, ...]
    motions: tuple[DriveMotion, ...] = field(repr=False)
    driven: dict[tuple[str, float], tuple[tuple[Window, ...], FloatArray]] = field(repr=False)  # windows and motions

    def __repr__(self) -> str:
        said = f"{len(self.drives)} drives, friction {self.friction:.4g}"
        found = self.agreement("yaw rate", HELD, 1.0)
        return brief(self, self.model, said, "" if found is None else f"yaw rate {100.0 * found.share:.3g} % in 1 s")

    def agreement(self, signal: str, how: str, length: float) -> Agreement | None:
        """Return how far a signal is off: `how` is COMMANDS, HELD or STEADY, with a length of 0; None: not driven."""
        return next((each for each in self.agreements.get((how, length), ()) if each.signal == signal), None)

    @property
    def plateau(self) -> tuple[float, float]:
        """The greatest lateral acceleration of the steady states [m/s^2]: recorded, and of the model; NaN: none."""
        if not self.steady:
            return math.nan, math.nan
        return (
            max(abs(each.lateral_acceleration) for each in self.steady),
            max(abs(each.model_lateral_acceleration) for each in self.steady),
        )

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The agreements as records: a row for each way of driving, length and signal."""
        return [
            {
                "model": self.model, "friction": self.friction, "driven_by": how,
                "window_s": length or None, "windows": len(self.driven[how, length][0]) if length else len(self.steady),
                "signal": each.signal, "unit": each.unit, "rms": each.rms, "share_percent": 100.0 * each.share,
                "worst": each.worst, "worst_at": each.worst_at,
            }
            for (how, length), found in self.agreements.items()
            for each in found
        ]  # fmt: skip

    @property
    def table(self) -> Table:
        """The agreements, a row for each signal, as people read it."""
        rows = []
        for (how, length), found in self.agreements.items():
            name = f"{how}, {length:g} s" if length else how
            for each in found:
                worst = f"{each.worst:.3g} {each.unit}"
                rows.append((name, each.signal, f"{each.rms:.3g} {each.unit}", f"{100.0 * each.share:.1f} %", worst))
        header = ("driven by", "signal", "rms error", "of its rms", "worst")
        return Table(header=header, rows=rows, left=("driven by", "signal"))

    @property
    def steady_table(self) -> Table:
        """The steady states, a row each."""
        header = (
            "steering [rad]", "speed [m/s]", "states", "yaw rate [rad/s]", "model", "off by [%]",
            "lateral acceleration [m/s^2]", "model ", "slip angle [rad]", " model", "spun",
        )  # fmt: skip
        rows = [
            (
                f"{each.steering:.3f}", f"{each.speed:.2f}", each.count, f"{each.yaw_rate:.3f}",
                f"{each.model_yaw_rate:.3f}", f"{100.0 * (each.model_yaw_rate / each.yaw_rate - 1.0):.1f}",
                f"{each.lateral_acceleration:.2f}", f"{each.model_lateral_acceleration:.2f}", f"{each.slip_angle:.3f}",
                f"{each.model_slip_angle:.3f}", each.spun,
            )
            for each in self.steady
        ]  # fmt: skip
        return Table(header=header, rows=rows)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Which part is not known of each drive whose yaw rate is off by more than `unknown.AGREES`."""
        windows, simulated = self.driven.get((self._how, 1.0), ((), np.empty((0, 0, 6))))
        return unknown_parts(
            self.motions, windows, simulated, rear=self.car.rear_axle_distance, grip=self.friction * self.car.gravity
        )

    @property
    def _how(self) -> str:
        """How drives are judged: by the recorded commands, or at the recorded speed where there are none."""
        return COMMANDS if (COMMANDS, 1.0) in self.driven else HELD

    def __str__(self) -> str:
        seconds = sum(drive.end - drive.start for drive in self.drives)
        recorded, model = self.plateau
        lines = [f"{self.model}, friction {self.friction:.4g}: {len(self.drives)} drives of {seconds:.0f} s", ""]
        lines.append(self.table.markdown())
        if self.steady:
            lines.append(self.steady_table.markdown())
            off = 100.0 * (model / recorded - 1.0)
            lines.append(
                f"greatest lateral acceleration of steady states: recorded {recorded:.2f} m/s^2, model {model:.2f} "
                f"({off:+.1f} %)"
            )
        unknown, how = self.unknown, self._how
        counted = len({window.drive for window in self.driven[how, 1.0][0]}) if (how, 1.0) in self.driven else 0
        lines.append(f"yaw rate within {AGREES:.0%} in 1 s, {how}: {counted - len(unknown)} of {counted} drives")
        return "\n".join([*lines, *unknown, *self.left_out])


def validate(
    drives: Sequence[str | Path | RecordedDrive] | str | Path,
    *,
    vehicle: str | Path | Vehicle = DEFAULT_VEHICLE,
    tires: str | Path | Tires | None = None,
    mu: float | None = None,
    columns: Any = None,
    threads: int = 1,
    watch: Callable[[str], None] | None = None,
) -> Validation:
    """Return how well one of our cars agrees with recorded drives. Nothing is fitted.

    `drives` are CSV files with `columns` as of `read_drive`, folders of them, bags, run folders, or drives that were
    read. Tires that are None are the vehicle's, and `mu` is their greatest peak; None: as in their file. The result has
    the same bits for any number of `threads`. `watch` is told the progress in words.
    Raises MissingExtraError: SciPy, or a bag without the extra `ros`; SettingsError: a drive that cannot be read, or
    none in which the car moves; ModelError: a file that is not that of a vehicle.
    """
    loaded = Vehicle.load(vehicle)
    model = CarModel(
        vehicle=loaded, tires=loaded.tires if tires is None else Tires.load(tires), mu=mu, threads=threads
    )  # fmt: skip
    return validate_model(model, read(drives, columns=columns, vehicle=loaded, watch=watch), watch=watch)


def read(
    drives: Sequence[str | Path | RecordedDrive] | str | Path,
    *,
    columns: Any = None,
    vehicle: Vehicle | None = None,
    watch: Callable[[str], None] | None = None,
) -> list[RecordedDrive]:
    """Return the parts of drives that are given as such, as files or as folders; errors as of `read_drives`."""
    listed = [drives] if isinstance(drives, (str, Path)) else list(drives)
    found: list[RecordedDrive] = []
    for number, each in enumerate(listed, start=1):
        if watch is not None:
            watch(f"reading drives {number}/{len(listed)}")
        if isinstance(each, RecordedDrive):
            found.append(each)
        else:
            found += read_drives(each, columns=columns, vehicle=vehicle)
    return [part for drive in found for part in drive.parts()]


def _motions_of(
    drives: Sequence[RecordedDrive], model: CarModel, watch: Callable[[str], None] | None
) -> tuple[list[DriveMotion], list[str]]:
    """Return the smoothed motions of drives for the car of a model, and which drives are left out and why."""
    require_scipy()
    if not drives:
        raise SettingsError("no drive; accepted: one or more")
    motions: list[DriveMotion] = []
    left_out = []
    for number, drive in enumerate(drives, start=1):
        if watch is not None:
            watch(f"smoothing drive {number}/{len(drives)}")
        try:
            motions.append(motion_of(drive, model.car, model.name, model.response))
        except SettingsError as error:
            if len(drives) == 1:
                raise
            left_out.append(f"left out: {error}")
    return motions, left_out


def validate_model(
    model: CarModel, drives: Sequence[RecordedDrive], *, watch: Callable[[str], None] | None = None
) -> Validation:
    """Return how well any model agrees with recorded drives; `watch` and errors as of `validate`."""
    motions, left_out = _motions_of(drives, model, watch)
    commanded = bool(motions) and all(motion.commanded[0] != HOLD_SPEED for motion in motions)
    windows = {length: windows_of(motions, length) for length in LENGTHS}
    parts: list[tuple[tuple[str, float], list[Window]]] = [
        ((how, length), found)
        for how in ((COMMANDS, HELD) if commanded else (HELD,))
        for length, found in windows.items()
        if found
    ]
    if not parts:
        names = ", ".join(drive.name for drive in drives)
        raise SettingsError(f"{names}: no second in which the car moves; accepted: drives with 1 s above 1 m/s")
    states = steady_states_of(motions)
    tasks = [task_of(motions, found, held=how == HELD) for (how, _), found in parts]
    if states:
        tasks.append(steady_task(motions, states))

    def tell(period: int, periods: int) -> None:
        if watch is not None:
            watch(f"{model.name}: {period * PERIOD:.1f} of {periods * PERIOD:.1f} s")

    simulated = model.simulate(joined(tasks), tell)
    found: dict[tuple[str, float], tuple[Agreement, ...]] = {}
    driven: dict[tuple[str, float], tuple[tuple[Window, ...], FloatArray]] = {}
    first, rear = 0, model.car.rear_axle_distance
    for key, own in parts:
        part = simulated[first : first + len(own), : own[0].count + 1]
        found[key] = agreements(motions, own, part, rear)
        driven[key] = tuple(own), part
        first += len(own)
    steady = _steady(motions, states, simulated[first:], rear)
    if steady:
        found[STEADY, 0.0] = _steady_agreements(steady)
    return Validation(
        model=model.name, car=model.car, friction=model.friction, drives=tuple(drives), left_out=tuple(left_out),
        windows={length: len(own) for length, own in windows.items()}, agreements=found, steady=steady,
        motions=tuple(motions), driven=driven,
    )  # fmt: skip


def _steady(
    motions: Sequence[DriveMotion], states: Sequence[SteadyState], simulated: FloatArray, rear: float
) -> tuple[SteadyAgreement, ...]:
    """Return the steady states, those that are alike as one."""
    groups: dict[tuple[int, int], list[int]] = {}
    for place, state in enumerate(states):
        key = round(state.steering / _SAME_STEERING), round(state.speed / _SAME_SPEED)
        groups.setdefault(key, []).append(place)
    over, made = round(STEADY_MEAN / PERIOD), []
    for _, places in sorted(groups.items()):
        ends = np.array([row[np.isfinite(row[:, 0])][-over:] for row in simulated[places]])
        speed, yaw_rate = ends[..., 3], ends[..., 5]
        slip = np.arctan2(ends[..., 4] + rear * yaw_rate, speed)

        def mean(name: str, places: list[int] = places) -> float:
            return float(np.mean([getattr(states[place], name) for place in places]))

        made.append(
            SteadyAgreement(
                steering=mean("steering"), speed=mean("speed"), count=len(places), yaw_rate=mean("yaw_rate"),
                model_yaw_rate=float(yaw_rate.mean()), lateral_acceleration=mean("lateral_acceleration"),
                model_lateral_acceleration=float((speed * yaw_rate).mean()), slip_angle=mean("slip_angle"),
                model_slip_angle=float(slip.mean()), model_speed=float(speed.mean()),
                spun=bool((np.abs(slip) > _SPIN).any()),
            )
        )  # fmt: skip
    return tuple(made)


def _steady_agreements(steady: Sequence[SteadyAgreement]) -> tuple[Agreement, ...]:
    found = []
    for signal in UNITS:
        name = signal.replace(" ", "_")
        if signal in ("position", "speed"):  # which is held
            continue
        recorded = np.array([getattr(each, name) for each in steady])
        errors = np.array([getattr(each, f"model_{name}") for each in steady]) - recorded
        worst = int(np.argmax(np.abs(errors)))
        place = f"steering {steady[worst].steering:.3f} rad, {steady[worst].speed:.2f} m/s"
        found.append(
            Agreement(
                signal=signal, rms=rms(errors), worst=float(abs(errors[worst])),
                share=rms(errors) / max(rms(recorded), 1e-12), worst_at=place,
            )
        )  # fmt: skip
    return tuple(found)
