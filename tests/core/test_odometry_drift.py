"""Odometry that errs by a share of what is measured: planners are told another speed, and the physics is the same."""

import numpy as np
from test_wrong_way import Driver

import fg_mujoco as fg
from cases import each
from fg_mujoco.racing.resimulation import load_world, resimulate

DRIFT = 0.05


class Listener(Driver):
    """Drives a fixed course of commands, and keeps what it is told."""

    def __init__(self):
        super().__init__(lambda odometry: (0.1 if odometry.stamp > 0.5 else 0.0, 2.0))
        self.told = []

    def __call__(self, scan, odometry):
        self.told.append(odometry)
        return super().__call__(scan, odometry)


def heard(drift):
    listener = Listener()
    return fg.race("oval", listener, laps=1, time_limit=1.0, odometry_drift=drift), listener.told


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


def test_a_rollout_is_given_a_drift_or_draws_it():
    given = fg.rollout("oval", seeds=[1], time_limit=1.0, record="states", odometry_drift=DRIFT)
    drawn = fg.rollout("oval", seeds=[1], time_limit=1.0, record="states", randomize={"odometry_drift": DRIFT})
    assert np.array_equal(given.states(0), drawn.states(0))
    assert drawn["odometry_drift"].tolist() == [DRIFT]


def test_a_run_that_is_simulated_again_tells_what_the_planner_was_told(tmp_path):
    result, told = heard(DRIFT)
    assert result.summary()["odometry_drift"] == DRIFT
    run = fg.read_run(fg.write_run(result, tmp_path / "run", picture=False))
    again = [tick.sensed.odometry for tick in resimulate(run, load_world(run))]
    assert [odometry.speed for odometry in again] == [odometry.speed for odometry in told]
    assert [odometry.yaw_rate for odometry in again] == [odometry.yaw_rate for odometry in told]
