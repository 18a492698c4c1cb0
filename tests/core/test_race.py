"""A race ends for one of six reasons, tells the planner nothing but what a car senses, and keeps the whole story."""

import hashlib
import importlib
import math
import signal

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from conftest import Straight
from fg_mujoco.racing.planners import make_controller
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.telemetry import add_row, end_row
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED, slides_above
from fg_mujoco.vehicle.vehicle import Vehicle

race_module = importlib.import_module("fg_mujoco.racing.race")  # fg_mujoco.racing.race is the function
TICK = 0.025


class Recorder:
    """Does what a function of the time says, and keeps what it was told and what it answered."""

    def __init__(self, law):
        self.law = law
        self.resets = 0
        self.heard, self.said = [], []

    def reset(self):
        self.resets += 1
        assert not self.heard

    def __call__(self, *arguments):
        steering, speed = self.law(arguments[1].stamp)
        self.heard.append(arguments)
        self.said.append(fg.DriveCommand(steering_angle=steering, speed=speed))
        return self.said[-1]


def race(law, track="oval", **settings):
    return fg.race(track, Recorder(law), **({"laps": 1} | settings))


def circle(radius):
    """A round track, driven counterclockwise."""
    angles = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    line = radius * np.column_stack((np.cos(angles), np.sin(angles)))
    return fg.Track(name="circle", centreline=line, width_right=np.full(200, 1.0), width_left=np.full(200, 1.0))


def assert_complete(result):
    """What holds for every race, however it ended."""
    ticks = len(result.car.telemetry)
    assert len(result.states) == ticks + 1 == len(result.ctrl) + 1
    assert result.states[:, 0] == pytest.approx(TICK * np.arange(ticks + 1), abs=1e-9)  # mjSTATE_TIME comes first
    assert result.car.column("time_s") == pytest.approx(result.states[:-1, 0])
    assert result.car.finished == (result.car.end_reason == "finished")
    assert result.car.laps_completed == len(result.car.lap_times_s) <= result.laps_requested


def test_finished_when_the_laps_are_done(lap):
    assert_complete(lap)
    car = lap.car
    assert (car.end_reason, car.finished, car.laps_completed, car.collisions_wall) == ("finished", True, 1, 0)
    assert lap.sim_time_s - TICK <= lap.car.lap_times_s[0] <= lap.sim_time_s
    assert lap.car.column("progress_m")[-1] < lap.world.track.length


def test_crash_when_the_car_drives_straight_on():
    result = race(lambda time: (0.0, 3.0))
    assert_complete(result)
    assert (result.car.end_reason, result.car.finished, result.car.collisions_wall) == ("crash", False, 1)
    x, y = result.car.column("x_m")[-1], result.car.column("y_m")[-1]
    car = result.world.parameters
    wall = np.vstack((result.world.track.left_wall, result.world.track.right_wall))
    # no nearer than half a width, no farther than the front corners and a tick's way
    assert 0.15 < np.hypot(*(wall - (x, y)).T).min() < math.hypot(car.length, car.width) + 3.0 * TICK


def test_no_progress_when_the_car_stands_for_ten_seconds():
    result = race(lambda time: (0.1, 0.0))
    assert_complete(result)
    assert result.car.end_reason == "no_progress" and result.sim_time_s == pytest.approx(10.0)


@each(("limit", "ticks"), ((1.0, 40), (0.99, 40), (0.025, 1), (1.01, 40), (1.02, 41)))
def test_time_limit_to_the_nearest_tick(limit, ticks):
    result = race(lambda time: (0.0, 1.0), time_limit=limit)
    assert_complete(result)
    assert result.car.end_reason == "time_limit" and len(result.ctrl) == ticks
    assert result.sim_time_s == pytest.approx(ticks * TICK)


def test_time_limit_is_what_a_car_of_half_a_metre_a_second_needs():
    track = circle(2.0)
    result = race(lambda time: (math.atan(0.3302 / 2.0), 0.4), track)
    assert result.car.end_reason == "time_limit" and result.car.collisions_wall == 0
    assert result.sim_time_s == pytest.approx(track.length / 0.5, abs=TICK)
    assert race(lambda time: (math.atan(0.3302 / 2.0), 0.6), track).car.end_reason == "finished"


def test_unstable_when_mujoco_meets_a_bad_state(monkeypatch):
    steps = iter(range(1000))

    class Poisoned(Engine):
        def drive(self, **settings):
            if next(steps) == 5:
                self.qpos(0)[0] = math.nan
            super().drive(**settings)

    monkeypatch.setattr(race_module, "Engine", Poisoned)
    result = race(lambda time: (0.0, 1.0), time_limit=1.0)
    assert len(result.ctrl) == 6
    assert (result.car.end_reason, result.car.finished) == ("unstable", False)


@each("place", ("watch", "controller", "engine"))
def test_interrupted_keeps_the_ticks_that_are_complete(monkeypatch, place):
    def interrupt_after(count):
        calls = iter(range(count))

        def call(*_):
            if next(calls, None) is None:
                signal.raise_signal(signal.SIGINT)  # Ctrl-C

        return call

    after, watch, law = interrupt_after(7), None, lambda time: (0.0, 1.0)
    if place == "watch":
        watch = after
        monkeypatch.setattr(race_module, "_WATCHED_EVERY", 0.0)  # after each tick
    elif place == "controller":
        law = lambda time: after() or (0.0, 1.0)  # noqa: E731
    else:
        drive = Engine.drive
        monkeypatch.setattr(Engine, "drive", lambda self: after() or drive(self))
    result = race(law, watch=watch)
    assert_complete(result)
    assert (result.car.end_reason, result.car.finished, result.car.collisions_wall) == ("interrupted", False, 0)
    assert len(result.ctrl) == (8 if place == "watch" else 7)
    monkeypatch.undo()
    whole = race(lambda time: (0.0, 1.0), time_limit=0.2)
    assert np.array_equal(result.states, whole.states[: len(result.states)])


# What a race is run with


def test_mu_of_the_tires_and_of_the_planner_are_apart():
    slippery = fg.race("oval", laps=1, mu=0.5, planner_mu=1.0489, time_limit=6.0)
    cautious = fg.race("oval", laps=1, planner_mu=0.5, time_limit=6.0)
    assert slippery.car.max_slide_m_s > SLIDING_SPEED > cautious.car.max_slide_m_s


# What the planner is told


def test_the_planner_hears_the_scan_and_the_odometry_and_nothing_else():
    planner = Recorder(lambda time: (0.0, 1.0))
    fg.race("oval", planner, laps=1, time_limit=0.5)
    assert planner.resets == 1 and len(planner.heard) == 20
    for tick, (scan, odometry) in enumerate(planner.heard):
        assert type(scan) is fg.LaserScan and type(odometry) is fg.Odometry
        assert scan.stamp == odometry.stamp == pytest.approx(tick * TICK)
        assert scan.ranges.shape == (1081,) and not scan.ranges.flags.writeable
    known = {"stamp", "speed", "steering_angle", "angular_velocity", "linear_acceleration", "wheel_speeds", "pose"}
    assert set(vars(odometry)) == known | {"readings"} and odometry.readings == {}


# What it leaves


def test_reversing_takes_back_what_was_driven():
    """A lap that is 3 m longer there and back takes as much longer, on a circle at a steady speed."""
    track, steering, speed = circle(2.0), math.atan(0.3302 / 2.0), 1.0

    def law(time):
        return steering, -speed if 4.0 <= time < 7.0 else speed

    straight_on, there_and_back = race(lambda time: (steering, speed), track), race(law, track)
    assert straight_on.car.finished and there_and_back.car.finished
    gained = there_and_back.car.lap_times_s[0] - straight_on.car.lap_times_s[0]
    assert gained == pytest.approx(6.0, abs=0.1)


def test_the_first_lap_starts_from_a_stand():
    result = fg.race("oval", laps=2)
    assert result.car.column("speed_m_s")[0] == pytest.approx(0.0, abs=1e-9)
    assert result.car.column("progress_m")[0] == 0.0
    assert result.car.lap_times_s[0] > result.car.lap_times_s[1] + 0.3
    laps = result.car.column("lap")
    assert set(laps) == {1.0, 2.0}
    seen = result.car.column("time_s")[np.argmax(laps == 2.0)]  # the first tick that starts beyond the line
    assert seen - TICK <= result.car.lap_times_s[0] <= seen
    assert sum(result.car.lap_times_s) == pytest.approx(result.sim_time_s, abs=TICK)


def test_speed_agrees_with_the_places(lap):
    x, y, heading = (lap.car.column(name) for name in ("x_m", "y_m", "heading_rad"))
    middle = np.unwrap(heading)[:-1] + 0.5 * np.diff(np.unwrap(heading))
    ahead = np.diff(x) * np.cos(middle) + np.diff(y) * np.sin(middle)
    speed = lap.car.column("speed_m_s")
    assert ahead / TICK == pytest.approx(0.5 * (speed[:-1] + speed[1:]), abs=0.03)
    assert lap.car.max_speed_m_s == speed.max() > 5.0
    assert lap.car.mean_speed_m_s == pytest.approx(np.hypot(np.diff(x), np.diff(y)).sum() / TICK / len(x), rel=0.01)


def test_progress_and_offset_agree_with_the_places(lap):
    track = lap.world.track
    places = track.position(lap.car.column("progress_m"), lap.car.column("offset_m"))
    assert np.hypot(places[:, 0] - lap.car.column("x_m"), places[:, 1] - lap.car.column("y_m")).max() < 0.02
    assert (np.diff(lap.car.column("progress_m"))[1:] > -1e-6).all()


def test_yaw_rate_agrees_with_the_heading_and_the_steering_with_the_command(lap):
    rate = np.diff(np.unwrap(lap.car.column("heading_rad"))) / TICK
    told = lap.car.column("yaw_rate_rad_s")
    assert rate == pytest.approx(0.5 * (told[:-1] + told[1:]), abs=0.12)
    assert np.abs(rate).max() > 1.0
    # the servo reaches the command of a tick by the next, but for its lag
    steering, command = (lap.car.column(f"{name}_rad") for name in ("steering_angle", "command_steering"))
    assert steering[1:] == pytest.approx(command[:-1], abs=0.03)


def test_rows_hold_what_the_planner_heard_and_said_and_what_the_actuators_got():
    planner = Recorder(lambda time: (0.6 * math.sin(9.0 * time), 1.5))
    result = fg.race("oval", planner, laps=1, time_limit=1.0)
    car = result.car
    assert car.column("command_steering_rad").tolist() == [command.steering_angle for command in planner.said]
    assert car.column("command_speed_m_s").tolist() == [command.speed for command in planner.said]
    assert car.column("yaw_rate_rad_s").tolist() == [odometry.yaw_rate for _, odometry in planner.heard]
    assert car.column("steering_angle_rad").tolist() == [odometry.steering_angle for _, odometry in planner.heard]
    assert np.abs(car.column("command_steering_rad")).max() > 0.5
    assert result.ctrl[:, 0] == pytest.approx(np.clip(car.column("command_steering_rad"), -0.4189, 0.4189))
    assert result.ctrl[:, 1].tolist() == [1.5] * 40


def test_the_figures_of_sliding_are_those_of_the_rows():
    result = fg.race("oval", laps=1, tires="coulomb", planner_mu=1.6, time_limit=6.0)
    slides = np.column_stack([result.car.column(f"slide_{wheel}_m_s") for wheel in WHEELS])
    sliding = result.car.column("sliding_steps")
    assert result.car.max_slide_m_s == np.nanmax(slides) > SLIDING_SPEED
    assert result.car.tires_model == "coulomb"
    assert np.array_equal(sliding > 0, np.fmax.reduce(slides, axis=1) > slides_above("coulomb"))
    steps = round(TICK / result.world.model.opt.timestep)
    assert set(result.car.column("steps")) == {steps} and sliding.max() <= steps
    assert result.car.slide_time_fraction == pytest.approx(sliding.sum() / (steps * len(sliding)))
    assert 0.0 < result.car.slide_time_fraction < 1.0
    uses = np.column_stack([result.car.column(f"friction_utilisation_{wheel}") for wheel in WHEELS])
    assert np.nanmax(uses) == pytest.approx(1.0, abs=1e-3)


MOTION = ("vx_m_s", "vy_m_s", "sideslip_rad", "ax_m_s2", "ay_m_s2")


@pytest.mark.slow
def test_a_tire_in_the_air_leaves_nan_and_never_zero(short_race):
    engine = Engine(short_race.world)
    engine.place([fg.Start()])
    engine.qpos(0)[2] += 0.2  # of base_link's free joint
    engine.sense()
    engine.drive()
    so_far = engine.statistics[0]
    assert so_far["max_slide"] == 0.0 == so_far["sliding_steps"]
    first, steps = fg.TELEMETRY.index("slide_front_left_m_s"), fg.TELEMETRY.index("steps")
    of_tires = [i for i in range(first, len(fg.TELEMETRY)) if fg.TELEMETRY[i] not in MOTION]
    assert engine.telemetry[0, steps - 1 : steps + 1].tolist() == [0.0, 5.0]
    assert np.isnan(np.delete(engine.telemetry[0, of_tires], [8, 9])).all()

    half = np.array([[math.nan, 0.3, 0.1, math.nan], [math.nan, math.nan, 0.2, 0.01]])
    row = engine.telemetry[0]
    slip = np.stack((half, 2 * half, half, half, 0.5 * half, *4 * [half], half > 0.05))
    end_row(row, slip)
    add_row(engine.statistics, 0, row, slip)
    expected = [math.nan, 0.3, 0.2, 0.01, math.nan, 0.6, 0.4, 0.02, 2.0, 2.0]
    assert row[first : first + 10] == pytest.approx(expected, nan_ok=True)
    so_far = engine.statistics[0]
    assert (so_far["max_slide"], so_far["sliding_steps"], so_far["steps"]) == (0.3, 2, 7)
    assert so_far["max_lateral_slide"] == 0.15


def test_the_motion_columns_are_those_of_the_recorded_states(lap):
    """The states' velocities, turned into the car's axes here; the acceleration is their difference."""
    data, model = mujoco.MjData(lap.world.model), lap.world.model
    base = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "car/base_link")
    velocities, axes = [], []
    lever = lap.world.parameters.rear_axle_distance
    for state in lap.states:
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_forward(model, data)
        ahead = data.xmat[base].reshape(3, 3)[:2, 0] / np.linalg.norm(data.xmat[base].reshape(3, 3)[:2, 0])
        found = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, base, found, 0)
        left = np.array([-ahead[1], ahead[0]])
        velocities.append((found[3:5], found[3:5] + lever * yaw_rate(data, base) * left))
        axes.append((ahead, left))
    velocities, axes = np.array(velocities), np.array(axes)
    rear, gravity_centre = np.einsum("tad,tpd->pta", axes, velocities)
    assert lap.car.column("vx_m_s") == pytest.approx(rear[:-1, 0], abs=1e-9)
    assert lap.car.column("vy_m_s") == pytest.approx(rear[:-1, 1], abs=1e-9)
    assert np.array_equal(lap.car.column("vx_m_s"), lap.car.column("speed_m_s"))
    moves = np.hypot(*gravity_centre[:-1].T) >= 0.1
    assert moves.sum() > 300 and not moves[0]
    sideslip = np.arctan2(gravity_centre[:-1, 1], gravity_centre[:-1, 0])
    assert lap.car.column("sideslip_rad")[moves] == pytest.approx(sideslip[moves], abs=1e-9)
    assert np.isnan(lap.car.column("sideslip_rad")[~moves]).all() and np.abs(sideslip[moves]).max() > 0.01

    change = np.diff(velocities[:, 1], axis=0) / np.diff(lap.states[:, 0])[:, None]
    half_way = axes[1:, 0] + axes[:-1, 0]
    half_way /= np.linalg.norm(half_way, axis=1)[:, None]
    assert lap.car.column("ax_m_s2") == pytest.approx(np.sum(change * half_way, axis=1), abs=1e-6)
    left = np.column_stack((-half_way[:, 1], half_way[:, 0]))
    assert lap.car.column("ay_m_s2") == pytest.approx(np.sum(change * left, axis=1), abs=1e-6)


def yaw_rate(data, base):
    """Return the rate of turn about the car's own z axis [rad/s], as its gyro has it."""
    found = np.zeros(6)
    mujoco.mj_objectVelocity(data.model, data, mujoco.mjtObj.mjOBJ_XBODY, base, found, 1)
    return found[2]


def test_the_hash_is_of_every_bit_of_states_and_controls(short_race):
    digest = hashlib.sha256(short_race.states.tobytes() + short_race.ctrl.tobytes()).hexdigest()
    assert short_race.trajectory_sha256 == digest
    again = fg.race("oval", Straight(), laps=1, time_limit=0.99)
    assert again.trajectory_sha256 == digest
    assert fg.race("oval", Straight(0.3), laps=1, time_limit=0.99).trajectory_sha256 != digest


def test_a_result_has_the_steps_of_the_last_decision_as_the_planner_tells_them():
    planner = make_controller("gap_finder", car=Vehicle.load().parameters, mu=1.0489, max_speed=8.0)
    given = fg.race("oval", planner, laps=1, time_limit=0.5).car
    told = [(reason.name, reason.speed, reason.text) for reason in planner.reasons()]
    assert [(step.name, step.speed_m_s, step.text) for step in given.last_decision] == told
    named = fg.race("oval", "gap_finder", laps=1, time_limit=0.5)  # it is given arrays
    assert {"planner", "proposal: reference", "friction limiter"} <= {step.name for step in named.car.last_decision}
    assert named.summary()["cars"][0]["last_decision"][0]["steering_angle_rad"] is None


@each(("told", "steps"), [([("own", 0.1, 2.0)], 1), ([("own", 0.1)], 0), (RuntimeError("no"), 0)])
def test_a_planner_that_tells_nothing_or_in_another_form_has_no_steps(told, steps):
    class Telling(Recorder):
        def reasons(self):
            if isinstance(told, Exception):
                raise told
            return told

    car = fg.race("oval", Telling(lambda t: (0.0, 1.0)), laps=1, time_limit=0.1).car
    assert [tuple(step) for step in car.last_decision] == [("own", 0.1, 2.0, "")] * steps
