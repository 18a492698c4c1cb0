"""Recovery: the car reverses exactly along the path it came by, when it stands without a frontier, and not for ever."""

import math
from dataclasses import astuple

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.control.planner_settings import CAR_RECORD, for_car, record_type, record_values
from fg_mujoco.controllers.perception.local_map import LOCAL_MAP, extend_path, move
from fg_mujoco.controllers.perception.scan_geometry import geometry_record
from fg_mujoco.controllers.safety.recovery import RECOVERY, RecoverySettings, angle_back, reverses
from fg_mujoco.course.random_obstacles import random_boxes
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED
from scan_worlds import CAR, corridor

PERIOD = 0.025
DEFAULTS = for_car(RecoverySettings(), CAR)


class Driven:
    """A car in a corridor, with its path and what its recovery keeps of it."""

    def __init__(self):
        scan = corridor(1.0, 1.0, 20.0)
        self.geometry, self.ranges = geometry_record(scan)[0], scan.ranges
        self.world, self.memory = np.zeros(1, LOCAL_MAP)[0], np.zeros(1, RECOVERY)[0]
        self.settings = np.array([record_values(DEFAULTS)], record_type(RecoverySettings))[0]
        self.car = np.array([astuple(CAR)], CAR_RECORD)[0]
        self.go(0.0)

    def go(self, speed, yaw_rate=0.0):
        move(self.world, speed, yaw_rate, PERIOD)
        extend_path(self.world, self.geometry, self.ranges)

    def come(self, meters, speed=2.0):
        for _ in range(round(meters / (speed * PERIOD))):
            self.go(speed)
            self.reverses(speed, stands=False)

    def back(self):
        return float(angle_back(self.world, self.settings, self.car))

    def reverses(self, speed=0.0, *, stands=True, found=False, waits=True):
        return bool(reverses(self.memory, self.settings, self.world, speed, stands, found, waits, PERIOD))

    def stand(self, seconds, waits=True):
        """Stand without a way on; return the number of ticks in which the car is to go back."""
        return sum(self.reverses(waits=waits) for _ in range(round(seconds / PERIOD)))

    def return_(self):
        """Go back as long as the car is to; return how far [m], and the places on the way."""
        places = []
        while self.reverses(-DEFAULTS.speed if places else 0.0, stands=False) and not math.isnan(self.back()):
            self.go(-DEFAULTS.speed, -DEFAULTS.speed * math.tan(self.back()) / CAR.wheelbase)
            places.append((float(self.world["x"]), float(self.world["y"])))
        return len(places) * DEFAULTS.speed * PERIOD, places


@each("speed", [0.5, 2.0, 6.0])
def test_it_comes_back_along_its_own_path(speed):
    """A single-track car drives a wave, and back from its end; the path is known in closed form nowhere: it is kept."""
    car, path = Driven(), []
    for tick in range(round(3.0 / (speed * PERIOD))):
        car.go(speed, speed * math.tan(0.3 * math.sin(2.0 * tick * speed * PERIOD)) / CAR.wheelbase)
        path.append((float(car.world["x"]), float(car.world["y"])))
    assert car.stand(DEFAULTS.patience) == 1
    gone, places = car.return_()
    off = [np.hypot(*(np.array(path) - place).T).min() - 0.5 * speed * PERIOD for place in places]
    assert gone == pytest.approx(DEFAULTS.distance, abs=2.0 * DEFAULTS.speed * PERIOD)
    assert max(off) < 0.03
    assert math.dist(places[-1], path[-1]) > 0.9 * DEFAULTS.distance


def test_it_waits_first_and_a_moment_without_being_stuck_starts_that_anew():
    car = Driven()
    car.come(3.0)
    assert car.stand(DEFAULTS.patience - PERIOD) == 0
    car.reverses(stands=False)
    assert car.stand(DEFAULTS.patience - PERIOD) == 0
    assert car.stand(PERIOD) == 1


def test_each_time_it_goes_back_farther_and_after_some_tries_it_stays():
    car = Driven()
    car.come(6.0)
    for number in range(1, DEFAULTS.tries + 1):
        assert car.stand(DEFAULTS.patience if number == 1 else DEFAULTS.patience_known) == 1
        assert car.memory["back"] == pytest.approx(DEFAULTS.distance * number)
        car.return_()
        car.come(DEFAULTS.distance * number + 0.9 * DEFAULTS.come_on)  # not far enough to forget
    assert car.stand(10.0) == 0


def test_it_goes_back_sooner_where_a_frontier_is_known_and_nothing_moves():
    for waits, patience in ((True, DEFAULTS.patience), (False, DEFAULTS.patience_known)):
        car = Driven()
        car.come(6.0)
        assert car.stand(patience - PERIOD, waits) == 0, waits
        assert car.stand(PERIOD, waits) == 1, waits


def test_it_goes_back_no_farther_than_it_came_and_not_at_all_where_it_was_put():
    assert math.isnan(Driven().back())
    car = Driven()
    car.come(0.8)
    assert car.stand(DEFAULTS.patience) == 1
    gone, _ = car.return_()
    assert 0.4 < gone < 0.8 and math.isnan(car.back())


@pytest.mark.slow
@each("seed", [20, 40])
def test_a_car_askew_before_a_box_gets_past_and_without_going_back_it_stands(seed):
    boxes = random_boxes(fg.load_track("chicanes"), 4, seed, car=CAR)
    for kept, expected in ((True, "finished"), (False, "no_progress")):
        race = fg.race("chicanes", "gap_finder", laps=1, obstacles=boxes, assist="safe" if kept else "safe-recovery")
        assert race.car.end_reason == expected and race.car.collisions_wall == 0
        assert race.car.max_slide_m_s <= SLIDING_SPEED
        assert (race.car.column("speed_m_s").min() < -0.5) == kept
