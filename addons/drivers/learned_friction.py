"""What cars have learned of the friction of their floor, as a part of an observation.

It is what `gap_finder[assist=full+learn]` learns from the speeds of its wheels, by the same code; see
addons/drivers/friction_learning.py for the method and its limits. So a policy is not told the friction, and still
has an estimate of it, which grows better while it drives.
"""

from __future__ import annotations

from dataclasses import astuple
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.controllers.control.planner_settings import CAR
from fg_mujoco.messages import CarParameters

from .friction_learning import LEARNED, learn, learning_row


class LearnedFriction:
    """What n cars that are alike have learned of the friction since their episodes began.

    Args:
      car: of the compiled model; its friction is not looked at.
      count: of cars, n.
      period: of a tick [s].
    """

    SIZE: ClassVar = 4

    def __init__(self, car: CarParameters, count: int, period: float) -> None:
        self._learning, self._learned = learning_row(car), np.zeros(count, LEARNED)
        self._car = np.zeros(1, CAR)
        self._car[0], self._period = astuple(car), period

    def begin(self, which: NDArray[np.bool_]) -> None:
        """Forget what the cars `which` (n,) have learned."""
        self._learned[which] = np.zeros((), LEARNED)

    def read(self, which: NDArray[np.bool_], odometry: NDArray[np.void]) -> NDArray[np.float32]:
        """Return what the cars have learned, after a tick of the cars `which` (n,). Shape (n, 4).

        The numbers are the friction coefficient that a careful driver would use, then the mean of the estimate and its
        standard deviation, 0 before there is one, and the greatest force over load that a tire has held.

        Args:
          which: (n,).
          odometry: (n,) of ODOMETRY.
        """
        _learn_of(which, self._learning, self._learned, self._car, odometry, self._period)
        return np.stack([self._learned[name] for name in ("mu", "mean", "deviation", "held")], axis=1, dtype=np.float32)


@kernel
def _learn_of(
    which: NDArray[np.bool_],
    learning: NDArray[np.void],
    learned: NDArray[np.void],
    car: NDArray[np.void],
    odometry: NDArray[np.void],
    period: float,
) -> None:
    """Take a tick of the cars `which` (n,) into what they have learned."""
    for i in range(len(which)):
        if which[i]:
            learn(learning[0], learned[i], car[0], odometry[i], period)
