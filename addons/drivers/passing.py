"""Among other cars: which to keep behind, which to pass and on which side, and how fast.

A car ahead is followed, at a distance at which the car could stop behind it should it brake, until there is
`room_to_pass` beside it, more for each m/s, along the way that it drives meanwhile, as far as the course is seen
(corridor). A pass is given up where there is less than `room_to_go_on`, unless the cars are beside each other already,
where they are not after 5 s, and where they come nearer to each other than a margin. Next to another car the planner's
car keeps its lane. It closes in on a car ahead only while it is clear of it sidewise.
Source of the distance: S. Shalev-Shwartz, S. Shammah and A. Shashua, On a Formal Model of Safe and Scalable
Self-driving Cars, arXiv 1708.06374, where it is called the safe longitudinal distance.

The work is done in native/addons/drivers/passing.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.controllers.safety.predictions import MOST_CARS
from fg_mujoco.native import core, record

from .other_cars import OTHER_CARS, TOLD

FOLLOWS, PASSES, DROPS_BACK = 0, 1, 2

PASSING = record(
    "Passing",
    [
        ("what", np.int64),  # FOLLOWS, PASSES or DROPS_BACK
        ("side", np.int64),  # on which it passes: 1 to the left, -1 to the right
        ("along", np.float64),  # [m] by which the middle of the other car is ahead of that of the planner's car
        ("across", np.float64),  # [m] by which the planner's car is to its left
        ("speed", np.float64),  # [m/s] of the other car in the direction of both
        ("stood", np.float64),  # [s] for which the other car has stood
        ("waits", np.float64),  # [s] before the next pass begins
        ("lasts", np.float64),  # [s] for which it passes and is still behind
        ("places", np.int64),  # of its way
        ("way", np.float64, (15, 5)),  # on which it is expected, see corridor.walk
    ],
)
RACING = record("Racing", [("seen", OTHER_CARS), ("told", TOLD), ("met", np.bool_), ("passing", PASSING, (MOST_CARS,))])
"""Type of what a planner among other cars keeps from tick to tick; zero at the beginning."""

choose, predict_cars, take_lane = core.choose, core.predict_cars, core.take_lane
