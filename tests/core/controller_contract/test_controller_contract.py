"""What every bundled planner keeps, an add-on's too, whatever it is shown. A new one is covered by its entry.

The contract: for any scan and any odometry a finite DriveCommand, without an exception;
- its steering angle within the car's limit, or no further than the wheels are turned already;
- its speed such that the car, whose speed servo approaches the command over `speed_time_constant`, has after one
  period a speed from 0 to the top speed. The command itself may lead by what an acceleration takes;
- back only over ground that it came by, or that guidance has seen, when it has stood there without a way, slowly and
  not for ever;
- STOP where there is nothing to plan with. Same inputs since `reset()`: same outputs. No planner changes a scan;
- all that for scans drawn at random, 2,000 of them and 40,000 in `make fuzz`, with a pose on a map and without;
- where its class offers `batch`, the planners of a batch decide as each does alone, to the last bit.
"""

import dataclasses
import functools
import math
import time
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cases import each
from fg_mujoco.controllers import BASELINES
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import STOP, DriveCommand, MapLine, PlannerContext, ScanGeometry
from fg_mujoco.racing.planners import ControllerChoice, controller_names, make_controller
from scan_worlds import CAR, INCREMENT, MU, corridor, odometry_of, rows_of, scan_of

RAW = ("disparity_extender", "disparity_selection", "follow_the_gap", "gap_finder", "widest_gap")
NAMES = (*controller_names(), *(f"{name}[method=source]" for name in RAW), *BASELINES)
TOP_SPEED = 6.0
TURNS = np.linspace(0.0, 2.0 * math.pi, 100, endpoint=False)
OVAL = MapLine(points=np.column_stack((10.0 * np.cos(TURNS), 4.0 * np.sin(TURNS))), closed=True)
GENTLE = np.random.default_rng(5).uniform(0.5, 9.0, 1081)
EMPTY_SECTOR = corridor(1.0, 1.0, 5.0).ranges.copy()
EMPTY_SECTOR[300:700] = math.inf

BLIND = {
    "no beam": scan_of([]), "one beam": scan_of([5.0]), "one beam without return": scan_of([math.inf]),
    "all NaN": scan_of(np.full(1081, math.nan)), "all -inf": scan_of(np.full(1081, -math.inf)),
    "all zeros": scan_of(np.zeros(1081)), "all negative": scan_of(np.full(1081, -3.0)),
    "nothing in front": scan_of(GENTLE[:100], angle_min=2.5), "no angle between beams": scan_of(GENTLE, increment=0.0),
    "range_max of 0": scan_of(GENTLE, range_max=0.0),
}  # fmt: skip
ODD = {
    **BLIND,
    "two beams": scan_of([5.0, 6.0]),
    "two beams far apart": scan_of([5.0, 6.0], increment=1.5),
    "three beams": scan_of([5.0, 6.0, 5.0], increment=0.7),
    "all inf": scan_of(np.full(1081, math.inf)),
    "all equal": scan_of(np.full(1081, 4.0)),
    "all at range_max": scan_of(np.full(1081, 30.0)),
    "a ramp": scan_of(np.linspace(0.1, 20.0, 1081)),
    "noise": scan_of(GENTLE),
    "an empty sector": scan_of(EMPTY_SECTOR),
    "NaN in every other beam": scan_of(np.where(np.arange(1081) % 2, math.nan, GENTLE)),
    "NaN on one side": scan_of(np.where(np.arange(1081) < 540, math.nan, GENTLE)),
    "huge": scan_of(GENTLE * 1e300),
    "huge, and as huge a range_max": scan_of(GENTLE * 1e300, range_max=1e308),
    "tiny": scan_of(GENTLE * 1e-300),
    "negative on one side": scan_of(np.where(np.arange(1081) < 540, -GENTLE, GENTLE)),
    "increment of 1e-6": scan_of(GENTLE, increment=1e-6),
    "increment of 1e-19": scan_of(GENTLE, increment=1e-19),
    "least increment there is": scan_of(GENTLE, increment=5e-324),
    "increment of more than a turn": scan_of(GENTLE, increment=10.0),
    "negative increment": scan_of(GENTLE, increment=-INCREMENT),
    "negative range_max": scan_of(GENTLE, range_max=-1.0),
    "no scan time": scan_of(GENTLE, scan_time=0.0),
    "many beams": scan_of(np.tile(GENTLE, 4), increment=INCREMENT / 4),
}
MOTIONS = [(0.0, 0.0), (3.0, 0.1), (6.0, -0.4189), (2.0, 0.43), (9.0, 0.0), (-1.0, 0.0), (1e9, 0.1)]


POCKET = scan_of(np.full(1081, 0.25))  # no way on


def made(name, mu=MU, max_speed=TOP_SPEED, car=CAR):
    choice = ControllerChoice.of(name)
    return make_controller(
        choice.source, settings=dict(choice.settings), car=car, mu=mu, max_speed=max_speed, map_line=OVAL
    )


every_planner = each("planner", NAMES, made=functools.cache(made))  # one of each, which the tests reset


def assert_keeps_contract(command, odometry, scan):
    assert type(command) is DriveCommand
    steering_angle, speed = command.steering_angle, command.speed
    assert math.isfinite(steering_angle) and math.isfinite(speed)
    assert abs(steering_angle) <= max(CAR.max_steering_angle, abs(odometry.steering_angle)) + 1e-12
    if 0.0 <= odometry.speed <= TOP_SPEED:
        approach = 1.0 - math.exp(-scan.scan_time / CAR.speed_time_constant)
        reached = odometry.speed + approach * (speed - odometry.speed)
        assert -1e-9 <= reached <= TOP_SPEED + 1e-9
    lead = CAR.max_acceleration * CAR.speed_time_constant
    lowest, highest = min(0.0, odometry.speed) - lead, max(TOP_SPEED, odometry.speed) + lead
    assert lowest <= speed <= highest


@every_planner
@each("scan", ODD, made=ODD.get)
def test_it_answers_a_command_that_the_car_can_follow(planner, scan):
    before = scan.ranges.copy()
    for motion in MOTIONS:
        odometry = odometry_of(*motion)
        planner.reset()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for _ in range(3):
                assert_keeps_contract(planner(scan, odometry), odometry, scan)
    np.testing.assert_array_equal(scan.ranges, before)


@pytest.mark.slow
@every_planner
@each("came", [0.0, 6.0])
def test_it_goes_back_only_over_ground_that_it_came_by(planner, came):
    """Of 2 m/s to a pocket, or put there; the wheels follow the commands.

    Guidance is off: it turns on ground that it has seen, and the pocket here does not move with the car.
    """
    if "guidance" in planner.stages:
        planner = type(planner)(CAR, MU, TOP_SPEED, planner.settings, assist="safe")
    planner.reset()
    for _ in range(round(came / (2.0 * 0.025))):
        planner(corridor(1.0, 1.0, 20.0), odometry_of(2.0, 0.0))
    speed, way = 0.0, [0.0]
    for _ in range(600):  # it stands after some 360
        command = planner(POCKET, odometry_of(speed, 0.0))
        speed += (command.speed - speed) * (1.0 - math.exp(-0.025 / CAR.speed_time_constant))
        way.append(way[-1] + 0.025 * speed)
        assert -1.51 < speed < 0.01
    assert -came - 1e-9 <= way[-1] and way[-1] == pytest.approx(way[-200], abs=1e-3)
    planner.reset()


@every_planner
@each("name", BLIND)
def test_it_stops_where_it_cannot_plan(planner, name):
    """At rest that is STOP; a moving car is brought to rest, as fast as the planner thinks the tires hold."""
    if type(planner).__module__.endswith(".baselines"):
        pytest.skip("it looks at nothing")
    for speed, steering_angle in MOTIONS:
        planner.reset()
        brakes = abs(speed) < 20.0  # a car of 1e9 m/s does not come to rest
        for _ in range(200 if brakes else 1):
            command = planner(BLIND[name], odometry_of(speed, steering_angle))
            assert abs(command.steering_angle) <= abs(steering_angle)
            before, steering_angle = abs(speed), command.steering_angle
            speed += (command.speed - speed) * (1.0 - math.exp(-0.025 / CAR.speed_time_constant))
            assert abs(speed) <= before
            if abs(speed) < 1e-6:
                break
        assert abs(speed) < 1e-2 or not brakes
    planner.reset()
    assert planner(BLIND[name], odometry_of(0.0, 0.0)) == STOP


# -- scans drawn at random, a family at a time: hypothesis draws what a family is like, and shrinks that

SCANS_IN_A_FAMILY = 40
REPEATED = 5  # of them after a reset: what a planner keeps over it shows in the first ones
SHARE = st.just(0.0) | st.floats(0.0, 1.0)
FAMILY = {
    "seed": st.integers(0, 2**32 - 1),
    "count": st.integers(0, 60) | st.integers(0, 4000) | st.sampled_from([720, 1080, 1081]),
    "shape": st.sampled_from(["room", "noise", "steps", "wall"]),
    "size": st.floats(0.05, 60.0) | st.sampled_from([1e-300, 1e300]),  # [m]
    "spikes": SHARE,
    "odd": st.dictionaries(st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -1.0]), SHARE),
    "increment": st.floats(1e-3, 0.02) | st.floats(1e-4, 1.0),
    "angle_min": st.none() | st.floats(-4.0, 1.0),
    "range_max": st.sampled_from([30.0, 10.0, 3.0]),
    "has_pose": st.booleans(),
}


def family_of(*, seed, count, shape, size, spikes, odd, increment, angle_min, range_max, has_pose):
    """Pairs of a scan and an odometry; of the readings, up to `size`, some spike and some are odd values."""
    rng = np.random.default_rng(seed)
    for _ in range(SCANS_IN_A_FAMILY):
        ranges = size * shape_of(shape, count, rng)
        ranges[rng.random(count) < 0.1 * spikes] *= 20.0
        for value, share in odd.items():
            ranges[rng.random(count) < 0.3 * share * rng.random()] = value
        pose = rng.uniform((-12.0, -6.0, -7.0), (12.0, 6.0, 7.0)) if has_pose else np.full(3, math.nan)
        odometry = odometry_of(rng.uniform(0.0, TOP_SPEED), rng.uniform(-0.4189, 0.4189))
        yield scan_of(ranges, increment, angle_min, range_max), dataclasses.replace(odometry, pose=pose)


def shape_of(shape, count, rng):
    """Ranges of about 1 that are like a room, like nothing, like boxes, or like a wall. Shape (count,)."""
    if shape == "noise":
        return rng.random(count)
    places = np.arange(count) / max(count, 1)
    if shape == "room":
        return np.interp(places, np.linspace(0.0, 1.0, 24), rng.random(24))
    if shape == "steps":
        return rng.random(12)[(12.0 * places).astype(int)]
    return 0.1 / np.maximum(np.abs(np.sin(4.7 * places - rng.uniform(1.4, 3.4))), 0.01)


@pytest.mark.slow
def test_each_keeps_its_contract_on_thousands_of_scans():
    """Drawing the scans takes longer than deciding on them, so that they are drawn once for all planners."""
    planners = [made(name) for name in NAMES]
    judged = dict.fromkeys(planners, 0)

    @settings(suppress_health_check=list(HealthCheck))
    @given(**FAMILY)
    def keep_their_contract(**parameters):
        family = list(family_of(**parameters))
        before = [scan.ranges.tobytes() for scan, _ in family]
        for planner in planners:
            keeps_its_contract(planner, family)
            assert [scan.ranges.tobytes() for scan, _ in family] == before, planner
            judged[planner] += len(family)

    keep_their_contract()
    assert min(judged.values()) >= 2_000


def keeps_its_contract(planner, family):
    """Fail if a planner does not keep its contract on a family of scans, or decides otherwise after a reset."""
    planner.reset()
    commands = [planner(scan, odometry) for scan, odometry in family]
    for command, (scan, odometry) in zip(commands, family, strict=True):
        assert_keeps_contract(command, odometry, scan)
    planner.reset()
    begin = family[:REPEATED]
    assert [planner(scan, odometry) for scan, odometry in begin] == commands[:REPEATED]


def test_its_assist_is_that_of_its_context():
    context = PlannerContext(car=CAR, mu=MU, max_speed=TOP_SPEED, map_line=OVAL, assist="grip")
    for name in NAMES:
        assert make_controller(ControllerChoice.of(name).source, context).assist == "grip", name


def test_two_of_them_share_nothing():
    scans = [corridor(1.0, 1.0, ahead) for ahead in (3.0, 2.0, 6.0, 1.0)]
    for name in NAMES:
        alone, one, other = (made(name) for _ in range(3))
        for scan in scans:
            other(corridor(0.5, 3.0, 1.0), odometry_of(5.0, 0.2))
            assert one(scan, odometry_of(2.0)) == alone(scan, odometry_of(2.0))


def test_without_a_friction_limit_it_answers_too():
    for name in NAMES:
        unlimited = made(name, mu=math.inf)
        for scan in ODD.values():
            command = unlimited(scan, odometry_of(2.0))
            assert abs(command.steering_angle) <= CAR.max_steering_angle
            assert 0.0 <= command.speed <= TOP_SPEED


@each("name", NAMES)
def test_what_no_planner_can_believe_is_refused_by_name(name):
    kind, needed = type(made(name)), {"map_line": OVAL} if name == "pure_pursuit" else {}
    for what, values in {"mu": (0.0, -1.0, math.nan), "max_speed": (0.0, math.inf, math.nan), "settings": (3,)}.items():
        for value in values:
            with pytest.raises(SettingsError, match=f"{what} is {value!r}; accepted: "):
                kind(CAR, **{"mu": MU, what: value, **needed})


@each("size", [0.5, 1.2, 2.0])
def test_for_a_car_of_another_size_it_answers_too(size):
    lengths = ("wheelbase", "track_width", "length", "width", "rear_overhang", "lidar_offset", "front_axle_distance",
               "rear_axle_distance", "center_of_gravity_height")  # fmt: skip
    car = dataclasses.replace(CAR, **{name: size * getattr(CAR, name) for name in lengths})
    for name in NAMES:
        other = made(name, mu=0.8, car=car)
        for scan in ODD.values():
            for motion in ((0.0, 0.0), (3.0, 0.1)):
                assert_keeps_contract(other(scan, odometry_of(*motion)), odometry_of(*motion), scan)


@every_planner
def test_it_is_ready_long_before_the_next_scan(planner):
    for scan in ODD.values():
        durations = []
        for _ in range(5):  # the best of five, of this thread alone: the machine has other things to do
            started = time.thread_time()
            planner(scan, odometry_of(3.0, 0.1))
            durations.append(time.thread_time() - started)
        assert min(durations) < 0.05


# -- many worlds

BELIEFS = [(MU, TOP_SPEED), (0.5, TOP_SPEED), (math.inf, TOP_SPEED), (MU, 2.0), (MU, TOP_SPEED)]


def geometry_of(scan):
    names = [field.name for field in dataclasses.fields(ScanGeometry)]
    return ScanGeometry(**{name: getattr(scan, name) for name in names})


@functools.cache
def fleet_of(name):
    """Planners of one class, of different beliefs, and what makes a batch of them."""
    planners = [made(name, mu, most) for mu, most in BELIEFS]
    batch = getattr(type(planners[0]), "batch", None)
    if batch is None:
        pytest.skip(f"{name} offers no batch")
    return planners, batch


every_fleet = each("fleet", NAMES, made=fleet_of)


def assert_decides_as_its_planners_do(fleet, ticks):
    """Drive a batch through ticks of (scans of one geometry, odometries, who runs), each planner beside it."""
    planners, batch = fleet
    decide = batch(planners)
    for planner in planners:
        planner.reset()
    for scans, odometries, running in ticks:
        commands = np.full((len(planners), 2), math.nan)
        ranges, rows = np.array([scan.ranges for scan in scans]), rows_of(odometries)
        before = ranges.copy(), rows.copy()
        decide(geometry_of(scans[0]), ranges, rows, np.array(running), commands)
        np.testing.assert_array_equal(ranges, before[0])
        assert rows.tobytes() == before[1].tobytes()
        for planner, scan, odometry, runs, command in zip(planners, scans, odometries, running, commands, strict=True):
            if runs:
                alone = planner(scan, odometry)
                assert command.tolist() == [alone.steering_angle, alone.speed]
            else:
                assert np.isnan(command).all()


@functools.cache
def ticks_of(name):
    """Ticks of one of the odd scans, another turn of it in each world, and in each another motion; who runs differs."""
    scan, worlds = ODD[name], range(len(BELIEFS))
    return [
        (
            [dataclasses.replace(scan, ranges=np.roll(scan.ranges, 37 * (tick + world))) for world in worlds],
            [odometry_of(*MOTIONS[(tick + 2 * world) % len(MOTIONS)]) for world in worlds],
            [(tick + world) % 4 != 0 for world in worlds],
        )
        for tick in range(5)  # each world stands still in one, and runs afterwards
    ]


@every_fleet
@each("ticks", ODD, made=ticks_of)
def test_a_batch_decides_as_its_planners_do(fleet, ticks):
    assert_decides_as_its_planners_do(fleet, ticks)


@every_fleet
def test_a_batch_begins_anew_after_reset(fleet):
    planners, batch = fleet
    decide, scan = batch(planners), corridor(1.0, 1.0, 5.0)
    ranges, rows = np.tile(scan.ranges, (len(planners), 1)), rows_of([odometry_of(2.0)] * len(planners))
    first, later, again = np.zeros((3, len(planners), 2))
    for commands in (first, later):
        decide(geometry_of(scan), ranges, rows, np.ones(len(planners), bool), commands)
    decide.reset()
    decide(geometry_of(scan), ranges, rows, np.ones(len(planners), bool), again)
    np.testing.assert_array_equal(again, first)
