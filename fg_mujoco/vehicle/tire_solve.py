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

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

SCRATCH = 1536
"""Numbers that `push_car` needs room for."""


class Inertia(NamedTuple):
    """Which entries MuJoCo keeps of its inertia matrices: of a model, and the same for all its data."""

    row_counts: NDArray[np.int32]
    row_starts: NDArray[np.int32]
    columns: NDArray[np.int32]

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Inertia:
        """Return that of a model."""
        return cls(model.M_rownnz.copy(), model.M_rowadr.copy(), model.M_colind.copy())
