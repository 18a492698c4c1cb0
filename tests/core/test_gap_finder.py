"""The gap finder on scans of simple places: where it heads, how fast, and that it does so every time."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from cases import each
from fg_mujoco.controllers.control.stages import NativeStep
from fg_mujoco.controllers.gap_finder import GapFinder, GapFinderSettings
from fg_mujoco.errors import ControllerError
from fg_mujoco.messages import STOP, DriveCommand
from scan_worlds import CAR, INCREMENT, MU, corridor, odometry_of, rough_scan, rows_of, scan_of


@cache
def made(**settings):
    return GapFinder(CAR, MU, 8.0, GapFinderSettings(**settings))


def finder(**settings):
    """A gap finder as new."""
    planner = made(**settings)
    planner.reset()
    return planner


def ratio_speed(scan, **settings):
    """The speed that it commands by the range ratio alone [m/s]."""
    return finder(assist="mean_range", method="refined", **settings)(scan, odometry_of(0.0)).speed


def decide_all(batch, scans, odometries):
    """The commands of a batch, one for each world, as pairs; all scans have the geometry of the first."""
    commands, geometry = np.zeros((len(scans), 2)), scans[0] if scans else corridor(1.0, 1.0)
    ranges = np.array([scan.ranges for scan in scans]).reshape(len(scans), len(geometry.ranges))
    batch(geometry, ranges, rows_of(odometries), np.ones(len(scans), bool), commands)
    return [tuple(command) for command in commands.tolist()]


def test_the_wished_speed_is_by_the_mean_range_over_the_width_in_front():
    # a tent, 3 m ahead and 2 m less for each radian, no filter of which does much: over 10 degrees to either side
    # the mean is 3 - 2 * (5 degrees) = 2.825 m, and top speed is at 10 m / 3
    bearings = INCREMENT * (np.arange(1081) - 540)
    tent = scan_of(np.maximum(3.0 - 2.0 * np.abs(bearings), 0.1))
    speed = ratio_speed(tent, disparity_threshold=100.0, nearest_bubble=0.001, mean_radius=1e-6)
    assert speed == pytest.approx(8.0 * 2.825 / (10.0 / 3.0), rel=1e-3)


@each("mu", [MU, math.inf])
def test_without_odometry_it_stops(mu):
    for speed, angle in ((math.nan, 0.0), (1.0, math.nan), (math.inf, 0.0)):
        assert GapFinder(CAR, mu, 8.0)(corridor(1.0, 1.0), odometry_of(speed, angle)) == STOP


# -- many at once; that they decide alike is in the controller contract


def test_in_a_batch_each_has_settings_a_grip_and_a_top_speed_of_its_own():
    planners = [
        GapFinder(CAR, MU, 8.0), GapFinder(CAR, 0.5 * MU, 8.0), GapFinder(CAR, MU, 3.0),
        GapFinder(CAR, MU, 8.0, GapFinderSettings(lookahead=2.0)), GapFinder(CAR, math.inf, 8.0),
    ]  # fmt: skip
    scan, odometry = corridor(3.0, 0.8, ahead=6.0), odometry_of(2.99, 0.05)
    alone = [planner(scan, odometry) for planner in planners]
    assert len(set(alone)) == len(planners)
    commands = decide_all(GapFinder.batch(planners), [scan] * 5, [odometry] * 5)
    assert commands == [(command.steering_angle, command.speed) for command in alone]


@pytest.mark.slow
def test_batches_in_different_threads_do_not_meet():
    scans = [rough_scan(seed) for seed in range(8)]

    def drive(offset):
        batch = GapFinder.batch([GapFinder(CAR, mu, 8.0) for mu in (MU, 0.7, math.inf)])
        seen = [scans[(offset + tick) % 8] for tick in range(60)]
        return [decide_all(batch, [scan] * 3, [odometry_of(2.0, 0.05)] * 3) for scan in seen]

    one_by_one = [drive(offset) for offset in range(4)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(drive, range(4))) == one_by_one


def test_a_batch_takes_planners_of_its_own_class_only():
    class Other(GapFinder):
        """The same, by another name."""

    with pytest.raises(ControllerError, match="a batch of GapFinder was given a Other; accepted: its own class"):
        GapFinder.batch([GapFinder(CAR, MU), Other(CAR, MU)])
    assert Other.batch([Other(CAR, MU)])


def test_a_planner_with_a_decision_of_its_own_does_not_inherit_the_batch():
    class Slower(GapFinder):
        """Half as fast, by a wrapper in Python."""

        def __call__(self, scan, odometry):
            command = super().__call__(scan, odometry)
            return DriveCommand(steering_angle=command.steering_angle, speed=0.5 * command.speed)

    assert Slower.batch is None
    scan, odometry = corridor(1.0, 1.0), odometry_of(0.0)
    assert Slower(CAR, MU)(scan, odometry).speed == 0.5 * GapFinder(CAR, MU)(scan, odometry).speed


class Readable(GapFinder):
    """The gap finder as its file says it, in Python."""

    goal = staticmethod(GapFinder.goal)


@each("settings", [{}, {"method": "source"}, {"field_of_view": 1.0, "mean_radius": 0.3, "clearance": 0.0}])
def test_the_native_gap_finder_answers_as_its_file_says(settings):
    generator = np.random.default_rng(4)
    native = GapFinder(CAR, MU, 8.0, GapFinderSettings(**settings))
    readable = Readable(CAR, MU, 8.0, GapFinderSettings(**settings))
    assert isinstance(GapFinder.refer, NativeStep) and not isinstance(Readable.refer, NativeStep)
    for beams in (2, 3, 100, 1081):
        for odd in (0.0, 0.3):
            ranges = rough_scan(7).ranges if beams > 100 else generator.uniform(0.0, 9.0, beams)
            ranges = np.where(generator.random(beams) < odd, generator.choice([0.0, math.inf, math.nan], beams), ranges)
            scan, odometry = scan_of(ranges), odometry_of(float(generator.uniform(0.0, 5.0)))
            assert native.find_goal(scan) == readable.find_goal(scan)
            expected = readable.intermediate_scans(scan)
            found = native.intermediate_scans(scan)
            assert list(found) == list(expected)
            assert all(found[name].tobytes() == expected[name].tobytes() for name in found)
            assert native(scan, odometry) == readable(scan, odometry)


@dataclass(frozen=True, kw_only=True)
class LongerSettings(GapFinderSettings):
    """One more."""

    pace: float = 1.0


def test_a_planner_with_other_settings_refers_by_the_function_that_it_derives():
    class Longer(GapFinder):
        Settings = LongerSettings

    assert not isinstance(Longer.refer, NativeStep)
    assert Longer(CAR, MU)(corridor(1.0, 1.3), odometry_of(2.0)) == finder()(corridor(1.0, 1.3), odometry_of(2.0))
