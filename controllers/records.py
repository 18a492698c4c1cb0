"""Settings as rows of structured arrays, whose fields a kernel reads by name: `p.settings.lookahead`.

    PLANNER = np.dtype([("settings", record_type(GapFinderSettings)), ("car", CAR), ("max_speed", np.float64)])

The planners of a batch are an array of such rows, one for each world.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from fg_mujoco.messages import CarParameters

Record = Any
"""A row of a structured array, as a kernel gets it."""


def record_type(settings: type) -> np.dtype[np.void]:
    """Return the type of a row with the fields of a dataclass: floats, ints, bools. `dataclasses.astuple` makes one."""
    return np.dtype([(field.name, np.dtype(field.type)) for field in fields(settings)])


CAR = record_type(CarParameters)
