"""The tire laws by name, and the kernel that calls the right one.

A new law is a module in this folder, a place in LAWS, and a case in `curve_force`.
"""

from __future__ import annotations

from ...compiled.kernels import kernel
from ...messages import FloatArray
from . import brush, coulomb, friction_curve, linear, magic_formula
from .brush import Brush
from .coulomb import Coulomb
from .friction_curve import FrictionCurve
from .law import Law
from .linear import Linear
from .magic_formula import MagicFormula

CONTACT = "contact"
"""Model of tires that MuJoCo's own contacts carry, friction included; it has no curve of ours."""

LAWS: tuple[type[Law], ...] = (Coulomb, MagicFormula, Linear, Brush, FrictionCurve)
"""Their places are the numbers by which kernels and compiled models know them."""

LAW_OF = {law.model: law for law in LAWS}
MODELS = (CONTACT, *LAW_OF)

_COULOMB, _MAGIC_FORMULA, _LINEAR, _BRUSH, _FRICTION_CURVE = range(len(LAWS))


@kernel
def curve_force(law: int, numbers: FloatArray, slip: float) -> float:
    """Return the force over the load [-] of a law's tire at a slip without sign; `numbers` (NUMBERS,) are its row."""
    if law == _COULOMB:
        return coulomb.force(numbers, slip)
    if law == _MAGIC_FORMULA:
        return magic_formula.force(numbers, slip)
    if law == _LINEAR:
        return linear.force(numbers, slip)
    if law == _FRICTION_CURVE:
        return friction_curve.force(numbers, slip)
    return brush.force(numbers, slip)
