"""Tires: the sets of models/tires/, and the laws by which the force of a tire on the ground follows from its slip."""

from .law import GREATEST_SLIP, NUMBERS, Law
from .laws import CONTACT, LAW_OF, LAWS, MODELS, curve_force
from .magic_formula import MagicFormula
from .plain_laws import Brush, Coulomb, Linear
from .sets import (
    AXLE_KEYS,
    CONTACT_TIMESTEP,
    DEFAULT_TIRES,
    IDEAL_TIRES,
    NUMERIC,
    AxleTires,
    Tires,
    tire_names,
    tires_of,
)

__all__ = [
    "AXLE_KEYS",
    "CONTACT",
    "CONTACT_TIMESTEP",
    "DEFAULT_TIRES",
    "GREATEST_SLIP",
    "IDEAL_TIRES",
    "LAWS",
    "LAW_OF",
    "MODELS",
    "NUMBERS",
    "NUMERIC",
    "AxleTires",
    "Brush",
    "Coulomb",
    "Law",
    "Linear",
    "MagicFormula",
    "Tires",
    "curve_force",
    "tire_names",
    "tires_of",
]
