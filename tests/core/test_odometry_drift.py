"""Odometry that errs by a share of what is measured: planners are told another speed, and the physics is the same."""

import numpy as np

import fg_mujoco as fg
from cases import each
from hand_planners import driven

DRIFT = 0.05


def heard(drift):
    """A race by fixed commands, and what its planner was told."""
    told = []

    def law(odometry):
        told.append(odometry)
        return 0.1 if odometry.stamp > 0.5 else 0.0, 2.0

    return fg.race("oval", driven(law), laps=1, time_limit=1.0, odometry_drift=drift), told


@each("drift", (DRIFT, -0.3))
def test_speeds_and_yaw_rate_err_by_the_share_and_nothing_else_does(drift):
    (plain, true), (result, told) = heard(0.0), heard(drift)
    assert result.trajectory_sha256 == plain.trajectory_sha256  # its planner does not look at the odometry
    assert np.array_equal(result.car.telemetry, plain.car.telemetry, equal_nan=True)
    assert true[-1].speed > 1.0 and abs(true[-1].yaw_rate) > 0.1
    for real, message in zip(true, told, strict=True):
        assert message.speed == (1.0 + drift) * real.speed
        np.testing.assert_array_equal(message.wheel_speeds, (1.0 + drift) * real.wheel_speeds)
        assert message.yaw_rate == (1.0 + drift) * real.yaw_rate
        np.testing.assert_array_equal(message.angular_velocity[:2], real.angular_velocity[:2])
        for name in ("stamp", "steering_angle", "linear_acceleration", "pose"):
            np.testing.assert_array_equal(getattr(message, name), getattr(real, name))


def test_a_planner_that_believes_it_drives_otherwise():
    plain, drifted = (fg.race("oval", laps=1, time_limit=2.0, odometry_drift=d) for d in (0.0, DRIFT))
    assert drifted.trajectory_sha256 != plain.trajectory_sha256
