"""Moves the tires, the drive and the steering of a car by short steps within a physics step.

Tires are far stiffer than the car: a wheel's spin follows its tire at some 300 rad/s, where a body rolls on its springs
at 50. So a physics step h moves the tires by n shorter ones (`tire_rows.steps_within`) while the rest of the car goes
on as MuJoCo has it. The velocities of the four contact points, of the drive and of each two shafts that are tied make
one vector w, and in a step

    dw/dt = J M^-1 (the forces without tires and drive) + (J M^-1 J') f(w, u)

with MuJoCo's own inertia M, joint damping taken implicitly as its `implicitfast` does, and the Jacobian J of w. MuJoCo
is then given the mean of f over the step, so that it ends with the very w that the short steps ended with. The motor's
force is a part of f. No tire moves the steering servo, which is stepped by itself; Ackermann's kingpins are then put
where they belong.

What ties the wheels (`drive_line`) is rigid, and gone before the short steps begin: a speed i of w that must stay 0
takes the mobility A = J M^-1 J' to A - A_i A_i' / A_ii (Schur), and the free motion a and w likewise. The inertia m of
the motor, which turns with the speed i, takes A to A - A_i A_i' / (1 / m + A_ii) (Sherman and Morrison). MuJoCo gets
their mean forces with the others: -(a_i + A_i' f) / (1 / m + A_ii). A clutch pushes against the difference of two
shafts with what stops it in a short step, up to what it holds.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..compiled.kernels import kernel, numbas
from ..messages import FloatArray
from . import mujoco_stages as stages
from .mujoco_stages import Fields
from .tire_patch import bend, damping_of, deflect, grip_of, rolled, unlikely
from .tire_rows import (
    ACROSS,
    ALONG,
    FORCE_ACROSS,
    FORCE_ALONG,
    LOAD,
    SLIDING,
    SLIDING_ACROSS,
    SLIP_SIZE,
    USERDATA,
    TireRows,
)  # fmt: skip

CONTACTS = 12
"""Velocities of each wheel's contact point, along its heading, to its left and up, that the short steps follow first.
Those of the drive line come behind them, up to four (Gear.lanes)."""

LANES = 16
"""Numbers in a row of `push_car`'s matrices."""

_JACOBIAN = 0  # (4, 16, 4) by wheel, dof of its chain, and velocity: forward, left, up, its spin
_HALVES = 256  # likewise, see `_half_solve`
_COMMON = 512  # (16, LANES) of the common dofs
_MOBILITY = 768  # (LANES, LANES)
_ODD = 1024  # likewise, a part of its sums, and of those of a short step
_VELOCITY, _FORCE, _MEAN, _FREE, _EVEN = range(1280, 1360, LANES)  # (LANES,) each
_DEPTH, _FORWARD, _LEFT, _REACH, _SLOW_X, _SLOW_Y = range(1360, 1384, 4)  # (4,) each, by wheel
_MOVES = 1384  # (5,) of the last wheel, see `_wheel_rows`
_TIED = 1392  # (4, 20) by speed of the drive line, see `_tie`
_THROUGH = 1472  # (LANES,)

SCRATCH = 1536
"""Numbers that `push_car` needs room for."""


def _add_scaled(lanes: int) -> Any:
    """Return a function that adds to `lanes` numbers of an array others of it, times a factor."""

    def made() -> Any:
        from llvmlite.ir import Constant, DoubleType, IntType, VectorType
        from numba.core import types
        from numba.extending import intrinsic
        from numba.np.arrayobj import make_array

        vector, number = VectorType(DoubleType(), lanes), IntType(32)

        def add(context: Any, numbers: Any, to: Any, of: Any, factor: Any) -> Any:
            def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
                data = make_array(signature.args[0])(context, builder, given[0]).data
                places = [builder.bitcast(builder.gep(data, [index]), vector.as_pointer()) for index in given[1:3]]
                before, other = (builder.load(place, align=8) for place in places)
                one = builder.insert_element(Constant(vector, None), given[3], Constant(number, 0))
                factors = builder.shuffle_vector(one, one, Constant(VectorType(number, lanes), None))
                builder.store(builder.fadd(before, builder.fmul(factors, other)), places[0], align=8)
                return context.get_dummy_value()

            return types.none(numbers, types.int64, types.int64, types.float64), generate

        return intrinsic(add)

    def in_python(numbers: Any, to: int, of: int, factor: float) -> None:
        numbers[to : to + lanes] += factor * numbers[of : of + lanes]

    return numbas(in_python)(made)


add_scaled_4 = _add_scaled(4)
add_scaled_16 = _add_scaled(16)


class Inertia(NamedTuple):
    """Which entries MuJoCo keeps of its inertia matrices: of a model, and the same for all its data."""

    row_counts: NDArray[np.int32]
    row_starts: NDArray[np.int32]
    columns: NDArray[np.int32]

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Inertia:
        """Return that of a model."""
        return cls(model.M_rownnz.copy(), model.M_rowadr.copy(), model.M_colind.copy())


@kernel
def push_car(
    model: int, data: int, found: Fields, inertia: Inertia, gear: Any, tires: TireRows, mu: FloatArray,
    own: FloatArray, scratch: FloatArray, dofs: int, timestep: float, steps: int,
) -> None:  # fmt: skip
    """Move the tires and the drive line of a car by the short steps of a physics step, and add their mean forces.

    MuJoCo's stages up to the acceleration without constraints must be done, with the inertia of `damp_inertia`.
    `tires` (k,) of TIRE are up to four, of peaks `mu` (k,) [-] and user data `own` (k USERDATA,), which is written to.
    """
    wheels = len(tires)
    short = timestep / steps
    for i in range(LANES):
        scratch[_VELOCITY + i] = scratch[_FORCE + i] = scratch[_MEAN + i] = scratch[_FREE + i] = 0.0
    for i in range(LANES * gear.commons):
        scratch[_COMMON + i] = 0.0
    for k in range(wheels):
        tire = tires[k]
        scratch[_DEPTH + k] = _wheel_rows(data, found, tire, k, dofs, timestep, scratch)
        forward = _move(data, found, gear, tire, k, short, dofs, scratch)
        scratch[_LEFT + k], scratch[_REACH + k] = rolled(forward, tire.relaxation_length, short)
        scratch[_SLOW_X + k], scratch[_SLOW_Y + k] = damping_of(tire, forward, short)
        scratch[_FORWARD + k] = forward
        for part in range(LOAD, USERDATA):
            own[USERDATA * k + part] = 0.0
        _half_solve(data, found, inertia, gear, tire, k, dofs, scratch)
    _half_solve_common(data, found, inertia, gear, dofs, scratch)
    _mobility(gear, tires, short, scratch)
    _tie(gear, short, scratch)
    gain = bias = slope = damping = length = before = least = most = pull = 0.0
    motor = gear.actuator[1]
    if gear.lanes > 0:
        before = stages.vector(data, found.actuator_force, motor + 1)[motor]
    if gear.driven:
        gains = stages.vector(model, found.actuator_gainprm, 10 * motor + 10)
        biases = stages.vector(model, found.actuator_biasprm, 10 * motor + 10)
        gain = gains[10 * motor] * _control(model, data, found, gear, 1, scratch[_EVEN:])
        bias, slope, damping = biases[10 * motor], biases[10 * motor + 1], biases[10 * motor + 2]
        length = stages.vector(data, found.actuator_length, motor + 1)[motor]
        least, most = gear.force_range[1, 0], gear.force_range[1, 1]
    for _ in range(steps):
        for k in range(wheels):
            tire, state, at = tires[k], USERDATA * k, _FORCE + 3 * k
            depth, over = scratch[_DEPTH + k], _VELOCITY + 3 * k
            load = tire.vertical_stiffness * depth - tire.vertical_damping * scratch[over + 2]
            if depth <= 0.0 or load <= 0.0:
                own[state + ALONG] = own[state + ACROSS] = scratch[at] = scratch[at + 1] = scratch[at + 2] = 0.0
                continue
            grip = grip_of(tire, load, mu[k])
            if tire.holds:
                along, across, fx, fy, size, sliding_x, sliding_y = bend(
                    tire, own[state + ALONG], own[state + ACROSS], scratch[over], scratch[over + 1],
                    scratch[_LEFT + k], scratch[_REACH + k], scratch[_SLOW_X + k], scratch[_SLOW_Y + k], grip,
                )  # fmt: skip
            else:
                along, across, fx, fy, size, sliding_x, sliding_y = deflect(
                    tire, own[state + ALONG], own[state + ACROSS], scratch[over], scratch[over + 1],
                    scratch[_FORWARD + k], grip, short,
                )  # fmt: skip
            own[state + ALONG], own[state + ACROSS] = along, across
            scratch[at], scratch[at + 1], scratch[at + 2] = fx, fy, load
            own[state + SLIP_SIZE] = max(own[state + SLIP_SIZE], size)
            if sliding_x != 0.0 or sliding_y != 0.0:
                own[state + SLIDING] = max(own[state + SLIDING], math.hypot(sliding_x, sliding_y))
                own[state + SLIDING_ACROSS] = max(own[state + SLIDING_ACROSS], abs(sliding_y))
        if gear.driven:
            speed = scratch[_VELOCITY + CONTACTS]
            pull = min(max(gain + bias + slope * length + damping * speed, least), most)
            if unlikely(pull * speed > gear.power):
                pull = gear.power / speed
            pull -= before
            scratch[_FORCE + CONTACTS] = pull
            length += short * speed
        for i in range(LANES):
            scratch[_EVEN + i], scratch[_ODD + i] = scratch[_FREE + i], 0.0  # two sums go on at a time
        for j in range(0, CONTACTS, 2):
            add_scaled_16(scratch, _EVEN, _MOBILITY + LANES * j, scratch[_FORCE + j])
            add_scaled_16(scratch, _ODD, _MOBILITY + LANES * (j + 1), scratch[_FORCE + j + 1])
        add_scaled_16(scratch, _EVEN, _ODD, 1.0)
        add_scaled_16(scratch, _EVEN, _MOBILITY + LANES * CONTACTS, scratch[_FORCE + CONTACTS])
        add_scaled_16(scratch, _VELOCITY, _EVEN, 1.0)
        if unlikely(gear.clutches > 0):
            _hold_clutches(gear, pull, before, scratch)
        add_scaled_16(scratch, _MEAN, _FORCE, 1.0)
        for k in range(wheels):
            scratch[_DEPTH + k] -= short * scratch[_VELOCITY + 3 * k + 2]
    share, smooth = 1.0 / steps, stages.vector(data, found.qfrc_smooth, dofs)
    _add_tie_forces(gear, _MEAN, steps, scratch)
    for k in range(wheels):
        tire, mean, state = tires[k], _MEAN + 3 * k, USERDATA * k
        torque = share * _spin_torque(gear, k, _MEAN, scratch)
        fx, fy, fz = scratch[mean] * share, scratch[mean + 1] * share, scratch[mean + 2] * share
        for link in range(tire.links):
            j = _JACOBIAN + 64 * k + 4 * link
            smooth[tire.chain[link]] += (
                scratch[j] * fx + scratch[j + 1] * fy + scratch[j + 2] * fz + scratch[j + 3] * torque
            )
        own[state + FORCE_ALONG], own[state + FORCE_ACROSS], own[state + LOAD] = fx, fy, fz


@kernel
def _wheel_rows(
    data: int, found: Fields, tire: Any, wheel: int, dofs: int, timestep: float, scratch: FloatArray
) -> float:  # fmt: skip
    """Write what each dof of a wheel moves its contact point by, and its spin, (links, 4); return the depth [m].

    Forward and left are those of the wheel half a physics step later, so that its mean force acts along its mean
    heading, and a car that turns neither gains nor loses by it. They are seen from the body that the dof moves: what
    the car itself turns by then is left to `place_between`. Written is, too, how the contact point moves without the
    wheel's spin (5,): forward, left, up, and how fast the first two change because the wheel turns.
    """
    body, center = tire.body, 3 * tire.root
    position = stages.vector(data, found.xpos, 3 * body + 3)
    turn = stages.vector(data, found.xmat, 9 * body + 9)
    mass_center = stages.vector(data, found.subtree_com, center + 3)
    axes, qvel = stages.vector(data, found.cdof, 6 * dofs), stages.vector(data, found.qvel, dofs)
    m, a = 9 * body, tire.axle
    ax = turn[m] * a[0] + turn[m + 1] * a[1] + turn[m + 2] * a[2]
    ay = turn[m + 3] * a[0] + turn[m + 4] * a[1] + turn[m + 5] * a[2]
    az = turn[m + 6] * a[0] + turn[m + 7] * a[1] + turn[m + 8] * a[2]
    broad = tire.half_width**2 - tire.radius**2
    deep = math.sqrt(tire.radius**2 + broad * az * az)  # lowest point of an ellipsoid, below its middle
    depth: float = deep - (position[3 * body + 2] - tire.ground)
    x = position[3 * body] - broad * az * ax / deep - mass_center[center]
    y = position[3 * body + 1] - broad * az * ay / deep - mass_center[center + 1]
    z = position[3 * body + 2] - deep + 0.5 * max(depth, 0.0) - mass_center[center + 2]  # half way to the ground
    level = math.sqrt(ax * ax + ay * ay)
    hx, hy = (ay / level, -ax / level) if level > 1e-9 else (1.0, 0.0)  # to the left of the heading is (-hy, hx)
    speed_along = speed_across = speed_up = gain_along = gain_across = 0.0
    total, turning, by, sin, cos = 0.0, 0.0, 0, 0.0, 1.0  # [rad/s]: of the links before, and of the first `by`
    for link in range(tire.links):
        c = 6 * tire.chain[link]
        # velocity of the point that the dof makes: what it moves, and what it turns
        vx = axes[c + 3] + axes[c + 1] * z - axes[c + 2] * y
        vy = axes[c + 4] + axes[c + 2] * x - axes[c] * z
        up = axes[c + 5] + axes[c] * y - axes[c + 1] * x
        along, across = hx * vx + hy * vy, hx * vy - hy * vx
        if by < tire.turned_by[link]:
            before = turning
            while by < tire.turned_by[link]:
                if by > 0:  # its spin turns no heading
                    turning += axes[6 * tire.chain[by] + 2] * qvel[tire.chain[by]]
                by += 1
            if turning != before:
                half = 0.5 * timestep * turning
                sin, cos = math.sin(half), math.cos(half)
        row = _JACOBIAN + 64 * wheel + 4 * link
        scratch[row], scratch[row + 1] = along * cos + across * sin, across * cos - along * sin
        scratch[row + 2], scratch[row + 3] = up, 1.0 if link == 0 else 0.0
        if link > 0:
            speed = qvel[tire.chain[link]]
            speed_along += along * speed
            speed_across += across * speed
            speed_up += up * speed
            seen = total if tire.straight[link] else turning
            gain_along += seen * across * speed
            gain_across -= seen * along * speed
            total += axes[c + 2] * speed
    scratch[_MOVES], scratch[_MOVES + 1], scratch[_MOVES + 2] = speed_along, speed_across, speed_up
    scratch[_MOVES + 3], scratch[_MOVES + 4] = gain_along, gain_across
    return depth


@kernel
def _move(
    data: int, found: Fields, gear: Any, tire: Any, wheel: int, short: float, dofs: int, scratch: FloatArray
) -> float:  # fmt: skip
    """Write how a contact point moves, seen from the wheel, and how much faster in a short step; return its speed."""
    qvel, acceleration = stages.vector(data, found.qvel, dofs), stages.vector(data, found.qacc_smooth, dofs)
    along = across = up = 0.0
    first = _JACOBIAN + 64 * wheel
    for link in range(1, tire.links):
        pull = acceleration[tire.chain[link]] * short
        along += scratch[first + 4 * link] * pull
        across += scratch[first + 4 * link + 1] * pull
        up += scratch[first + 4 * link + 2] * pull
    spin, pull = qvel[tire.chain[0]], acceleration[tire.chain[0]] * short
    velocity, free = _VELOCITY + 3 * wheel, _FREE + 3 * wheel
    scratch[velocity] = scratch[_MOVES] + scratch[first] * spin
    scratch[velocity + 1] = scratch[_MOVES + 1] + scratch[first + 1] * spin
    scratch[velocity + 2] = scratch[_MOVES + 2] + scratch[first + 2] * spin
    scratch[free] = along + scratch[first] * pull + short * scratch[_MOVES + 3]
    scratch[free + 1] = across + scratch[first + 1] * pull + short * scratch[_MOVES + 4]
    scratch[free + 2] = up + scratch[first + 2] * pull
    for lane in range(gear.lanes):
        scratch[_VELOCITY + CONTACTS + lane] += gear.share[wheel, lane] * spin
        scratch[_FREE + CONTACTS + lane] += gear.share[wheel, lane] * pull
    forward: float = abs(scratch[_MOVES])
    return forward


@kernel
def _half_solve(
    data: int, found: Fields, inertia: Inertia, gear: Any, tire: Any, wheel: int, dofs: int, scratch: FloatArray
) -> None:
    """Write D^-1/2 L^-T times the rows of a wheel, of MuJoCo's inertia L' D L, for its own dofs; add to common ones."""
    factor = stages.vector(data, found.inertia_factor, len(inertia.columns))
    diagonal = stages.vector(data, found.inverse_diagonal, dofs)
    rows, halves, last = _JACOBIAN + 64 * wheel, _HALVES + 64 * wheel, tire.links - 1
    for i in range(4 * tire.links):
        scratch[halves + i] = scratch[rows + i]
    for link in range(tire.own_links):
        dof, own = tire.chain[link], halves + 4 * link
        start, root = inertia.row_starts[dof], math.sqrt(diagonal[dof])
        for entry in range(last - link):  # its row has all that it hangs on, the root first
            add_scaled_4(scratch, halves + 4 * (last - entry), own, -factor[start + entry])
        for i in range(4):
            scratch[own + i] *= root
    for link in range(tire.own_links, tire.links):
        common = _COMMON + LANES * tire.common[link]
        for i in range(3):
            scratch[common + 3 * wheel + i] = scratch[halves + 4 * link + i]
        for lane in range(gear.lanes):
            scratch[common + CONTACTS + lane] += gear.share[wheel, lane] * scratch[halves + 4 * link + 3]


@kernel
def _half_solve_common(
    data: int, found: Fields, inertia: Inertia, gear: Any, dofs: int, scratch: FloatArray
) -> None:  # fmt: skip
    """Go on with what `_half_solve` does, for the common dofs."""
    factor = stages.vector(data, found.inertia_factor, len(inertia.columns))
    diagonal = stages.vector(data, found.inverse_diagonal, dofs)
    for place in range(gear.commons - 1, -1, -1):
        dof, own = gear.common[place], _COMMON + LANES * place
        start, root = inertia.row_starts[dof], math.sqrt(diagonal[dof])
        for entry in range(inertia.row_counts[dof] - 1):
            add_scaled_16(scratch, _COMMON + LANES * gear.common_of[place, entry], own, -factor[start + entry])
        for i in range(LANES):
            scratch[own + i] *= root


@kernel
def _mobility(gear: Any, tires: TireRows, short: float, scratch: FloatArray) -> None:
    """Write by how much each force changes each velocity in a short step (LANES, LANES), as far as there are some."""
    rows = CONTACTS + gear.lanes
    for i in range(LANES * rows):
        scratch[_MOBILITY + i] = scratch[_ODD + i] = 0.0
    for place in range(gear.commons):
        sums, row = _ODD if place % 2 == 1 else _MOBILITY, _COMMON + LANES * place
        for i in range(rows):
            add_scaled_16(scratch, sums + LANES * i, row, scratch[row + i])
    for i in range(LANES * rows):
        scratch[_MOBILITY + i] += scratch[_ODD + i]
    for k in range(len(tires)):
        block, along = _MOBILITY + (LANES + 1) * 3 * k, _MOBILITY + LANES * 3 * k + CONTACTS
        for link in range(tires[k].own_links):
            own = _HALVES + 64 * k + 4 * link
            x, y, z, spin = scratch[own], scratch[own + 1], scratch[own + 2], scratch[own + 3]
            scratch[block] += x * x
            scratch[block + LANES] += y * x
            scratch[block + LANES + 1] += y * y
            scratch[block + 2 * LANES] += z * x
            scratch[block + 2 * LANES + 1] += z * y
            scratch[block + 2 * LANES + 2] += z * z
            for i in range(gear.lanes):
                turned = gear.share[k, i] * spin
                scratch[along + i] += turned * x
                scratch[along + LANES + i] += turned * y
                scratch[along + 2 * LANES + i] += turned * z
                for j in range(gear.lanes):
                    scratch[_MOBILITY + (LANES + 1) * CONTACTS + LANES * i + j] += turned * gear.share[k, j] * spin
        for i in range(3):
            for j in range(i):
                scratch[block + LANES * j + i] = scratch[block + LANES * i + j]
            for j in range(gear.lanes):
                scratch[_MOBILITY + LANES * (CONTACTS + j) + 3 * k + i] = scratch[along + LANES * i + j]
    for i in range(LANES * rows):
        scratch[_MOBILITY + i] *= short


@kernel
def _tie(gear: Any, short: float, scratch: FloatArray) -> None:
    """Take rigid ties and the motor's inertia out of mobility, free motion and velocities; write their rows (20,)."""
    for i in range(gear.lanes):
        if gear.give[i] >= 0.0:
            lane, row = CONTACTS + i, _TIED + 20 * i
            for j in range(LANES):
                scratch[row + j] = scratch[_MOBILITY + LANES * lane + j]
            size = scratch[row + lane] + short * gear.give[i]
            free, wrong = scratch[_FREE + lane], scratch[_VELOCITY + lane] if gear.give[i] == 0.0 else 0.0
            scratch[row + LANES], scratch[row + LANES + 1], scratch[row + LANES + 2] = size, free, wrong
            add_scaled_16(scratch, _FREE, row, -free / size)
            add_scaled_16(scratch, _VELOCITY, row, -wrong / size)
            for j in range(CONTACTS + gear.lanes):
                add_scaled_16(scratch, _MOBILITY + LANES * j, row, -scratch[row + j] / size)


@kernel
def _add_tie_forces(gear: Any, forces: int, steps: float, scratch: FloatArray) -> None:
    """Add to sums of forces over so many short steps (LANES,) those that `_tie` has left out."""
    for i in range(gear.lanes - 1, -1, -1):  # what was taken out last knows of no other
        if gear.give[i] >= 0.0:
            row = _TIED + 20 * i
            moved = steps * scratch[row + LANES + 1] + scratch[row + LANES + 2]
            for j in range(CONTACTS + gear.lanes):
                moved += scratch[row + j] * scratch[forces + j]
            scratch[forces + CONTACTS + i] -= moved / scratch[row + LANES]


@kernel
def _spin_torque(gear: Any, wheel: int, forces: int, scratch: FloatArray) -> float:
    """Return the torque on a wheel of forces of the drive line [N m]."""
    torque = 0.0
    for i in range(gear.lanes):
        torque += gear.share[wheel, i] * scratch[forces + CONTACTS + i]
    return torque


@kernel
def _hold_clutches(gear: Any, pull: float, before: float, scratch: FloatArray) -> None:
    """Let drag brake and clutches hold what they can; `pull` is the motor's force without MuJoCo's, `before` [N]."""
    if gear.preload[0] >= 0.0:
        row = _MOBILITY + LANES * CONTACTS
        held = min(max(-scratch[_VELOCITY + CONTACTS] / scratch[row + CONTACTS], -gear.preload[0]), gear.preload[0])
        scratch[_FORCE + CONTACTS] = pull + held
        add_scaled_16(scratch, _VELOCITY, row, held)
    for j in range(LANES):
        scratch[_THROUGH + j] = scratch[_FORCE + j]
    _add_tie_forces(gear, _THROUGH, 1.0, scratch)
    scratch[_THROUGH + CONTACTS] += before
    for i in range(1, gear.lanes):
        if gear.preload[i] >= 0.0:
            lane, first = CONTACTS + i, 0 if gear.share[0, i] != 0.0 else 2
            through = _spin_torque(gear, first, _THROUGH, scratch) + _spin_torque(gear, first + 1, _THROUGH, scratch)
            most, row = gear.preload[i] + gear.ramp[i] * abs(through), _MOBILITY + LANES * lane
            held = min(max(-scratch[_VELOCITY + lane] / scratch[row + lane], -most), most)
            scratch[_FORCE + lane] = held
            add_scaled_16(scratch, _VELOCITY, row, held)


@kernel
def _control(model: int, data: int, found: Fields, gear: Any, servo: int, scratch: FloatArray) -> float:
    """Return what a servo of a car is told now, delay and range included."""
    actuator = gear.actuator[servo]
    delay = stages.vector(model, found.actuator_delay, actuator + 1)[actuator]
    if gear.delayed[servo] >= 0 and delay > 0.0:  # of no delay MuJoCo's history knows the last step's only
        now = stages.number_at(data + found.time)[0]
        address = stages.read_control(model, data, actuator, now, scratch.ctypes.data, gear.delayed[servo])
        told = stages.number_at(address)[0] if address != 0 else scratch[0]
    else:
        told = stages.vector(data, found.ctrl, actuator + 1)[actuator]
    control: float = min(max(told, gear.control_range[servo, 0]), gear.control_range[servo, 1])
    return control


@kernel
def steer(
    model: int, data: int, found: Fields, gear: Any, scratch: FloatArray, dofs: int, timestep: float, steps: int
) -> tuple[float, float]:
    """Return where the steering servo is after a physics step [rad], and its rate [rad/s]."""
    angle = stages.vector(data, found.qpos, gear.steering_qpos + 1)[gear.steering_qpos]
    rate = stages.vector(data, found.qvel, dofs)[gear.steering_dof]
    control, short, servo = _control(model, data, found, gear, 0, scratch), timestep / steps, gear.actuator[0]
    gain = stages.vector(model, found.actuator_gainprm, 10 * servo + 10)[10 * servo] * control
    bias = stages.vector(model, found.actuator_biasprm, 10 * servo + 10)[10 * servo : 10 * servo + 3]
    least, most = gear.force_range[0, 0], gear.force_range[0, 1]
    push, slowed = short / gear.steering_inertia, 0.5 * short * gear.steering_damping / gear.steering_inertia
    for _ in range(steps):  # of the second order: the force in the middle of a step, and means of rates
        middle = angle + 0.5 * short * rate
        force = min(max(gain + bias[0] + bias[1] * middle + bias[2] * rate, least), most)
        before, rate = rate, (rate * (1.0 - slowed) + push * force) / (1.0 + slowed)
        angle += 0.5 * short * (before + rate)
        if angle < gear.steering_range[0] or angle > gear.steering_range[1]:  # the joint ends there, and it stops
            angle, rate = min(max(angle, gear.steering_range[0]), gear.steering_range[1]), 0.0
    return angle, rate


@kernel
def put_steering(data: int, found: Fields, gear: Any, dofs: int, angle: float, rate: float) -> None:
    """Put the steering where its servo is, and the kingpins where Ackermann's polynomials have them."""
    most = max(gear.steering_qpos, gear.kingpin_qpos[0], gear.kingpin_qpos[1]) + 1
    qpos, qvel = stages.vector(data, found.qpos, most), stages.vector(data, found.qvel, dofs)
    qpos[gear.steering_qpos], qvel[gear.steering_dof] = angle, rate
    for side in range(2):
        c = gear.ackermann[side]
        qpos[gear.kingpin_qpos[side]] = c[0] + angle * (c[1] + angle * (c[2] + angle * (c[3] + angle * c[4])))
        slope = c[1] + angle * (2.0 * c[2] + angle * (3.0 * c[3] + angle * 4.0 * c[4]))
        qvel[gear.kingpin_dof[side]] = slope * rate
