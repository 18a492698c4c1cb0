"""Localisation: distances by brute force, matching and particles in a room in closed form, and races on the pose."""

import math
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from drawn_worlds import lines, seen_from
from fg_mujoco.addons.drivers.localisation.distance_field import DistanceField, distance_at
from fg_mujoco.addons.drivers.localisation.field_matching import inverse, match
from fg_mujoco.addons.drivers.localisation.localiser import Localiser, PoseSettings
from fg_mujoco.addons.drivers.localisation.odometry import STATES, predicted
from fg_mujoco.addons.drivers.localisation.particle_filter import LEAST, costs_of, drawn_anew, kld_count, moments
from fg_mujoco.errors import ControllerError, MessageError, SettingsError
from fg_mujoco.messages import MapLine
from fg_mujoco.simulation.settings import DriveSettings
from scan_worlds import CAR, odometry_of, scan_of

METHODS = ("particle_filter", "scan_matching")
CORNERS = np.array([[-4.0, -2.5], [6.0, -2.5], [6.0, 3.5], [1.0, 3.5], [1.0, 2.0], [-4.0, 2.0]])  # no symmetry
ROOM = MapLine(points=np.array([[0.0, 0.0], [3.0, 0.0]]), closed=False, walls=(CORNERS,))
BEAMS = np.linspace(-0.75 * math.pi, 0.75 * math.pi, 271)
OVAL = fg.load_track("oval")
WALLS = lines([*CORNERS, CORNERS[0]])


def ranges_from(pose, bearings=BEAMS):
    """Return the ranges [m] from a pose of the LiDAR to the room's walls."""
    x, y, heading = pose
    return seen_from(WALLS, x, y, heading + bearings)


def lidar_at(pose):
    """Return the pose of the LiDAR of a car whose rear axle is at a pose."""
    x, y, heading = pose
    return x + CAR.lidar_offset * np.cos(heading), y + CAR.lidar_offset * np.sin(heading), heading


def ends_from(pose, count=60):
    """Return the ends of beams (count, 2) [m] that a car at a pose sees, in the frame of its rear axle."""
    bearings = np.linspace(BEAMS[0], BEAMS[-1], count)
    ranges = ranges_from(lidar_at(pose), bearings)
    return np.column_stack((CAR.lidar_offset + ranges * np.cos(bearings), ranges * np.sin(bearings)))


def scan_at(pose, stamp):
    return scan_of(ranges_from(lidar_at(pose)), math.radians(1.0), stamp=stamp)


def odometry_at(time, speed, rate, pose=(math.nan,) * 3):
    turning = np.array([0.0, 0.0, rate])
    return replace(odometry_of(speed, 0.0), stamp=time, angular_velocity=turning, pose=np.array(pose))


def off(pose, truth):
    """Return how far a pose is from another [m], and turned [rad]."""
    return math.hypot(pose[0] - truth[0], pose[1] - truth[1]), abs(math.remainder(pose[2] - truth[2], math.tau))


def localiser(seed=0, **settings):
    return Localiser.of(PoseSettings(**settings), ROOM, CAR, seed)


def test_distances_are_those_to_the_nearest_of_all_segments():
    field = DistanceField.of(OVAL.map_line)
    starts = np.concatenate(OVAL.map_line.walls)
    along = np.concatenate([np.roll(wall, -1, axis=0) - wall for wall in OVAL.map_line.walls])
    rng = np.random.default_rng(1)
    rows, columns = (rng.integers(0, size, 300) for size in field.distances.shape)
    for row, column in zip(rows, columns, strict=True):
        away = field.origin + field.resolution * np.array((column, row)) - starts
        share = np.clip(np.sum(away * along, axis=1) / np.sum(along**2, axis=1), 0.0, 1.0)
        least = np.min(np.hypot(*(away - share[:, None] * along).T))
        assert abs(field.distances[row, column]) == pytest.approx(least, abs=1e-5)


def test_a_scan_is_laid_on_the_walls():
    field, truth = DistanceField.of(ROOM), np.array((0.3, -0.4, 0.5))
    ends = ends_from(truth, 120)
    prior = 1e-6 * np.eye(3)
    for shift in ((0.15, -0.1, 0.08), (-0.1, 0.1, -0.1)):
        found, information, share = match(field.distances, field.origin, field.resolution, ends, truth + shift, prior,
                                          0.05, 0.3, 12)  # fmt: skip
        assert np.abs(found - truth).max() < 2e-3 and share > 0.95
        assert np.sqrt(np.diag(inverse(information))).max() < 0.02


def test_costs_are_those_of_the_likelihood_field():
    field, rng = DistanceField.of(ROOM), np.random.default_rng(3)
    particles = rng.uniform((-3.0, -2.0, -3.0), (5.0, 1.8, 3.0), (50, 3))
    ends = ends_from((0.0, 0.0, 0.0)).astype(np.float32)
    costs = np.empty(50)
    costs_of(particles, field.distances, field.origin, field.resolution, ends, 0.1, 4.0, costs)
    for particle, cost in zip(particles, costs, strict=True):
        cos, sin = math.cos(particle[2]), math.sin(particle[2])
        places = particle[:2] + ends @ np.array([[cos, sin], [-sin, cos]])
        nodes = (places - field.origin) / field.resolution
        top = np.array(field.distances.shape[::-1]) - 1.01
        distances = np.array([distance_at(field.distances, *np.clip(node, 0.0, top)) for node in nodes])
        squared = distances**2
        assert cost == pytest.approx(np.sum(squared / (2 * 0.1**2 + squared / 4.0)), rel=2e-3)


def test_particles_are_drawn_in_proportion_to_their_weights():
    rng = np.random.default_rng(4)
    particles = np.repeat(np.arange(40.0)[:, None], STATES, axis=1)
    weights = rng.dirichlet(np.full(40, 0.3))
    chosen = np.empty((1000, STATES))
    drawn_anew(particles, weights, 1000, 0.37, chosen)
    counts = np.bincount(chosen[:, 0].astype(int), minlength=40)
    assert np.abs(counts - 1000.0 * weights).max() <= 1.0  # of systematic drawing


def test_headings_are_averaged_on_the_circle():
    rng = np.random.default_rng(5)
    particles = rng.normal((1.0, -2.0, math.pi, 0.0, 0.0), (0.1, 0.2, 0.05, 0.01, 0.01), (20_000, STATES))
    mean, covariance = moments(particles, np.full(20_000, 1.0 / 20_000))
    particles[:, 2] = np.remainder(particles[:, 2] + math.pi, 2.0 * math.pi) - math.pi  # half of them are near -pi
    again = moments(particles, np.full(20_000, 1.0 / 20_000))
    assert abs(math.remainder(mean[2] - math.pi, math.tau)) < 0.002
    assert covariance[2, 2] == pytest.approx(0.05**2, rel=0.05)
    assert again[0] == pytest.approx(mean) and again[1] == pytest.approx(covariance, abs=1e-12)


@each("bins", [50, 400, 3000])
def test_kld_sampling_takes_as_many_particles_as_chi_square_says(bins):
    from scipy.stats import chi2  # which takes a second to import

    assert kld_count(bins) == pytest.approx(chi2.ppf(0.99, bins - 1) / (2.0 * 0.03), rel=0.005)
    assert kld_count(1) == LEAST


def test_a_prediction_has_the_moments_of_many_samples():
    rng = np.random.default_rng(6)
    mean, deviations = np.array((1.0, 2.0, 0.7, 0.02, -0.03)), np.array((0.02, 0.03, 0.02, 0.03, 0.03))
    state, covariance = predicted(mean, np.diag(deviations**2), 0.5, 0.2, 0.01, 0.004, 0.006, 0.001)
    samples = rng.normal(mean, deviations, (200_000, 5))
    moved = 0.5 * (1.0 + samples[:, 3]) + rng.normal(0.0, 0.01, 200_000)
    turned, aside = 0.2 * (1.0 + samples[:, 4]), rng.normal(0.0, 0.006, 200_000)
    heading = samples[:, 2] + 0.5 * turned
    samples[:, 0] += moved * np.cos(heading) - aside * np.sin(heading)
    samples[:, 1] += moved * np.sin(heading) + aside * np.cos(heading)
    samples[:, 2] += turned + rng.normal(0.0, 0.004, 200_000)
    samples[:, 3:] += rng.normal(0.0, 0.001, (200_000, 2))
    assert state == pytest.approx(samples.mean(axis=0), abs=5e-4)
    assert covariance == pytest.approx(np.cov(samples.T), abs=1.5e-5)


def circling(found, late=0, seconds=2.5, error=1.0):
    """Drive a car round in the room, and return how far the poses of the last second are off [m], [rad]."""
    speed, rate, period, errors = 1.2, 0.8, 0.025, []

    def pose_at(time):
        heading = rate * np.maximum(time, 0.0)
        return speed / rate * np.sin(heading), -1.0 + speed / rate * (1.0 - np.cos(heading)), heading

    for tick in range(round(seconds / period)):
        now, then = tick * period, max(tick - late, 0) * period
        sensed = odometry_at(now, error * speed, error * rate, pose_at(0.0) if tick == 0 else (math.nan,) * 3)
        pose = found.locate(scan_at(pose_at(then), then), sensed)
        if now > seconds - 1.0:
            errors.append(off(pose, pose_at(now)))
    return np.max(errors, axis=0)


@each("pose", METHODS)
def test_a_car_is_tracked_by_late_scans_and_odometry_that_reads_too_much(pose):
    found = localiser(pose=pose)
    distance, turned = circling(found, late=3, error=1.05)
    assert distance < 0.03 and turned < 0.02
    assert found.method.state[3:] == pytest.approx(-0.05 / 1.05, abs=0.03)  # what it multiplies odometry by, less 1
    assert np.all(np.linalg.eigvalsh(found.covariance) > 0.0)


@each("pose", METHODS)
def test_a_car_that_may_be_anywhere_is_found(pose):
    found = localiser(pose=pose, pose_start="unknown")
    assert not np.isfinite(found.locate(scan_at((0.0, -1.0, 0.0), 0.0), odometry_at(0.0, 0.0, 0.0))).any()
    assert np.isnan(found.covariance).all()
    distance, _ = circling(localiser(pose=pose, pose_start="unknown"))
    assert distance < 0.05


def test_a_car_that_was_carried_away_is_found_again():
    found = localiser(pose="particle_filter")
    here, there = (0.0, -1.0, 0.0), (4.5, 2.0, 2.0)
    for tick in range(120):
        truth = here if tick < 20 else there
        pose = found.locate(scan_at(truth, 0.025 * tick), odometry_at(0.025 * tick, 0.0, 0.0, here))
    distance, turned = off(pose, there)
    assert distance < 0.05 and turned < 0.05


@each("pose", METHODS)
def test_the_same_seed_gives_the_same_bits(pose):
    ends = []
    one = localiser(pose=pose, pose_start="unknown", seed=7)
    for found in (one, one, localiser(pose=pose, pose_start="unknown", seed=7)):
        found.reset()
        circling(found, seconds=1.2)
        ends.append(found.pose.tobytes())
    assert ends[0] == ends[1] == ends[2]
    other = localiser(pose="particle_filter", seed=8)
    circling(other, seconds=1.2)
    assert other.pose.tobytes() != ends[0]


@each("pose", METHODS)
def test_pure_pursuit_laps_on_the_pose_that_is_found(pose):
    effects = fg.LidarEffects(range_noise_std=0.02, latency=0.025)
    settings = {"laps": 1, "tires": "coulomb", "effects": effects, "odometry_drift": 0.05}
    found = fg.race("oval", f"pure_pursuit[pose={pose}]", **settings).car
    truth = fg.race("oval", "pure_pursuit", **settings).car
    assert found.end_reason == "finished" and found.collisions_wall == 0
    assert found.lap_times_s[0] < 1.02 * truth.lap_times_s[0]


def test_a_map_in_which_no_pose_can_be_found_is_refused():
    line = MapLine(points=ROOM.points, closed=False)
    for map_line, said in ((None, "there is no map"), (line, "the map has a line and no walls")):
        context = DriveSettings().context(CAR, map_line)
        with pytest.raises(ControllerError, match=said):
            fg.make_controller("gap_finder", context, settings={"pose": "scan_matching"})
    with pytest.raises(SettingsError, match="no free ground"):
        narrow = np.array([[0.0, 0.0], [1.0, 0.004], [0.0, 0.008]])
        DistanceField.of(MapLine(points=[[0.1, 0.004], [0.2, 0.004]], closed=False, walls=(narrow,)))
    with pytest.raises(MessageError, match=r"walls\[0\] has shape"):
        MapLine(points=ROOM.points, closed=False, walls=(CORNERS[:2],))
