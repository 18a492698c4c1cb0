"""Finds the parameters of a drive: first by inverse dynamics, then by output error, with confidence intervals.

Inverse dynamics: the smoothed lateral and yaw acceleration give the force of each axle, F_yf = (m a_y l_r + I_z r') / L
and F_yr = (m a_y l_f - I_z r') / L, the smoothed velocity its slip angle, and a robust fit through them a curve.
Output error: the model is simulated forward from the commands, and its parameters are those at which yaw rate, lateral
acceleration, heading and position come closest to what was measured; Huber's cost, bounds, steps of Gauss and Newton.
"""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.errors import missing_extra
from fg_mujoco.messages import FloatArray
from fg_mujoco.vehicle.tires.law import GREATEST_SLIP

from ..single_track import STATES, TIRE, axle_loads, friction_curve
from .problem import (
    DIFFERENCE,
    GAIN,
    INERTIA,
    LIMIT,
    PARAMETERS,
    ROLL,
    DriveProblem,
    assumed_noise,
    huber,
    measured_noise,
)

_LEAST = np.array((1.0, 1.0, 0.1, -4.0) * 2 + (0.5, -0.2, 0.0, 0.0, 0.01, -0.2, -2.0, 0.7, -0.1, -0.1, 0.3, 0.7))
_GREATEST = np.array((100.0, 3.0, 3.0, 1.5) * 2 + (1.6, 0.2, 0.6, 0.4, 0.5, 0.2, 2.0, 1.3, 0.1, 0.1, 3.0, 1.3))
_EXPECTED = np.array((12.0, 1.5, 1.0, 0.5) * 2 + (1.0, 0.0, 0.05, 0.0, 0.045, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0))
# How far from that (a standard deviation). Of the tires no more is assumed than that their curves are of a usual shape:
# the published sets have stiffnesses of 3 to 20. At one speed, gain and front stiffness look the same.
_SPREAD = np.array((20.0, 0.5, 1.0, 0.7) * 2 + (0.3, 0.5, 1.0, 1.0, 0.02, 0.02, 0.5, 0.05, 0.02, 0.02, 0.3, 0.1))
_REACHED = 0.92  # of D, that a curve reaches at least: one that reaches less than .9 is no tire (vehicle/tires)
_SURELY = 0.002  # of D: how strictly, as a standard deviation
_MOST_LACKING = 0.015  # of D: no step may lead to a curve that lacks more of it
_TIRES = 2 * len(TIRE)  # parameters of both curves, the first ones
_SLIPS = np.linspace(0.0, GREATEST_SLIP, 201)[1:]  # [rad]
_LINEAR = np.array((1.0, 1e4, 0.0))  # C, D, E with which the formula is a straight line
_SHARES = (1.0, 0.3, 0.0)  # of a segment's step of its start, of which the best is taken
_SETTLING = 5  # steps of Gauss and Newton to find the starts alone
_STEPS = 60  # of Gauss and Newton, at most
_CONVERGED = 0.02  # of the cost, a sum of squares over their noise: a seventh of a standard deviation
_CONVERGED_SHARES = (1e-3, 1e-3, 1e-4)  # of the cost, by fit: many residuals, not independent, make it large
_NEAR_LIMIT = 0.8  # of the steering's greatest angle: commands below it do not tell where the steering ends
_RESERVED = 2.5  # steps' time that is kept for one more, and for the intervals
_FIRST_SEGMENTS = 60  # spread over the drives, on which the first two fits are made
_GAINS = (1.0, 1.25, 0.8)  # of the steering, from each of which the first fit starts: the cost has several minima


def require_scipy() -> None:
    """Make sure that parameters can be found; MissingExtraError: SciPy, with the command that installs it."""
    if importlib.util.find_spec("scipy") is None:
        raise missing_extra("identification needs SciPy", "ros")


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """What was found."""

    parameters: FloatArray  # (len(PARAMETERS),)
    covariance: FloatArray  # of them; 0 for those at a bound or held fixed
    at_bound: NDArray[np.bool_]  # which of them are
    noise: FloatArray  # (4,) of the residuals: gyro, accelerometer, position, heading
    free: NDArray[np.bool_]  # which were looked for
    seconds: float  # [s] of the drives that it is to
    stopped: str  # why it ended before it converged; empty: it converged


def force_points(problem: DriveProblem, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return slip angles [rad] and F_y / F_z [-] of both axles by inverse dynamics, each (2, n), of moving nodes."""
    mass, inertia, front, rear, height, gravity, share, *_ = problem.car
    inertia = inertia * parameters[INERTIA]
    motion = problem.motion
    nodes = np.concatenate([np.arange(*segment) for segment in problem.segments])
    angle = problem.angles(parameters)[nodes]
    vx, vy, r = motion.forward_speed[nodes], motion.lateral_speed[nodes], motion.yaw_rate[nodes]
    ay, ax, turn = (
        array[nodes] for array in (motion.lateral_acceleration, motion.forward_acceleration, motion.yaw_acceleration)
    )
    across_front = (mass * ay * rear + inertia * turn) / (front + rear)
    force_rear = (mass * ay * front - inertia * turn) / (front + rear)
    # of what is across the car, the drive of the front wheels is a part
    cos, sin = np.cos(angle), np.sin(angle)
    whole = share * cos + 1.0 - share
    force_front = (across_front - share * mass * ax * sin / whole) / (cos + share * sin**2 / whole)
    slips = np.array((angle - np.arctan2(vy + front * r, vx), -np.arctan2(vy - rear * r, vx)))
    loads = axle_loads(ax, front, rear, height, mass, gravity)
    return slips, np.array((force_front, force_rear)) / loads


def inverse_dynamics(problems: Sequence[DriveProblem], *, linear: bool = False) -> FloatArray:
    """Return parameters by inverse dynamics: the curves of both axles, and the lag at which the front's fits best."""
    from scipy.optimize import least_squares, minimize_scalar

    thin = 4
    found = _EXPECTED.copy()
    if problems[0].single_track:
        found[12] = 0.0
    if linear:
        found[1:4] = found[5:8] = _LINEAR

    def curve(axle: int, slips: FloatArray, used: FloatArray) -> tuple[float, FloatArray]:
        free = slice(4 * axle, 4 * axle + (1 if linear else 4))

        def residuals(values: FloatArray) -> FloatArray:
            tire = np.concatenate((values, _LINEAR)) if linear else values
            return np.asarray(friction_curve(slips, tire)) - used

        answer = least_squares(
            residuals, found[free], bounds=(_LEAST[free], _GREATEST[free]), loss="soft_l1", f_scale=0.05,
            x_scale=np.array((10.0, 1.0, 0.5, 1.0))[: 1 if linear else 4],
        )  # fmt: skip
        return float(answer.cost), answer.x

    def points(lag: float) -> tuple[FloatArray, FloatArray]:
        at = found.copy()
        at[10] = lag
        both = [force_points(problem, at) for problem in problems]
        slips = np.concatenate([part[0] for part in both], axis=1)[:, ::thin]
        used = np.concatenate([part[1] for part in both], axis=1)[:, ::thin]
        return np.ascontiguousarray(slips), np.ascontiguousarray(used)

    def front_cost(lag: float) -> float:
        slips, used = points(lag)
        return curve(0, slips[0], used[0])[0]

    lags = np.linspace(0.0, 0.3, 13)
    best = lags[int(np.argmin([front_cost(lag) for lag in lags]))]
    bounds = (max(best - 0.025, 0.0), best + 0.025)
    found[10] = minimize_scalar(front_cost, bounds=bounds, method="bounded", options={"xatol": 5e-4}).x
    slips, used = points(found[10])
    for axle in (0, 1):
        values = curve(axle, slips[axle], used[axle])[1]
        found[4 * axle : 4 * axle + len(values)] = values
    return found


def output_error(
    problems: Sequence[DriveProblem],
    parameters: FloatArray,
    *,
    linear: bool = False,
    watch: Callable[[str], None] | None = None,
    deadline: float = math.inf,
) -> Fit:
    """Return the parameters at which the simulated drives come closest to the measured ones.

    The first two fits are to some segments alone, spread over the drives; the third one is to all that are not held
    back. The first one starts from several gains of the steering, and the best counts: a steering that turns too little
    with stiff tires in front is a minimum of its own. At the deadline, of `time.monotonic` [s], the best parameters so
    far are returned, with the intervals that the segments so far give.
    """

    def told(fit: int) -> Callable[[int], None]:
        return lambda step: None if watch is None else watch(f"output error: fit {fit}/3, step {step}")

    free = np.ones(len(PARAMETERS), bool)
    if linear:
        free[1:4] = free[5:8] = False
    if problems[0].single_track:
        free[12] = False
    if all(problem.drive.acceleration is None for problem in problems):  # which tells both
        free[[PARAMETERS.index("lateral_bias"), ROLL]] = False
    greatest = max(float(np.abs(problem.drive.steering.values).max()) for problem in problems)
    if greatest < _NEAR_LIMIT * problems[0].drive.car.max_steering_angle:
        free[LIMIT] = False
    commanded = problems[0].drive.commanded
    if not commanded:  # an angle that was measured is late by what the sensor is
        free[10] = False
        parameters = parameters.copy()
        parameters[10] = 0.0
    noise = assumed_noise()
    fitted = [problem.only(~problem.held_back) for problem in problems]
    used = _spread(fitted, _FIRST_SEGMENTS)
    found = []
    for gain in _GAINS if free[GAIN] else (1.0,):
        begun = _with_peaks(parameters, free)
        begun[GAIN] = gain * parameters[GAIN]
        starts = [fitted_starts(problem, begun, noise) for problem in used]
        found.append(_minimise(used, begun, starts, noise, free, told(1), deadline, _CONVERGED_SHARES[0]))
        if found[-1].ended_by:
            break
    minimum = min(found, key=lambda each: each.cost)
    stopped = ""
    for fit in (1, 2, 3):
        if fit == 3:
            every = sum(len(problem.segments) for problem in fitted)
            if every > sum(len(problem.segments) for problem in used):
                used, starts = fitted, [fitted_starts(problem, parameters, noise) for problem in fitted]
        if fit > 1:
            minimum = _minimise(used, parameters, starts, noise, free, told(fit), deadline, _CONVERGED_SHARES[fit - 1])
        parameters, starts, ended_by = minimum.parameters, minimum.starts, minimum.ended_by
        noise = measured_noise(used, parameters, starts) if fit < 3 else noise
        if ended_by:
            part = sum(len(problem.segments) for problem in used)
            stopped = f"ended by {ended_by} in fit {fit} of 3, to {part} s of the drives"
            break
    covariance, at_bound = _covariance(used, parameters, starts, noise, free)
    seconds = sum(float(np.diff(problem.segments, axis=1).sum()) * problem.step for problem in used)
    return Fit(
        parameters=parameters, covariance=covariance, at_bound=at_bound, noise=noise, free=free, seconds=seconds,
        stopped=stopped,
    )  # fmt: skip


def _spread(problems: Sequence[DriveProblem], most: int) -> list[DriveProblem]:
    """Return the problems with every so-manieth segment, at most about `most` of them in all."""
    every = sum(len(problem.segments) for problem in problems)
    step = max(1, round(every / most))
    return [problem.only(np.arange(len(problem.segments)) % step == 0) for problem in problems]


def fitted_starts(problem: DriveProblem, parameters: FloatArray, noise: FloatArray) -> FloatArray:
    """Return the states (m, STATES) at the starts of all segments that fit best at some parameters, which stay."""
    starts, none = problem.smoothed, np.zeros(len(PARAMETERS), bool)
    costs = problem.costs(parameters, starts, noise)
    for _ in range(_SETTLING):
        lines = problem.linearise(parameters, starts, noise, none)
        steps = []
        for residual, by_start in zip(lines.residuals, lines.starts, strict=True):
            weights = huber(residual)[1]
            steps.append(np.linalg.lstsq(by_start * weights[:, np.newaxis], -residual * weights, rcond=None)[0])
        tried = starts + np.array(steps).reshape(-1, STATES)
        found = problem.costs(parameters, tried, noise)
        better = found < costs
        starts = np.where(better[:, np.newaxis], tried, starts)
        costs = np.where(better, found, costs)
        if not better.any():
            break
    return starts


@dataclass(frozen=True, kw_only=True, eq=False)
class _Minimum:
    """Where a search ended."""

    parameters: FloatArray  # (len(PARAMETERS),)
    starts: list[FloatArray]  # of the problems
    cost: float
    ended_by: str  # before it converged: "the time budget", because a step would go beyond it, or "Ctrl-C"; else empty


@dataclass(frozen=True, kw_only=True, eq=False)
class _Reduced:
    """A linearised problem whose starts are eliminated."""

    cost: float
    rows: FloatArray  # (m, free)
    wanted: FloatArray  # (m,)
    scores: FloatArray  # (segments, free): gradient of each segment
    eliminated: list[list[tuple[FloatArray, FloatArray]]]  # of each segment: step of its start, and by the parameters'


def _lacks(parameters: FloatArray, free: NDArray[np.bool_]) -> FloatArray:
    """Return how much of D the curves of both axles lack of `_REACHED` (2,) [-]; 0 where a curve is held a line."""
    found = np.zeros(2)
    for axle in (0, 1):
        places = slice(4 * axle, 4 * axle + 4)
        if free[places].all():
            tire = parameters[places]
            found[axle] = max(0.0, _REACHED - float(friction_curve(_SLIPS, tire).max()) / tire[2])
    return found


def _with_peaks(parameters: FloatArray, free: NDArray[np.bool_]) -> FloatArray:
    """Return parameters with a greater C, and then with a smaller D, where a curve does not reach its D."""
    found = parameters.copy()
    while (lacks := _lacks(found, free)).any():
        for axle in np.flatnonzero(lacks):
            c, d = 4 * axle + 1, 4 * axle + 2
            if found[c] < _GREATEST[c] - 0.02:
                found[c] += 0.02
            else:
                found[d] *= 0.98
    return found


def _prior(parameters: FloatArray, free: NDArray[np.bool_]) -> FloatArray:
    """Return what the parameters are off from what is usual, over its spread, and what the curves lack of a peak."""
    usual = (parameters - _EXPECTED)[free] / _SPREAD[free]
    return np.append(usual, _lacks(parameters, free) / _SURELY)


def _prior_slopes(parameters: FloatArray, free: NDArray[np.bool_]) -> FloatArray:
    """Return the derivatives of `_prior` by the free parameters."""
    places = np.flatnonzero(free)
    slopes = np.vstack((np.diag(1.0 / _SPREAD[free]), np.zeros((2, len(places)))))
    here = _lacks(parameters, free)
    if here.any():
        for column, index in enumerate(places):
            if index < _TIRES:
                moved = parameters.copy()
                step = DIFFERENCE * max(1.0, abs(moved[index]))
                moved[index] += step
                slopes[-2:, column] = (_lacks(moved, free) - here) / (step * _SURELY)
    return slopes


def _reduce(
    problems: Sequence[DriveProblem],
    parameters: FloatArray,
    starts: Sequence[FloatArray],
    noise: FloatArray,
    free: NDArray[np.bool_],
) -> _Reduced:
    prior = _prior(parameters, free)
    cost = float(prior @ prior)
    rows, wanted = [_prior_slopes(parameters, free)], [prior]
    scores, eliminated = [], []
    for problem, begun in zip(problems, starts, strict=True):
        lines = problem.linearise(parameters, begun, noise, free)
        kept = []
        for residual, by_parameter, by_start in zip(lines.residuals, lines.parameters, lines.starts, strict=True):
            values, weights = huber(residual)
            cost += float(values.sum())
            residual = residual * weights
            by_parameter = by_parameter[:, free] * weights[:, np.newaxis]
            basis, triangle = np.linalg.qr(by_start * weights[:, np.newaxis])
            along, along_residual = basis.T @ by_parameter, basis.T @ residual
            across, left = by_parameter - basis @ along, residual - basis @ along_residual
            rows.append(across)
            wanted.append(left)
            scores.append(across.T @ left)
            inverse = np.linalg.inv(triangle)
            kept.append((inverse @ along_residual, inverse @ along))
        eliminated.append(kept)
    return _Reduced(
        cost=cost, rows=np.vstack(rows), wanted=np.concatenate(wanted), scores=np.array(scores), eliminated=eliminated
    )


def _stepped(
    problems: Sequence[DriveProblem],
    reduced: _Reduced,
    parameters: FloatArray,
    step: FloatArray,
    starts: Sequence[FloatArray],
    noise: FloatArray,
    free: NDArray[np.bool_],
) -> tuple[float, list[FloatArray]]:
    """Return the cost and the starts after a step of the parameters."""
    prior = _prior(parameters, free)
    cost, stepped = float(prior @ prior), []
    for problem, begun, kept in zip(problems, starts, reduced.eliminated, strict=True):
        own, along = np.array([here for here, _ in kept]), np.array([by @ step for _, by in kept])
        best, least = begun, np.full(len(begun), np.inf)
        for share in _SHARES:
            tried = begun - share * own - along
            costs = problem.costs(parameters, tried, noise)
            better = costs < least
            best, least = np.where(better[:, np.newaxis], tried, best), np.where(better, costs, least)
        cost += float(least.sum())
        stepped.append(best)
    return cost, stepped


def _minimise(
    problems: Sequence[DriveProblem],
    parameters: FloatArray,
    starts: list[FloatArray],
    noise: FloatArray,
    free: NDArray[np.bool_],
    watch: Callable[[int], None],
    deadline: float,
    converged: float,
) -> _Minimum:
    """Return the parameters and starts of the least cost, by damped steps of Gauss and Newton within the bounds."""
    from scipy.optimize import lsq_linear

    damping, begun_at, longest = 1e-3, time.monotonic(), 0.0
    least = math.inf
    try:
        reduced = _reduce(problems, parameters, starts, noise, free)
        least = reduced.cost
        for number in range(1, _STEPS + 1):
            longest = max(longest, time.monotonic() - begun_at)
            begun_at = time.monotonic()
            if begun_at + _RESERVED * longest > deadline:
                return _Minimum(parameters=parameters, starts=starts, cost=least, ended_by="the time budget")
            watch(number)
            triangle = np.asarray(np.linalg.qr(np.column_stack((reduced.rows, reduced.wanted)), mode="r"))
            square, wanted = triangle[:-1, :-1], triangle[:-1, -1]
            size = np.linalg.norm(square, axis=0)
            accepted = False
            while not accepted and damping < 1e8:
                stacked = np.vstack((square / size, np.sqrt(damping) * np.eye(len(size))))
                low, high = ((bound[free] - parameters[free]) * size for bound in (_LEAST, _GREATEST))
                solved = lsq_linear(
                    stacked, -np.concatenate((wanted, np.zeros(len(size)))),
                    (np.minimum(low, -1e-12), np.maximum(high, 1e-12)), method="bvls",
                )  # fmt: skip
                step = solved.x / size
                tried = parameters.copy()
                tried[free] = np.clip(parameters[free] + step, _LEAST[free], _GREATEST[free])
                cost, begun = _stepped(problems, reduced, tried, step, starts, noise, free)
                accepted = cost < reduced.cost and not (_lacks(tried, free) > _MOST_LACKING).any()
                damping = damping / 5.0 if accepted else damping * 5.0
            if not accepted:
                break
            fell = reduced.cost - cost
            parameters, starts, least = tried, begun, cost
            damping = max(damping, 1e-9)
            reduced = _reduce(problems, parameters, starts, noise, free)
            if fell < max(_CONVERGED, converged * reduced.cost):
                break
    except KeyboardInterrupt:
        return _Minimum(parameters=parameters, starts=starts, cost=least, ended_by="Ctrl-C")
    return _Minimum(parameters=parameters, starts=starts, cost=least, ended_by="")


def _covariance(
    problems: Sequence[DriveProblem],
    parameters: FloatArray,
    starts: Sequence[FloatArray],
    noise: FloatArray,
    free: NDArray[np.bool_],
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the covariance of the parameters, and which of them are at a bound."""
    reduced = _reduce(problems, parameters, starts, noise, free)
    margin = 1e-4 * (_GREATEST - _LEAST)
    at_bound = free & ((parameters <= _LEAST + margin) | (parameters >= _GREATEST - margin))
    at_bound[[10, 11]] &= parameters[[10, 11]] > 0.3  # of the lag and the delay, 0 is a value like others
    inner = ~at_bound[free]
    inverse = np.linalg.pinv(reduced.rows[:, inner].T @ reduced.rows[:, inner], hermitian=True)
    scores = reduced.scores[:, inner]
    few = len(scores) / max(len(scores) - inner.sum(), 1.0)
    sandwich = few * inverse @ (scores.T @ scores) @ inverse
    scale = np.sqrt(np.maximum(np.diag(sandwich), np.diag(inverse)) / np.maximum(np.diag(inverse), 1e-300))
    whole = np.zeros((len(PARAMETERS), len(PARAMETERS)))
    places = np.flatnonzero(free)[inner]
    whole[np.ix_(places, places)] = inverse * np.outer(scale, scale)
    return whole, at_bound
