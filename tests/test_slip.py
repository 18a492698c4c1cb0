"""Slip angles: what a planner is told of its tires, and how it steers for them."""

from dataclasses import replace

import pytest

import fg_mujoco as fg
from fg_mujoco.controllers.control.slip import arc_angle, slip_row, steered
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
SOFT = replace(CAR, **Tires.load("forzaeth_nuc6").for_planners())


def test_contacts_need_no_slip_angles():
    assert Tires().for_planners() == {} and not slip_row(CAR, 9.0)["soft"][0]


@pytest.mark.parametrize("speed", [0.5, 2.0, 4.0])
@pytest.mark.parametrize("angle", [-0.1, 0.02, 0.15])
def test_the_arc_of_the_steering_angle_for_an_arc_is_this_arc(speed, angle):
    limiter = FrictionLimiter(SOFT, 0.877).record[0]
    steering = steered(limiter["slip"], limiter["car"], angle, speed)
    assert abs(steering) > abs(angle)  # its front axle needs more slip angle than the one behind
    if abs(steering) < SOFT.max_steering_angle:
        assert arc_angle(limiter["slip"], limiter["car"], steering, speed) == pytest.approx(angle, abs=1e-5)


def test_a_corridor_that_an_understeering_car_crashed_in_is_lapped():
    result = fg.race("l_corridor", laps=1, tires="forzaeth_nuc6")
    assert result.car.finished and result.car.max_slide_m_s == 0.0
    assert result.world.parameters.front_peak == pytest.approx(0.877, abs=1e-3)
