"""Noise, dropouts, latency and motion distortion: statistics under a seed, and closed forms."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import each
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.lidar.effects import GREATEST_NOISE, LidarEffects
from fg_mujoco.lidar.lidar import make_lidar
from fg_mujoco.lidar.scan_pipeline import EffectsOfRows, PoseHistory, ScanPipeline, add_noise
from lidar_worlds import PREFIX, RIG, rig_spec, room

PERIOD, STEP = 0.025, 0.0025


class Rig:
    """The LiDAR in a room, moved by hand: at `pose(t)` = (x, y, yaw) at time t."""

    def __init__(self, effects, *, seed=0, pose=None, **size):
        spec = rig_spec(sensors=False)
        room(spec, **({"half_length": 6.0, "half_width": 4.0} | size))
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.lidar = make_lidar("raycast", self.model, PREFIX)
        self.pipeline = ScanPipeline(self.lidar, effects, seed)
        self.pose = pose or (lambda time: (0.0, 0.0, 0.0))
        self.move(0.0)
        mujoco.mj_kinematics(self.model, self.data)

    def move(self, time):
        x, y, yaw = self.pose(time)
        self.data.time = time
        mocap = self.model.body(RIG).mocapid[0]
        self.data.mocap_pos[mocap] = (x, y, 0.2)
        self.data.mocap_quat[mocap] = (math.cos(yaw / 2), 0, 0, math.sin(yaw / 2))

    def scan(self, tick):
        """Scan at the end of a tick, after recording each of its steps with body poses one step behind."""
        for step in range(9, -1, -1):
            mujoco.mj_kinematics(self.model, self.data)
            self.move(tick * PERIOD - step * STEP)
            self.pipeline.record(self.data)
        mujoco.mj_kinematics(self.model, self.data)
        return self.pipeline.scan(self.data)


# --- off ---


def test_without_effects_the_scan_is_the_measurement_now():
    rig = Rig(LidarEffects(), pose=lambda time: (10 * time, 0.0, 3 * time))
    for tick in range(4):
        scan = rig.scan(tick)
        assert scan.stamp == tick * PERIOD
        assert scan.time_increment == 0.0
        assert np.array_equal(scan.ranges, rig.lidar.ranges(rig.data))
    assert not rig.pipeline.needs_every_step


# --- noise and dropouts ---


def test_noise_is_gaussian_with_the_standard_deviation_asked_for():
    rig = Rig(LidarEffects(range_noise_std=0.02))
    truth = rig.lidar.ranges
    errors = np.concatenate([rig.scan(tick).ranges - truth(rig.data) for tick in range(100)])
    n = len(errors)  # 108100: sampling errors are 0.02 / sqrt(n) of the mean, 0.02 / sqrt(2 n) of the deviation
    assert abs(errors.mean()) < 4 * 0.02 / math.sqrt(n)
    assert abs(errors.std() - 0.02) < 4 * 0.02 / math.sqrt(2 * n)
    assert abs(np.mean(np.abs(errors) < 0.02) - 0.6827) < 0.006
    neighbours = np.corrcoef(errors[:-1], errors[1:])[0, 1]
    assert abs(neighbours) < 4 / math.sqrt(n)


def test_dropouts_read_nan_at_the_rate_asked_for():
    rig = Rig(LidarEffects(dropout_probability=0.03))
    scans = [rig.scan(tick).ranges for tick in range(100)]
    failed = np.isnan(np.concatenate(scans))
    assert abs(failed.mean() - 0.03) < 4 * math.sqrt(0.03 * 0.97 / failed.size)
    truth = rig.lidar.ranges(rig.data)
    assert all(np.array_equal(scan[~np.isnan(scan)], truth[~np.isnan(scan)]) for scan in scans)


# --- latency ---


@each(("latency", "ticks"), [(0.0, 0), (0.001, 1), (0.025, 1), (0.026, 2), (3 * 0.025, 3), (0.1, 4)])
def test_latency_delivers_older_scans_with_the_time_they_were_measured_at(latency, ticks):
    rig = Rig(LidarEffects(latency=latency), pose=lambda time: (10 * time, 0.0, 0.0))
    for tick in range(8):
        measured_at = max(tick - ticks, 0) * PERIOD  # until then, the first scan
        scan = rig.scan(tick)
        assert scan.stamp == pytest.approx(measured_at, abs=1e-12)
        assert scan.ranges[540] == pytest.approx(6.0 - 10 * measured_at, abs=1e-9)


# --- motion distortion ---


def test_driving_at_a_wall_each_beam_sees_it_from_where_it_was():
    speed = 8.0
    rig = Rig(LidarEffects(motion_distortion=True), pose=lambda time: (speed * time, 0.0, 0.0), half_width=50.0)
    assert rig.pipeline.needs_every_step
    for tick in range(4):
        scan = rig.scan(tick)
    ages = 0.01875 * (1 - np.arange(1081) / 1080)  # of the first beam 18.75 ms, of the last none
    ahead = np.abs(scan.bearings) < 1.2
    exact = (6.0 - speed * (3 * PERIOD - ages)) / np.cos(scan.bearings)
    np.testing.assert_allclose(scan.ranges[ahead], exact[ahead], rtol=0, atol=1e-9)
    assert scan.stamp == 3 * PERIOD
    assert scan.time_increment * 1080 == pytest.approx(0.01875)
    assert exact[540] - (6.0 - speed * 3 * PERIOD) == pytest.approx(0.075)  # half a sweep at 8 m/s


def test_turning_each_beam_points_where_it_did():
    yaw_rate = 6.0
    rig = Rig(LidarEffects(motion_distortion=True), pose=lambda time: (0.5, 0.2, 1.0 + yaw_rate * time))
    for tick in range(4):
        scan = rig.scan(tick)
    bearing = 1.0 + yaw_rate * (3 * PERIOD - 0.01875 * (1 - np.arange(1081) / 1080)) + scan.bearings
    cos, sin = np.cos(bearing), np.sin(bearing)
    exact = np.minimum((np.sign(cos) * 6.0 - 0.5) / cos, (np.sign(sin) * 4.0 - 0.2) / sin)
    np.testing.assert_allclose(scan.ranges, exact, rtol=0, atol=1e-9)


# --- pose history ---


def test_history_interpolates_positions_and_turns_the_short_way_round():
    history = PoseHistory(1.0)
    history.record(0.0, np.array([0.0, 0, 0]), np.array([1.0, 0, 0, 0]))
    history.record(1.0, np.array([2.0, 4, 0]), -np.array([math.cos(0.5), 0, 0, math.sin(0.5)]))  # 1 rad about z
    positions, quaternions = history.at(np.array([-1.0, 0.0, 0.25, 1.0, 9.0]))
    np.testing.assert_allclose(positions[:, 0], [0, 0, 0.5, 2, 2], atol=1e-12)
    turned = 2 * np.arctan2(quaternions[:, 3], quaternions[:, 0])
    np.testing.assert_allclose(turned, [0, 0, 0.25, 1, 1], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-12)


# --- invariants ---


@pytest.mark.slow
@given(
    std=st.floats(0, GREATEST_NOISE),
    dropout=st.floats(0, 1),
    distortion=st.booleans(),
    pose=st.tuples(st.floats(-7, 7), st.floats(-5, 5), st.floats(-4, 4)),
    seed=st.integers(0, 1000),
)
@settings(max_examples=40, deadline=None)
def test_any_effects_leave_readings_that_are_distances_infinite_or_failed(
    std, dropout, distortion, pose, seed
):
    effects = LidarEffects(range_noise_std=std, dropout_probability=dropout, motion_distortion=distortion)
    ranges = Rig(effects, seed=seed, pose=lambda time: tuple(np.array(pose) * (1 + time))).scan(1).ranges
    assert (np.isinf(ranges) | np.isnan(ranges) | ((ranges >= 0.02) & (ranges < 30.0))).all()
    if dropout == 0.0:
        assert not np.isnan(ranges).any()


def test_noise_is_added_to_ranges_and_held_between_zero_and_range_max():
    ranges = np.array([3.0, math.inf, -math.inf, 0.05, 9.99])
    noise = np.array([1.0, -3.0, 3.0, -6.0, 2.0])
    add_noise(ranges, 0.01, 10.0, noise)
    assert noise.tolist() == [3.0 + 0.01 * 1.0, 10.0, 0.0, 0.0, 10.0]


def by_numpy(beams, effects, seed, sweeps):
    """Oracle: what is delivered after each sweep, by numpy's own generator."""
    rng, held, late = np.random.default_rng(seed), [], effects.sweeps_late(beams.period)
    for ranges in sweeps:
        ranges = beams.readings(ranges + rng.normal(0.0, effects.range_noise_std, len(ranges)))
        ranges[rng.random(len(ranges)) < effects.dropout_probability] = math.nan
        ranges[ranges == math.inf] = beams.range_max if effects.no_return == "range_max" else math.inf
        held.append(ranges)
        yield held[max(len(held) - 1 - late, 0)]


@each("settings", [{}, {"latency": 0.05}, {"no_return": "range_max"}])
def test_effects_on_a_row_have_the_bits_of_numpys_numbers(settings):
    effects = LidarEffects(**{"range_noise_std": 0.3, "dropout_probability": 0.1} | settings)
    beams, rng = LidarModel.load().beams, np.random.default_rng(1)
    sweeps = [beams.readings(each) for each in rng.uniform(-0.1, 1.1, (4, len(beams.bearings))) * beams.range_max]
    of_rows, rows = EffectsOfRows(beams, 3), np.zeros((3, len(beams.bearings)))
    of_rows.begin(1, effects, 2)
    for ranges, due in zip(sweeps, by_numpy(beams, effects, 2, sweeps), strict=True):
        rows[:] = ranges
        of_rows.apply(np.array([True, True, False]), rows)
        assert rows[1].tobytes() == due.tobytes()
        assert rows[0].tobytes() == ranges.tobytes()
