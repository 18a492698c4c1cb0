"""Identifies the tires and the steering of a car from what it recorded, and measures the result on a part held back."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.display import brief
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray

from ..single_track import TIRE, friction_curve
from .drive_log import Drive
from .fit import Fit, fitted_starts, force_points, inverse_dynamics, output_error, require_scipy
from .problem import PARAMETERS, DriveProblem
from .speed_response import SpeedResponse, speed_response

AXLES = ("front", "rear")

_NORMAL = 1.96  # standard deviations of a 95 % interval
BUDGET = 120.0
"""[s] after which the best so far is returned, unless another time is asked for."""

_MODEL_ERRORS = {
    "stiffness": 0.024, "peak": 0.005, "inertia_ratio": 0.01,
}  # fmt: skip
# Of a value, a standard deviation: what the fit's two-track model differs by from our cars in three dimensions, which
# no spread between segments shows. Measured on cars of other seeds than those of the table in
# docs/addons/realcar/identification.md.
_ABSOLUTE_ERRORS = {
    "steering_offset": 5e-5, "steering_lag": 1.5e-3, "steering_delay": 1.5e-3, "relaxation_length": 5e-4,
}  # fmt: skip
_LEAST_SURE = 0.1  # of the peak: half of its interval, at most, for a peak that was seen
_SLIP_OF_PEAK = 1.9  # times peak over stiffness: where a curve with C 1.5, E .5 has 95 % of its peak
_USUAL_PEAK = 1.0  # [-] assumed where the drive does not say
_LEAST_SLIP = 0.01  # [rad] that even a stiffness needs
_LEAST_SURE_STIFFNESS = 0.3  # of a stiffness: half of its interval, at most
_GREATEST_SLIP = 0.6  # [rad] to which a peak is looked for, and points are shown
_FEWEST = 4  # segments that a fit needs
_USUAL_RESIDUAL = 0.2  # of the yaw rate: 14 % on held-out races of ipz, but 31 % with the lengths of nuc2
_MOST_RESIDUAL = 1.0  # of the yaw rate: a simulation that errs by all of it explains nothing


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A value that was found, and half of its 95 % interval; infinite: the value is at the bound of the search."""

    value: float
    half: float

    def times(self, factor: float) -> Estimate:
        """Return it in another unit."""
        return Estimate(value=self.value * factor, half=self.half * factor)

    def __str__(self) -> str:
        return f"{self.value:.4g} +- {self.half:.2g}" if np.isfinite(self.half) else f"{self.value:.4g}, at its bound"


@dataclass(frozen=True, kw_only=True)
class Axle:
    """The tires of an axle."""

    B: Estimate  # [1/rad]; of linear tires only the stiffness was found, and B, C, D, E are NaN
    C: Estimate  # [-]
    D: Estimate  # [-]
    E: Estimate  # [-]
    stiffness: Estimate  # [1/rad] B C D: lateral force over load, for each rad of a small slip angle
    peak: Estimate  # [-] greatest lateral force over load, at slip angles up to 0.6 rad
    peak_slip: float  # [rad] slip angle of it
    reached: float  # [rad] slip angle that the drive exceeds for 1 % of its time


@dataclass(frozen=True, kw_only=True)
class Validation:
    """How far the simulation of the segments that were held back is from what was measured."""

    yaw_rate_rms: float  # [rad/s] of the difference
    yaw_rate_relative: float  # [-] of it over the rms of the measured yaw rate
    seconds: float  # [s] that were held back


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Identification:
    """What was identified: by output error, and how it validates beside inverse dynamics."""

    drives: tuple[Drive, ...]
    hold_out: tuple[Drive, ...]  # that nothing was fitted to
    linear: bool
    front: Axle
    rear: Axle
    steering_gain: Estimate  # [-]
    steering_offset: Estimate  # [rad]
    steering_lag: Estimate  # [s] time constant of a first-order lag
    steering_delay: Estimate  # [s] before it
    relaxation_length: Estimate  # [m] of all tires; NaN of the single-track model, which has none
    gyro_bias: Estimate  # [rad/s]
    lateral_gain: Estimate  # [-] of the accelerometer: a car that rolls measures a part of gravity
    pose_delay: Estimate  # [s] of the pose after the gyro
    steering_limit: Estimate  # [rad] at which the steering ends, whatever is commanded
    inertia_ratio: Estimate  # [-] yaw inertia over mass, over that of the vehicle that was assumed
    speed: SpeedResponse | str  # how the speed follows its commands, or why the drives do not tell
    validation: Validation  # of output error
    inverse_validation: Validation  # of inverse dynamics alone
    fit: Fit = field(repr=False)
    problems: tuple[DriveProblem, ...] = field(repr=False)
    of_each: tuple[tuple[str, Validation], ...] = field(repr=False)  # the validation of each drive
    others: tuple[DriveProblem, ...] = field(repr=False)  # that are validated on

    def __repr__(self) -> str:
        axles = (f"{name} {axle.stiffness.value:.3g}/rad, peak {axle.peak.value:.3g}" for name, axle in self.axles)
        return brief(self, *axles, f"yaw rate within {100.0 * self.validation.yaw_rate_relative:.2g} %")

    @property
    def axles(self) -> tuple[tuple[str, Axle], tuple[str, Axle]]:
        """Both, with their names."""
        return ("front", self.front), ("rear", self.rear)

    @property
    def untold(self) -> dict[str, str]:
        """What the drives do not tell, by name, with the reason and the drive that would tell it."""
        found = {}
        for name, axle in self.axles:
            needed = _needs(axle.reached, axle.stiffness.value)
            if not axle.stiffness.half <= _LEAST_SURE_STIFFNESS * axle.stiffness.value:
                found[f"{name} stiffness"] = (
                    f"slip angles reach {axle.reached:.2g} rad, and it is {axle.stiffness} per rad; a drive with more "
                    "slip, to both sides, at several speeds tells it"
                )
            if self.linear:
                continue
            if not axle.peak.half <= _LEAST_SURE * axle.peak.value:
                unsure = f"it is {axle.peak}" if np.isfinite(axle.peak.half) else "none is seen"
                found[f"{name} peak"] = (
                    f"{needed} ({unsure}); a drive up to the limit of this axle tells it: slaloms that grow, or a "
                    "circle whose speed rises until the car slides"
                )
        for name, estimate, most, drive in (
            ("steering gain", self.steering_gain, 0.1 * abs(self.steering_gain.value), "turns at two speeds or more"),
            ("steering offset", self.steering_offset, 0.02, "turns to both sides"),
            ("steering delay", self.lateness, 0.03, "fast changes of the steering"),
            ("inertia ratio", self.inertia_ratio, 0.3 * self.inertia_ratio.value, "fast lock-to-lock changes"),
            ("relaxation length", self.relaxation_length, 0.02, "fast changes of the steering at low speed"),
        ):  # fmt: skip
            if np.isfinite(estimate.value) and not estimate.half <= most:
                found[name] = f"it is {estimate}; {drive} tell it"
        if isinstance(self.speed, str):
            found["speed response"] = self.speed
        return found

    @property
    def told(self) -> tuple[str, ...]:
        """What the drives tell, by name, of what a car is made of."""
        names = [f"{name} {what}" for name in AXLES for what in ("stiffness", *(() if self.linear else ("peak",)))]
        names += ["steering gain", "steering offset", "steering delay", "inertia ratio"]
        names += ["relaxation length"] if np.isfinite(self.relaxation_length.value) else []
        return tuple(name for name in (*names, "speed response") if name not in self.untold)

    @property
    def lateness(self) -> Estimate:
        """Lag and delay of the steering together [s], which a drive tells better than each."""
        places = slice(PARAMETERS.index("steering_lag"), PARAMETERS.index("steering_delay") + 1)
        half = _NORMAL * float(np.sqrt(max(self.fit.covariance[places, places].sum(), 0.0)))
        model = _NORMAL * _ABSOLUTE_ERRORS["steering_lag"]
        value = self.steering_lag.value + self.steering_delay.value
        return Estimate(value=value, half=float(np.hypot(half, model)))

    def curve(self, axle: int, slips: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return F_y / F_z [-] of an axle (0 front, 1 rear) at slip angles [rad], and half of its 95 % band."""
        return _curve(self.fit, axle, slips)

    def summary(self) -> str:
        """Return what was found as lines of text."""
        lines = [f"{', '.join(drive.name for drive in self.drives)}: {self.drives[0].vehicle}"]
        for name, axle in self.axles:
            lines.append(f"  {name + ' stiffness':<20}{axle.stiffness} per rad, slip angles to {axle.reached:.2g} rad")
            if not self.linear:
                lines += [f"  {f'{name} {letter}':<20}{getattr(axle, letter)}" for letter in "BCDE"]
                lines.append(f"  {name + ' peak':<20}{axle.peak} at {axle.peak_slip:.3g} rad")
        for name, estimate, unit in (
            ("steering gain", self.steering_gain, ""), ("steering offset", self.steering_offset, " rad"),
            ("steering lag", self.steering_lag, " s"), ("steering delay", self.steering_delay, " s"),
            ("steering limit", self.steering_limit, " rad"), ("relaxation length", self.relaxation_length, " m"),
        ):  # fmt: skip
            if np.isfinite(estimate.value) and estimate.half > 0.0:
                lines.append(f"  {name:<20}{estimate}{unit}")
        lines.append(f"  {'yaw inertia':<20}{self.inertia_ratio} of the vehicle's, at its mass")
        lines += [f"  {name:<21}{text}" for name, text in self.speed_lines()]
        for name, text in self.untold.items():
            lines.append(f"  not told: {name}: {text}")
        lines.append("  no motion without forces determines the mass: it stays the vehicle's")
        if self.fit.stopped:
            lines.append(f"  partial: {self.fit.stopped}; its intervals are those of that part")
        kind = "held out" if self.hold_out else "held back"
        if self.hold_out:
            lines += [f"  held out, {name}: {_said(found)}" for name, found in self.of_each]
        for name, found in ((kind, self.validation), ("inverse dynamics", self.inverse_validation)):
            lines.append(f"  {name:<20}{_said(found)}")
        if self.validation.yaw_rate_relative > _USUAL_RESIDUAL:
            lines.append(
                f"  agrees badly: up to {100.0 * _USUAL_RESIDUAL:.3g} % is usual; are wheelbase, centre of gravity and "
                f"mass those of {self.drives[0].vehicle}? --vehicle FILE.xml names a car with those that you measured"
            )
        return "\n".join(lines)

    def speed_lines(self) -> list[tuple[str, str]]:
        """Return the response of the speed as names and values."""
        if isinstance(self.speed, str):
            return []
        speed = self.speed
        kind = "commanded acceleration" if speed.accelerations else "commanded speed"
        rows = [(f"{'acceleration' if speed.accelerations else 'speed'} gain", speed.gain, f" of the {kind}")]
        rows += [("command delay", speed.delay, " s")]
        rows += [("drag", speed.drag, " m/s^2 for each m/s")] if speed.accelerations else []
        rows += [] if speed.accelerations else [("speed time constant", speed.time_constant, " s")]
        rows += [("rolling resistance", speed.rolling, "")]
        rows += [("cornering resistance", speed.cornering, " of what the tires' slip gives")]
        return [(name, f"{Estimate(value=value, half=half)}{unit}") for name, (value, half), unit in rows]


def _said(found: Validation) -> str:
    return (
        f"yaw rate within {found.yaw_rate_rms:.3g} rad/s rms, {100.0 * found.yaw_rate_relative:.3g} % of its own, "
        f"over {found.seconds:.3g} s"
    )


def identify_drives(
    drives: Sequence[Drive],
    *,
    hold_out: Sequence[Drive] = (),
    linear: bool = False,
    single_track: bool = False,
    budget: float = BUDGET,
    watch: Callable[[str], None] | None = None,
) -> Identification:
    """Return the tires and the steering of the car of some drives, and how well that agrees on others.

    Arguments are those of `bag_drive.identify`. What the drives do not tell is in `untold`, with what would tell it;
    its value is what is usual. After the time budget the best parameters so far are returned, and `fit.stopped` says
    so.
    Raises MissingExtraError: SciPy; SettingsError: no drive, drives of several cars, or drives that tell nothing.
    """
    require_scipy()
    deadline = time.monotonic() + _checked_budget(budget)
    drives, hold_out = tuple(drives), tuple(hold_out)
    if not drives:
        raise SettingsError("no drive; accepted: one or more of the same car")
    for drive in (*drives, *hold_out)[1:]:
        if drive.car != drives[0].car or drive.commanded != drives[0].commanded:
            what = "is of another car" if drive.car != drives[0].car else "has another kind of steering"
            raise SettingsError(f"{drive.name}: {what} than {drives[0].name}; accepted: drives of one car")
    problems = _problems(drives, single_track, watch, False if hold_out else None)
    names = ", ".join(drive.name for drive in drives)
    if sum(len(problem.segments) for problem in problems) < _FEWEST:
        raise SettingsError(f"{names}: too short; accepted: {_FEWEST} stretches of 1 s above 1 m/s, or more")
    if watch is not None:
        watch("inverse dynamics")
    expected = inverse_dynamics(problems, linear=True)
    for axle, slip in enumerate(_reached(problems, expected)):
        if not slip >= _LEAST_SLIP:
            raise SettingsError(f"{names}: {AXLES[axle]}: {_needs(slip, 12.0)}; accepted: a drive with more slip")
    inverse = expected if linear else inverse_dynamics(problems)
    fit = output_error(problems, inverse, linear=linear, watch=watch, deadline=deadline)
    reached = _reached(problems, fit.parameters)
    found = fit.parameters
    if watch is not None:
        watch("validation")
    others = _problems(hold_out, single_track, None, True) if hold_out else problems
    of_each = [_validate([problem], found, fit.noise) for problem in others]
    validation = _validate(others, found, fit.noise)
    if not validation.yaw_rate_relative < _MOST_RESIDUAL:
        raise SettingsError(
            f"{names}: the model explains nothing of the yaw rate ({_said(validation)}); accepted: a drive whose "
            "steering and yaw rate belong together"
        )
    speed = speed_response([problem.only(~problem.held_back) for problem in problems], found)

    def of(name: str) -> Estimate:
        return _estimate(fit, PARAMETERS.index(name))

    front, rear = _axle(fit, 0, reached[0], linear), _axle(fit, 1, reached[1], linear)
    result = Identification(
        drives=drives, hold_out=hold_out, linear=linear, front=front, rear=rear,
        steering_gain=of("steering_gain"), steering_offset=of("steering_offset"), steering_lag=of("steering_lag"),
        steering_delay=of("steering_delay"), gyro_bias=of("gyro_bias"), lateral_gain=of("lateral_gain"),
        relaxation_length=Estimate(value=np.nan, half=np.nan) if single_track else of("relaxation_length"),
        pose_delay=of("pose_delay"), steering_limit=of("limit_ratio").times(drives[0].car.max_steering_angle),
        inertia_ratio=of("inertia_ratio"), speed=speed, validation=validation,
        inverse_validation=_validate(others, inverse, fit.noise), fit=fit, problems=tuple(problems),
        of_each=tuple(zip((problem.drive.name for problem in others), of_each, strict=True)), others=tuple(others),
    )  # fmt: skip
    if not result.told:
        raise SettingsError(f"{names}: tell nothing: {'; '.join(result.untold.values())}")
    return result


def _problems(
    drives: Sequence[Drive],
    single_track: bool,
    watch: Callable[[str], None] | None,
    held: bool | None,
) -> list[DriveProblem]:
    """Return the problems of drives; `held` says whether all or nothing is held back, None: every third second."""
    found = []
    for number, drive in enumerate(drives, start=1):
        if watch is not None:
            watch(f"smoothing drive {number}/{len(drives)}")
        problem = DriveProblem(drive, single_track=single_track)
        if held is not None:
            problem.held_back[:] = held
        found.append(problem)
    return found


def _checked_budget(budget: float) -> float:
    if not 1.0 <= budget < math.inf:
        raise SettingsError(f"budget is {budget!r} s; accepted: 1 s or more")
    return budget


def _curve(fit: Fit, axle: int, slips: FloatArray) -> tuple[FloatArray, FloatArray]:
    places = slice(4 * axle, 4 * axle + 4)
    tire, covariance = fit.parameters[places].copy(), fit.covariance[places, places]
    here = np.asarray(friction_curve(slips, tire))
    slopes = np.empty((len(slips), len(TIRE)))
    for index in range(len(TIRE)):
        moved = tire.copy()
        step = 1e-5 * max(1.0, abs(tire[index]))
        moved[index] += step
        slopes[:, index] = (friction_curve(slips, moved) - here) / step
    variance = np.einsum("ni,ij,nj->n", slopes, covariance, slopes)
    return here, _NORMAL * np.sqrt(np.maximum(variance, 0.0))


def _peak(fit: Fit, axle: int) -> tuple[Estimate, float]:
    """Return the greatest force over load of an axle, and its slip angle [rad]."""
    slips = np.linspace(0.0, _GREATEST_SLIP, 1201)
    used, half = _curve(fit, axle, slips)
    top = int(np.argmax(used))
    at_bound = bool(fit.at_bound[4 * axle + TIRE.index("D")])
    sure = np.inf if at_bound else np.hypot(half[top], _NORMAL * _MODEL_ERRORS["peak"] * used[top])
    return Estimate(value=float(used[top]), half=float(sure)), float(slips[top])


def held_back(
    problem: DriveProblem, parameters: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times [s], simulated and measured yaw rates [rad/s] of what was held back, each from its best start."""
    rows = problem.gyro
    inside = problem.held_back[rows.segment]
    nodes = problem.run(parameters, fitted_starts(problem, parameters, noise))[:, 1]
    simulated = nodes[rows.node] * (1.0 - rows.part) + nodes[rows.node + 1] * rows.part
    bias = parameters[PARAMETERS.index("gyro_bias")]
    return rows.time[inside], simulated[inside] + bias, rows.values[inside, 0]


def _validate(problems: Sequence[DriveProblem], parameters: FloatArray, noise: FloatArray) -> Validation:
    parts = [held_back(problem, parameters, noise) for problem in problems]
    simulated, measured = (np.concatenate([part[index] for part in parts]) for index in (1, 2))
    if not len(measured):
        return Validation(yaw_rate_rms=np.nan, yaw_rate_relative=np.nan, seconds=0.0)
    error, own = (float(np.sqrt(np.mean(values**2))) for values in (simulated - measured, measured))
    spans = (problem.segments[problem.held_back] for problem in problems)
    seconds = sum(float((span[:, 1] - span[:, 0]).sum()) for span in spans) * problems[0].step
    return Validation(yaw_rate_rms=error, yaw_rate_relative=error / max(own, 1e-12), seconds=seconds)


def _reached(problems: Sequence[DriveProblem], parameters: FloatArray) -> NDArray[np.float64]:
    slips = np.concatenate([force_points(problem, parameters)[0] for problem in problems], axis=1)
    return np.asarray(np.percentile(np.abs(slips), 99.0, axis=1))


def _needs(reached: float, stiffness: float) -> str:
    needed = _SLIP_OF_PEAK * _USUAL_PEAK / stiffness
    return f"slip angles reach {reached:.2g} rad; the peak needs about {needed:.2g}"


def _estimate(fit: Fit, index: int) -> Estimate:
    value = float(fit.parameters[index])
    half = np.inf if fit.at_bound[index] else _NORMAL * np.sqrt(fit.covariance[index, index])
    name = PARAMETERS[index]
    name = "stiffness" if name.endswith("stiffness") else name
    model = max(_MODEL_ERRORS.get(name, 0.0) * abs(value), _ABSOLUTE_ERRORS.get(name, 0.0))
    return Estimate(value=value, half=float(np.hypot(half, _NORMAL * model)))


def _axle(fit: Fit, axle: int, reached: float, linear: bool) -> Axle:
    stiffness, c, d, e = (_estimate(fit, 4 * axle + index) for index in range(4))
    if linear:
        unknown = Estimate(value=np.nan, half=np.nan)
        return Axle(
            B=unknown, C=unknown, D=unknown, E=unknown, stiffness=stiffness, peak=unknown, peak_slip=np.nan,
            reached=float(reached),
        )  # fmt: skip
    places = slice(4 * axle, 4 * axle + 3)
    b = stiffness.value / (c.value * d.value)
    slopes = b / fit.parameters[places] * np.array((1.0, -1.0, -1.0))
    half = _NORMAL * float(np.sqrt(slopes @ fit.covariance[places, places] @ slopes))
    peak, peak_slip = _peak(fit, axle)
    return Axle(
        B=Estimate(value=b, half=half), C=c, D=d, E=e, stiffness=stiffness, peak=peak, peak_slip=peak_slip,
        reached=float(reached),
    )  # fmt: skip
