"""Turns in several moves: when a slow car looks for one."""

import numpy as np

from cases import each
from fg_mujoco.controllers.perception.frontiers import FRONTIER_SEARCH
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.controllers.safety.motions import TURNING, turn_in_moves
from scan_worlds import CAR, MU


@each("rate", [10.0, 40.0, 100.0])
def test_a_slow_car_looks_for_a_turn_after_the_same_time_at_any_rate_of_the_lidar(rate):
    limiter = FrictionLimiter(CAR, MU).record[0]
    frontier, memory = np.zeros(1, FRONTIER_SEARCH)[0], np.zeros(1, TURNING)[0]
    frontier["found"] = True
    ticks = 0
    while not memory["active"]:
        turn_in_moves(frontier, limiter, memory, 0.0, 0.0, 1.0 / rate)
        ticks += 1
    assert abs(ticks / rate - 0.35) <= 0.5 / rate + 1e-9


def test_turns_that_begin_again_and_again_at_one_place_end():
    limiter = FrictionLimiter(CAR, MU).record[0]
    frontier, memory = np.zeros(1, FRONTIER_SEARCH)[0], np.zeros(1, TURNING)[0]
    frontier["found"] = True

    def begins():
        memory["active"] = False
        for _ in range(20):
            if not memory["active"]:
                turn_in_moves(frontier, limiter, memory, 0.0, 0.0, 0.025)
        return bool(memory["active"])

    assert [begins() for _ in range(6)] == [True] * 4 + [False] * 2
    frontier["map"]["along"] -= 1.5  # recovery has backed the car
    assert begins()
