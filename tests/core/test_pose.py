"""The pose that a planner is told: when it comes, what its errors are, by closed forms, and what stays true."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.pictures.rendering.recorded_drive import read_drive
from fg_mujoco.racing.resimulation import resimulate
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.sensors.bundled import Pose
from hand_planners import driven

CARS = 2000  # whose errors are drawn


def heard(pose, seconds=2, **settings):
    """The odometry of each decision of a drive on open ground, with the true pose of each physics step."""
    told = []

    def law(odometry):
        told.append(odometry)
        return 0.1, 2.0

    true = {"sensor": "pose", "name": "true", "rate": 200}
    settings |= {"assist": "none", "start_speed": 2.0, "sensors": [true]}
    fg.race(f"open_ground:{seconds}", driven(law), pose=pose, **settings)
    return told


def drawn(times, **settings):
    """The errors of many cars' poses at some times [s], (CARS, times, 3)."""

    def errors(seed):
        car = lambda time: SimpleNamespace(time=time, odometry={"pose": np.zeros(3)})  # noqa: E731
        measure = Pose(**settings).begin(car(0.0), np.random.default_rng(seed))
        return [measure(car(time)) for time in times]

    return np.array([errors(seed) for seed in range(CARS)])


# -- when it comes, and how it errs


def test_the_pose_is_that_of_the_stamp_that_rate_and_delay_say():
    told = heard("rate=10,delay=.06")
    true = {round(200 * stamp): values for odometry in told
            for stamp, values in zip(*[getattr(odometry.readings["true"], name) for name in ("stamps", "samples")],
                                     strict=True)}  # fmt: skip
    for odometry in told:
        stamp = math.floor((odometry.stamp - 0.06) / 0.1 + 1e-9) * 0.1
        if stamp < 0.0:
            assert np.isnan(odometry.pose).all()
            continue
        assert odometry.readings["pose"].stamp == pytest.approx(stamp, abs=1e-9)
        np.testing.assert_array_equal(odometry.pose, true[round(200 * stamp)])
    assert np.isnan(told[0].pose).all() and np.isfinite(told[-1].pose).all()


def test_noise_is_white_and_as_large_as_is_said():
    told = heard({"noise_std": [0.05, 0.05, 0.01]}, 20)
    errors = np.array([odometry.pose - odometry.readings["true"].values for odometry in told]) / (0.05, 0.05, 0.01)
    assert np.abs(errors.mean(axis=0)).max() < 4.0 / math.sqrt(len(errors))
    np.testing.assert_allclose(errors.std(axis=0), 1.0, rtol=4.0 / math.sqrt(2 * len(errors)))
    assert np.abs((errors[1:] * errors[:-1]).mean(axis=0)).max() < 4.0 / math.sqrt(len(errors))


def test_drift_is_a_random_walk_whenever_it_is_measured():
    times = np.array((0.0, 0.05, 0.3, 1.0, 4.0))
    errors = drawn(times, drift=(0.1, 0.1, 0.02)) / (0.1, 0.1, 0.02)
    expected = np.minimum(times[:, None], times)  # of Brownian motion
    wide = 4.0 * np.sqrt((np.outer(times, times) + expected**2) / CARS) + 1e-12
    for values in np.moveaxis(errors, -1, 0):
        assert (np.abs(values.T @ values / CARS - expected) < wide).all()


def test_jumps_are_of_the_size_that_is_said_there_and_back():
    times = np.arange(41) / 10.0
    errors = drawn(times, jumps=0.5, jump_size=0.3)
    far = np.hypot(errors[..., 0], errors[..., 1])
    away = far > 0.15
    np.testing.assert_allclose(far, 0.3 * away, atol=1e-12)
    assert not errors[..., 2].any()
    moved = np.linalg.norm(np.diff(errors, axis=1), axis=-1)
    assert ((moved < 1e-12) | (np.abs(moved - 0.3) < 1e-12)).all()
    share = 0.5 * (1.0 - np.exp(-2.0 * 0.5 * times))  # of a random telegraph signal
    assert (np.abs(away.mean(axis=0) - share) <= 4.0 * np.sqrt(share * (1.0 - share) / CARS)).all()
    side = (errors / 0.3)[:, -1][away[:, -1], :2]
    assert np.abs(side.mean(axis=0)).max() < 4.0 / math.sqrt(2 * len(side))


def test_the_same_seed_gives_the_same_poses():
    settings = "rate=20,noise_std=.02,drift=.1,jumps=5,jump_size=.3"
    one, again, other = (np.array([each.pose for each in heard(settings, seed=seed)]) for seed in (1, 1, 2))
    assert one.tobytes() == again.tobytes() != other.tobytes()


# -- who reads it, and who does not


def test_pure_pursuit_laps_by_the_pose_that_it_is_told():
    settings = {"laps": 1, "max_speed": 4.0}
    told = fg.race("oval", "pure_pursuit", pose="delay=.05,noise_std=.02", **settings).car
    true = fg.race("oval", "pure_pursuit", **settings).car
    assert told.finished and not told.collisions_wall and told.lap_times_s[0] != true.lap_times_s[0]
    assert told.lap_times_s[0] == pytest.approx(true.lap_times_s[0], rel=0.05)
    assert not fg.race("oval", "pure_pursuit", pose="jumps=2,jump_size=5", **settings).car.finished


def test_what_is_not_told_the_planner_is_true():
    runs = [fg.race("oval", laps=1, time_limit=1.0, pose=pose) for pose in (None, "delay=.1,noise_std=.5")]
    drives = [read_drive(run) for run in runs]
    plain, told = (list(resimulate(drive, World.from_xml(drive.xml))) for drive in drives)
    assert len(plain) == len(told) > 20
    for one, other in zip(plain, told, strict=True):
        assert one.command == other.command  # of a planner that reads no pose
        assert one.sensed.pose == tuple(one.sensed.odometry.pose.tolist()) == other.sensed.pose
        assert one.sensed.lateral_speed == other.sensed.lateral_speed
        assert not np.array_equal(one.sensed.odometry.pose, other.sensed.odometry.pose)
        assert other.surroundings(runs[0].world).pose == one.sensed.pose


def test_settings_are_a_text_a_table_or_a_sensor_and_are_kept():
    given = ("rate=10, noise_std=.05", {"rate": 10, "noise_std": 0.05}, Pose(rate=10.0, noise_std=0.05))
    setups = [Setup.of(pose=pose) for pose in given]
    assert setups[0] == setups[1] == setups[2] != Setup()
    assert Setup.read(json.loads(json.dumps(setups[0].described()))) == setups[0]
    assert setups[0].drive_settings.sensed == (Pose(rate=10.0, noise_std=0.05, as_odometry=True),)


@each(("pose", "said"), [
    ("particle_filter", "pose is 'particle_filter'; accepted: settings of the sensor pose, such as 'rate=10"),
    ({"rat": 10}, "pose is {'rat': 10}: sensor 'pose' has no setting 'rat'; accepted: name, rate"),
    ("drift=-1", "pose is 'drift=-1': Pose.drift is -1.0; accepted: a number from 0, or one for each of x_m"),
    ("jumps=1", "Pose.jumps is 1 and jump_size 0; accepted: both above 0, or neither"),
    ("jumps=1e9,jump_size=1", "accepted: 0 to 1000 a second"),
])  # fmt: skip
def test_what_no_pose_can_have_is_refused_and_a_second_one(pose, said):
    with pytest.raises(fg.SettingsError) as error:
        fg.race("oval", pose=pose)
    assert said in str(error.value)
    with pytest.raises(fg.SettingsError, match="two of the name 'pose'"):
        fg.race("oval", pose="rate=10", sensors=["pose"])
