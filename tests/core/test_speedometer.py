"""The speedometer: how much odometry errs is measured from what a servo makes of commands."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.control.decision import LEFT_ALONE, SPEEDOMETER, command_speed, read_speedometer
from fg_mujoco.controllers.control.planner_settings import CAR_RECORD, record_values
from fg_mujoco.controllers.control.slip import drag
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED
from fg_mujoco.vehicle.vehicle import Vehicle

PARAMETERS = Vehicle.load().parameters
ROW = np.array([record_values(PARAMETERS)], CAR_RECORD)[0]
PERIOD, TOP = 0.025, 12.0
SHARE = 1.0 - math.exp(-PERIOD / PARAMETERS.speed_time_constant)


def driven(error, seconds, acceleration=0.0, start=4.0):
    """A first-order servo with drag, which commands overcome; it is told speeds that err, and given an acceleration."""
    memory, speed, told = np.zeros(1, SPEEDOMETER)[0], start, []
    for _ in range(round(seconds / PERIOD)):
        told.append(speed * (1.0 + error))
        read_speedometer(memory, told[-1], ROW, PERIOD)
        asked = told[-1] + acceleration * PERIOD / SHARE + ROW["speed_time_constant"] * drag(ROW, told[-1])
        command = command_speed(memory, asked, ROW, TOP, PERIOD, LEFT_ALONE)
        speed += SHARE * (command - speed - ROW["speed_time_constant"] * drag(ROW, speed))
    return memory, np.array(told)


@each("error", (0.05, -0.05, 0.12))
@each("acceleration", (0.0, 1.5, -1.5))
def test_the_error_is_measured_and_the_speed_becomes_what_was_asked_for(error, acceleration):
    memory, told = driven(error, 1.6, acceleration)
    assert memory["error"] == pytest.approx(error, abs=0.005)
    last = np.diff(told)[-4:] / PERIOD
    left = 0.012 * told[-1] / PARAMETERS.speed_time_constant  # an error of 1 % is left alone
    np.testing.assert_allclose(last, acceleration, atol=1.5 * left)
    first = (told[1] - told[0]) / PERIOD  # nothing was measured yet: the error shows in full
    assert abs(first - acceleration) > 0.8 * abs(error) * 4.0 / PARAMETERS.speed_time_constant


@each("error", (0.0, 0.009, -0.009))
def test_an_error_that_a_car_without_one_shows_changes_no_command(error):
    memory, _ = driven(error, 1.0, 1.0)
    memory["error"] = error
    assert command_speed(memory, 3.7, ROW, TOP, PERIOD, LEFT_ALONE) == pytest.approx(3.7, rel=1e-15)
    assert command_speed(memory, 3.7, ROW, TOP, PERIOD, 0.0) == pytest.approx(3.7 / (1.0 + error), rel=1e-12)


@each("drift", (0.05, -0.05))
def test_a_race_with_odometry_that_errs_does_not_slide(drift):
    """By the speed that counts as sliding, at most starts; where a bend takes all grip, some ticks are beyond it."""
    cars = [fg.race("oval", "gap_finder", laps=1, odometry_drift=drift, start_s=float(s)).car for s in range(8)]
    slides = [car.max_slide_m_s for car in cars]
    assert all(car.finished for car in cars)
    assert np.median(slides) <= SLIDING_SPEED and max(slides) <= 2 * SLIDING_SPEED
