"""How the speed of a car follows its commands: gain, delay, rolling and cornering resistance.

Commands u are speeds, or accelerations of a car without a speed servo; the mapping of a drive, or else the data say
which. The speed v then has

    v' = (gain u(t - delay) - v) / time_constant - rolling g - cornering c     u: speeds
    v' = gain u(t - delay) - drag v - rolling g - cornering c                  u: accelerations

A motor that does not brake coasts where u is negative: u is then max(u, 0), if this explains more of the drives. Here
c = a_y (l_r alpha_f + l_f alpha_r) / L is what the side slip of the tires takes. With a cornering resistance of 1
nothing but the tires' side forces slows a car in a turn. All but the delay is linear. So the change of v over half a
second, which needs no derivative, is regressed on the integrals of u, v, 1 and c, for each delay of a grid. Intervals
come from a bootstrap over blocks of the drives, in which the delay is found anew each time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import FloatArray

from .problem import DriveProblem
from .smoothed_motion import STEP

_WINDOW = 0.5  # [s] over which the change of the speed is taken
_BLOCK = 4  # windows of a block of the bootstrap
_FEWEST = 15  # blocks
_DRAWS = 200  # of the bootstrap
_DELAYS = np.arange(0.0, 0.301, STEP)  # [s]
_LEAST_SPREAD = 0.2  # [m/s or m/s^2] standard deviation of commands that tell a gain
_SERVO = 0.6  # [-] of the speed's coefficient over the command's, from which on commands are speeds
_OUTLIER = 4.0  # standard deviations, beyond which a change of the speed is that of wheels that spin or lock
_NORMAL = 1.96


@dataclass(frozen=True, kw_only=True)
class SpeedResponse:
    """How the speed follows the commands: each value with half of its 95 % interval; NaN: it is none of this kind."""

    accelerations: bool  # whether the commands are accelerations [m/s^2]; else speeds [m/s]
    gain: tuple[float, float]  # [-]
    braking: bool  # whether the car brakes where an acceleration is negative; else it coasts
    delay: tuple[float, float]  # [s]
    time_constant: tuple[float, float]  # [s] of the speed servo
    drag: tuple[float, float]  # [1/s] deceleration over the speed
    rolling: tuple[float, float]  # [-] deceleration over g, at any speed
    cornering: tuple[float, float]  # [-] times what the tires' slip angles give
    explained: float  # [-] share of the variance of the changes of speed


def speed_response(problems: Sequence[DriveProblem], parameters: FloatArray, *, seed: int = 1) -> SpeedResponse | str:
    """Return how the speed follows the commands, or why the drives do not tell; `parameters` have the slip angles."""
    told = [problem for problem in problems if problem.drive.speed_command is not None]
    if not told:
        return "no speed commands are recorded"
    rows = np.concatenate([_windows(problem, parameters) for problem in told], axis=1)
    if rows.shape[1] < _FEWEST * _BLOCK:
        return f"{rows.shape[1] * _WINDOW:.3g} s of driving with commands; {_FEWEST * _BLOCK * _WINDOW:g} s are needed"
    if not float(np.std(rows[0, :, 0])) > _LEAST_SPREAD * _WINDOW:
        return "the speed commands hardly change; a drive at several speeds, with accelerations, tells the response"
    rows, values, place, explained = _robust(rows)
    known = all(problem.drive.sent_accelerations for problem in told)
    accelerations = known or bool(-values[1] < _SERVO * values[0])
    braking = True
    if accelerations:
        coasting = _robust(np.concatenate([_windows(problem, parameters, coasts=True) for problem in told], axis=1))
        if coasting[3] > explained:
            braking, (rows, values, place, explained) = False, coasting
    whole = rows.shape[1] // _BLOCK * _BLOCK
    products = _products(rows[:, :whole].reshape(len(_DELAYS), -1, _BLOCK, rows.shape[2]))
    rng = np.random.default_rng(seed)
    blocks = products.shape[1]
    drawn = []
    for _ in range(_DRAWS):
        counts = np.bincount(rng.integers(blocks, size=blocks), minlength=blocks)
        drawn.append(_read(*_solve(np.tensordot(products, counts, axes=(1, 0))), accelerations))
    low, high = np.percentile(np.array(drawn), (2.5, 97.5), axis=0)
    found = _read(values, place, accelerations)
    # the delay is of a grid, and its interval at least a step wide
    half = np.maximum(0.5 * (high - low), (0.0, STEP, 0.0, 0.0, 0.0, 0.0))
    gain, delay, constant, drag, rolling, cornering = (
        (float(value), float(each)) for value, each in zip(found, half, strict=True)
    )
    return SpeedResponse(
        accelerations=accelerations, gain=gain, braking=braking, delay=delay, time_constant=constant, drag=drag,
        rolling=rolling, cornering=cornering, explained=explained,
    )  # fmt: skip


def _robust(rows: FloatArray) -> tuple[FloatArray, FloatArray, int, float]:
    """Return the rows without outliers, their coefficients, the place of the delay, and the share that is explained."""
    _, place = _solve(_products(rows[:, np.newaxis]).sum(axis=1))
    for _ in range(2):
        values, _ = _solve(_products(rows[place : place + 1, np.newaxis]).sum(axis=1))
        residuals = rows[place, :, -1] - rows[place, :, :-1] @ values
        spread = 1.4826 * float(np.median(np.abs(residuals)))
        rows = rows[:, np.abs(residuals) < _OUTLIER * spread]
    values, place = _solve(_products(rows[:, np.newaxis]).sum(axis=1))
    residuals = rows[place, :, -1] - rows[place, :, :-1] @ values
    return rows, values, place, 1.0 - float(np.mean(residuals**2) / np.var(rows[place, :, -1]))


def _windows(problem: DriveProblem, parameters: FloatArray, *, coasts: bool = False) -> FloatArray:
    """Return the integrals of u, v, 1 and c over windows, and the change of v, for each delay (delays, n, 5)."""
    motion, car = problem.motion, problem.drive.car
    assert problem.drive.speed_command is not None
    speed, turn = motion.forward_speed, motion.yaw_rate
    angle = problem.angles(parameters)
    across = motion.lateral_speed
    front = angle - np.arctan2(across + car.front_axle_distance * turn, speed)
    rear = -np.arctan2(across - car.rear_axle_distance * turn, speed)
    slip = (car.rear_axle_distance * front + car.front_axle_distance * rear) / car.wheelbase
    length = round(_WINDOW / STEP)
    begins = np.concatenate([np.arange(first, end - length, length) for first, end in problem.segments])
    ends = begins + length
    integrals = [_integral(values) for values in (speed, np.ones(len(speed)), speed * turn * slip)]
    fixed = [values[ends] - values[begins] for values in integrals]
    rows = np.empty((len(_DELAYS), len(begins), 5))
    for index, delay in enumerate(_DELAYS):
        commands = problem.drive.speed_command.held(motion.time - delay)[:, 0]
        commanded = _integral(np.maximum(commands, 0.0) if coasts else commands)
        rows[index] = np.column_stack((commanded[ends] - commanded[begins], *fixed, speed[ends] - speed[begins]))
    return rows


def _integral(values: FloatArray) -> FloatArray:
    return np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1])) * STEP))


def _products(rows: FloatArray) -> FloatArray:
    """Return the sums of products of the columns of blocks of rows (delays, blocks, windows, k) -> (..., k, k)."""
    return np.asarray(np.einsum("dbwi,dbwj->dbij", rows, rows))


def _solve(products: FloatArray) -> tuple[FloatArray, int]:
    """Return the coefficients of least squares (4,) at the delay that explains most, and its place."""
    square, wanted = products[:, :-1, :-1], products[:, :-1, -1]
    values = np.linalg.solve(square + 1e-9 * np.eye(4), wanted[..., np.newaxis])[..., 0]
    place = int(np.argmax(np.einsum("di,di->d", values, wanted)))
    return values[place], place


def _read(values: FloatArray, place: int, accelerations: bool) -> tuple[float, ...]:
    """Return gain, delay, time constant, drag, rolling and cornering resistance of coefficients."""
    command, speed, one, cornering = values
    delay, resistances = float(_DELAYS[place]), (-one / 9.81, -cornering)
    if accelerations:
        return (command, delay, np.nan, -speed, *resistances)
    return (-command / speed, delay, -1.0 / speed, np.nan, *resistances)
