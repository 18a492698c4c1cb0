"""The force of a tire's contact patch: its deflection, slip and relaxation.

Each tire has two deflections u [m] of its contact patch, along its heading and across, that follow the velocity v of
its contact point over the ground by

    du/dt = v - V u / sigma

with the relaxation length sigma and the wheel's forward speed V. Its slip is u / sigma: along the heading the slip
ratio, across it the tangent of the slip angle. In a slip of both, each is measured by the slip of its own peak
(similarity): the size r of this slip vector gives the force, the law's at r times the peak's slip, along the slip
vector. So the greatest forces lie on an ellipse, and a tire is past its peak where r is above 1. A law of bristles
(Law.holds) keeps u where r is 1; what the contact point moves beyond that is sliding. Rubber also damps: a force
against du/dt. Across the heading only the tire of a wheel that hardly rolls damps: a rolling one is damped by its
relaxation, and the force would come V c / k sooner than the relaxation length says.
"""

from __future__ import annotations

import math
from typing import Any

from ..compiled.kernels import inlined, kernel, numbas
from .tires import GREATEST_SLIP, curve_force

_ROLLING = 0.5  # [m/s] of a wheel: from there on its tire does not damp across the heading


@numbas(bool)
def unlikely() -> Any:
    """Return a function that returns its argument, a condition, and tells the compiler that it is seldom true."""
    from llvmlite.ir import Constant, FunctionType, IntType
    from numba.core import types
    from numba.extending import intrinsic

    def unlikely(context: Any, condition: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            bit = IntType(1)
            expect = builder.module.declare_intrinsic("llvm.expect", [bit], FunctionType(bit, [bit, bit]))
            return builder.call(expect, [given[0], Constant(bit, 0)])

        return types.boolean(types.boolean), generate

    return intrinsic(unlikely)


@kernel
def slips(tire: Any, along: float, across: float) -> tuple[float, float, float]:
    """Return slip ratio and angle [rad] of deflections [m], positive if braked or drifting left, and their size."""
    ratio, angle = along / tire.relaxation_length, math.atan(across / tire.relaxation_length)
    share_x, share_y = ratio / tire.peak_slip[0], angle / tire.peak_slip[1]
    return ratio, angle, math.sqrt(share_x * share_x + share_y * share_y)


@kernel
def patch_force(tire: Any, along: float, across: float, grip: float) -> tuple[float, float]:
    """Return the force [N] ahead and left of a patch that is deflected [m]; `grip` [N] is of `grip_of`."""
    ratio, angle, size = slips(tire, along, across)
    return _shared_force(tire, ratio / tire.peak_slip[0], angle / tire.peak_slip[1], size, grip)


@kernel
def grip_of(tire: Any, load: float, mu: float) -> float:
    """Return the load [N] times what scales the curves of a tire: its load sensitivity, and its lateral peak `mu`."""
    grip: float = load * mu / tire.peak[1]
    if tire.load_sensitivity > 0.0 and load > 0.0:
        grip *= (load / tire.nominal_load) ** -tire.load_sensitivity
    return grip


@kernel
def curve_peaks(tire: Any, load: float, mu: float) -> tuple[float, float]:
    """Return the greatest force of a tire along its heading and across [N]; arguments as in `grip_of`."""
    grip = grip_of(tire, load, mu)
    return grip * tire.peak[0], grip * tire.peak[1]


@kernel
def deflect(
    tire: Any, along: float, across: float, over_x: float, over_y: float, forward: float, grip: float, timestep: float
) -> tuple[float, float, float, float, float, float, float]:
    """Return the deflections of a contact patch after a short step [m], and its force then [N].

    Args:
      along, across: deflection before, along the heading and to the left [m].
      over_x, over_y: velocity of the contact point over the ground, likewise [m/s].
      forward: that of the wheel, without sign [m/s].
      timestep: [s].

    Returns:
      Deflections, forces, size of the slip over that of the peak, and how fast it slides, ahead and to the left [m/s].
    """
    if tire.holds:
        left, reach = rolled(forward, tire.relaxation_length, timestep)
        slow_x, slow_y = damping_of(tire, forward, timestep)
        return bend(tire, along, across, over_x, over_y, left, reach, slow_x, slow_y, grip)
    sigma, sliding_x, sliding_y = tire.relaxation_length, 0.0, 0.0
    if tire.slides and along * over_x + across * over_y < 0.0 and slips(tire, along, across)[2] > 1.0:
        # A tire that slid, and now moves back, springs back by what gives its force, and no more.
        force_x, force_y = patch_force(tire, along, across, grip)
        along, across = -force_x * sigma / (grip * tire.slope[0]), -force_y * sigma / (grip * tire.slope[1])
    # a locked wheel deflects no further than to GREATEST_SLIP
    roll = max(forward, math.sqrt(over_x * over_x + over_y * over_y) / GREATEST_SLIP)
    left, reach = rolled(roll, sigma, timestep)
    new_along, new_across = along * left + reach * over_x, across * left + reach * over_y
    ratio, angle, size = slips(tire, new_along, new_across)
    ratio, angle = ratio / tire.peak_slip[0], angle / tire.peak_slip[1]
    if tire.slides and size > 1.0:
        sliding_x, sliding_y = over_x * (1.0 - 1.0 / size), over_y * (1.0 - 1.0 / size)
    force_x, force_y = _shared_force(tire, ratio, angle, size, grip)
    slow_x, slow_y = damping_of(tire, forward, timestep)
    force_x, force_y = force_x - slow_x * (new_along - along), force_y - slow_y * (new_across - across)
    if tire.slides:
        force_x, force_y = within_peaks(tire, force_x, force_y, grip)
    return new_along, new_across, force_x, force_y, size, sliding_x, sliding_y


@kernel
def rolled(forward: float, relaxation_length: float, timestep: float) -> tuple[float, float]:
    """Return the share of a deflection left after a short step, and what a velocity adds [s]: exact if it stays."""
    way = timestep * forward / relaxation_length
    if way < 1e-6:
        return 1.0 - way, timestep
    left = math.exp(-way)
    return left, timestep * (1.0 - left) / way


@kernel
def damping_of(tire: Any, forward: float, timestep: float) -> tuple[float, float]:
    """Return what damps each metre of deflection, along the heading and across, where it fades with the speed [N/m]."""
    standing = max(1.0 - forward / _ROLLING, 0.0)
    return tire.damping / timestep, tire.damping * standing / timestep


@inlined
def bend(
    tire: Any, along: float, across: float, over_x: float, over_y: float, left: float, reach: float, slow_x: float,
    slow_y: float, grip: float,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """Do what `deflect` does, for a tire of bristles; `left` and `reach` are of `rolled`, the rest of `damping_of`."""
    new_along, new_across = along * left + reach * over_x, across * left + reach * over_y
    ratio = new_along / (tire.relaxation_length * tire.peak_slip[0])
    angle = new_across / (tire.relaxation_length * tire.peak_slip[1])
    square, sliding_x, sliding_y = ratio * ratio + angle * angle, 0.0, 0.0
    size = math.sqrt(square)
    if unlikely(square > 1.0):
        beyond = (1.0 - 1.0 / size) / reach
        sliding_x, sliding_y = new_along * beyond, new_across * beyond
        new_along, new_across = new_along / size, new_across / size
    force_x, force_y = _shared_force(tire, ratio, angle, size, grip)
    force_x, force_y = force_x - slow_x * (new_along - along), force_y - slow_y * (new_across - across)
    force_x, force_y = within_peaks(tire, force_x, force_y, grip)
    return new_along, new_across, force_x, force_y, size, sliding_x, sliding_y


@kernel
def within_peaks(tire: Any, along: float, across: float, grip: float) -> tuple[float, float]:
    """Return a force [N] that is no greater than a tire that slides can give."""
    share_x, share_y = along / tire.peak[0], across / tire.peak[1]
    much = share_x * share_x + share_y * share_y
    if unlikely(much > grip * grip):
        down = grip / math.sqrt(much)
        return along * down, across * down
    return along, across


@inlined
def _shared_force(tire: Any, ratio: float, angle: float, size: float, grip: float) -> tuple[float, float]:
    """Return the force [N] along the heading and to the left, by slips over those of the peaks, and their size."""
    if size == 0.0:
        return 0.0, 0.0
    within = min(size, 1.0) if tire.holds else size
    across = curve_force(tire.law, tire.curve[1], within * tire.peak_slip[1])
    along = across if tire.alike else curve_force(tire.law, tire.curve[0], within * tire.peak_slip[0])
    scale = -grip / size
    return along * ratio * scale, across * angle * scale
