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
relaxation, and the force would come V c / k sooner than the relaxation length says. native/vehicle/tire_patch.hpp does
all this.
"""

from __future__ import annotations

from ..native import core

grip_of, curve_peaks, deflect = core.grip_of, core.curve_peaks, core.deflect
