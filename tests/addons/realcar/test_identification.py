"""What identification finds in the drives of an independent single-track car, and what it refuses."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from browsers import opened
from cases import each

pytest.importorskip("scipy")

import single_track_drives as car
from bag_worlds import SECOND, robot_imu, robot_odometry, write_bag
from fg_mujoco.addons.realcar.drives.channels import Channel
from fg_mujoco.addons.realcar.identification.drive_log import Drive
from fg_mujoco.addons.realcar.identification.fit import fitted_starts
from fg_mujoco.addons.realcar.identification.identification import identify_drives
from fg_mujoco.addons.realcar.identification.problem import STEP, DriveProblem, assumed_noise
from fg_mujoco.addons.realcar.identification.smoothed_motion import smooth
from fg_mujoco.addons.realcar.identification.speed_response import speed_response
from fg_mujoco.addons.realcar.identification.steering_response import Steering
from fg_mujoco.addons.realcar.identification.tire_file import tire_text
from fg_mujoco.addons.realcar.identification.vehicle_file import write_vehicle
from fg_mujoco.addons.realcar.single_track import friction_curve
from fg_mujoco.addons.ros.bag_messages import drive_message
from fg_mujoco.cli.main import main
from fg_mujoco.racing.run_folder import write_run

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TIRES = car.random_set(1)
STEERING = {"lag": 0.12, "gain": 1.03, "offset": -0.01}
SLIPS = np.linspace(0.0, 0.6, 601)


@pytest.fixture(scope="module")
def exciting_drive():
    return car.recorded(car.exciting(1, TIRES, 40.0), TIRES, seed=1, **STEERING)


def gentle(seconds):
    time = np.arange(0.0, seconds, 0.025)
    fast = (time // 5.0) % 2 > 0  # at one speed, the steering's gain and the front stiffness would look the same
    steering = (0.021 * np.sin(2.5 * time) + 0.018 * np.sin(0.7 * time)) * np.where(fast, 1.0, 2.0)
    commands = time, steering, np.where(fast, 4.5, 2.2)
    return car.recorded(commands, TIRES, seed=2, **STEERING)


@pytest.fixture(scope="module")
def found(exciting_drive):
    return identify_drives([exciting_drive], single_track=True)


def stiffness(tire):
    return tire[0] * tire[1] * tire[2]


def test_the_axles_of_an_exciting_drive_are_found(found):
    for axle, tire in ((found.front, TIRES[0]), (found.rear, TIRES[1])):
        assert axle.stiffness.value == pytest.approx(stiffness(tire), rel=0.05)
        assert axle.peak.value == pytest.approx(car.magic_formula(SLIPS, tire).max(), rel=0.03)
        assert axle.D.value == pytest.approx(tire[2], rel=0.03)
        assert axle.B.value * axle.C.value * axle.D.value == pytest.approx(axle.stiffness.value)


def test_the_steering_of_an_exciting_drive_is_found(found):
    assert found.steering_lag.value + found.steering_delay.value == pytest.approx(STEERING["lag"], abs=0.01)
    assert found.steering_gain.value == pytest.approx(STEERING["gain"], abs=0.02)
    assert found.steering_offset.value == pytest.approx(STEERING["offset"], abs=0.002)


def test_the_intervals_cover_the_truth_and_are_no_wider_than_useful(found):
    truth = [(found.front.stiffness, stiffness(TIRES[0])), (found.rear.stiffness, stiffness(TIRES[1])),
             (found.front.D, TIRES[0][2]), (found.rear.D, TIRES[1][2]), (found.steering_gain, STEERING["gain"])]
    for estimate, value in truth:
        assert abs(estimate.value - value) <= 1.6 * estimate.half
        assert estimate.half <= 0.1 * value


def test_output_error_validates_better_than_inverse_dynamics(found):
    assert found.validation.yaw_rate_relative < 0.05
    assert found.validation.yaw_rate_relative < 0.7 * found.inverse_validation.yaw_rate_relative
    assert found.validation.seconds > 8.0


def lap_error(found, tires, steering):
    """Relative rms of the yaw rate of a lap that no drive had, simulated from its commands in one piece."""
    commands = car.lap()
    drive = car.recorded(commands, tires, noise=0.0, **steering)
    problem = DriveProblem(drive, single_track=True)
    problem.segments = np.array([[0, len(problem.motion.time)]])
    yaw_rate = problem.run(found.fit.parameters, problem.smoothed[:1])[:, 1]
    _, states, _ = car.solve(commands, tires, **steering)
    truth = np.interp(problem.motion.time, car.FINE * np.arange(states.shape[1]), states[5])
    return np.sqrt(np.mean((yaw_rate - truth) ** 2) / np.mean(truth**2))


def test_a_lap_that_was_not_driven_is_predicted(found):
    assert lap_error(found, TIRES, STEERING) < 0.03


def test_the_lateral_velocity_is_smoothed_from_poses_and_accelerations(exciting_drive):
    motion = smooth(exciting_drive)
    _, states, _ = car.solve(car.exciting(1, TIRES, 40.0), TIRES, **STEERING)
    time = car.FINE * np.arange(states.shape[1])
    inside = motion.forward_speed > 1.0
    for smoothed, state, bound in ((motion.lateral_speed, states[4], 0.03), (motion.forward_speed, states[3], 0.03),
                                   (motion.yaw_rate, states[5], 0.03), (motion.heading, states[2], 0.01)):  # fmt: skip
        error = (smoothed - np.interp(motion.time, time, state))[inside]
        assert np.sqrt(np.mean(error**2)) < bound


def test_the_model_drives_like_the_independent_one():
    commands = car.lap(10.0)
    drive = car.recorded(commands, TIRES, noise=0.0, lag=0.1)
    problem = DriveProblem(drive, single_track=True)
    problem.segments = np.array([[0, len(problem.motion.time)]])
    _, states, _ = car.solve(commands, TIRES, lag=0.1)
    time = car.FINE * np.arange(states.shape[1])
    motion = problem.motion
    problem.motion = replace(motion, forward_speed=np.interp(motion.time, time, states[3]))
    start = np.array([[*(np.interp(motion.time[0], time, states[row]) for row in (4, 5, 0, 1, 2))]])
    axles = [v for t in TIRES[:2] for v in (stiffness(t), *t[1:])]
    parameters = np.array([*axles, 1.0, 0.0, 0.1, 0, 0, 0, 0, 1.0, 0, 0, 1.0, 1.0])
    nodes = problem.run(parameters, start)
    yaw_rate, lateral = (np.interp(motion.time, time, states[row]) for row in (5, 4))
    assert np.abs(nodes[:, 1] - yaw_rate).max() < 0.01 * np.abs(yaw_rate).max()
    assert np.abs(nodes[:, 0] - lateral).max() < 0.01 * np.abs(lateral).max() + 0.002


def lateness(drive, result):
    """Lag and delay [s] of the first-order model that comes closest to the angle of a car's own steering servo."""
    time, angle = result.car.column("time_s"), result.car.column("steering_angle_rad")
    grid = np.arange(time[0], time[-1], 0.0025)
    steering = Steering(drive.steering, grid, limit=drive.car.max_steering_angle, rate=drive.car.max_steering_rate,
                        held=True)  # fmt: skip
    pairs = [(lag, delay) for lag in np.arange(0.008, 0.03, 0.001) for delay in np.arange(0.0, 0.0125, 0.00125)]
    return min(pairs, key=lambda late: np.sum((np.interp(time, grid, steering.angles(1.0, 0.0, *late)) - angle) ** 2))


def roll(parameters):
    """Roll angle over lateral acceleration [rad s^2/m] of our car, on its springs of 2000 N/m and its tires."""
    stiffness = 4.0 / (1.0 / 2000.0 + 1.0 / 11700.0) * (0.5 * parameters.track_width) ** 2
    return parameters.mass * parameters.center_of_gravity_height / stiffness


def two_track(what, folder):
    """A manoeuvre of the car in three dimensions, and a function that returns how far the model is off its yaw rate."""
    tires = fg.Tires.load("forzaeth_nuc6")
    result = fg.drive(what, tires=tires)
    drive = Drive.of_run(fg.read_run(write_run(result, folder)))
    curves = [axle.lateral for axle in tires.axles]
    axles = [value for curve in curves for value in (curve.slope, curve.C, curve.D, curve.E)]
    late, leans = lateness(drive, result), 1.0 + 9.81 * roll(drive.car)

    def error(*, single_track=False, less_inertia=0.0, gain=leans, **changes):
        """Relative, with the tires' own values and the servo's own lag and delay."""
        problem = DriveProblem(replace(drive, car=replace(drive.car, **changes)), single_track=single_track)
        problem.car[1] -= less_inertia
        relaxation_length = 0.0 if single_track else tires.front.relaxation_length
        parameters = np.array([*axles, 1.0, 0.0, *late, relaxation_length, 0, 0, gain, 0, 0, 1.0, 1.0])
        nodes = problem.run(parameters, fitted_starts(problem, parameters, assumed_noise()))[:, 1]
        inside = ~np.isnan(nodes)
        measured = problem.motion.yaw_rate[inside]
        return np.sqrt(np.mean((nodes[inside] - measured) ** 2) / np.mean(measured**2))

    return drive.car, error


def test_the_two_track_model_drives_like_the_car_in_three_dimensions(tmp_path):
    parameters, error = two_track("growing_slalom[speed=3,frequency=2]", tmp_path / "run")
    least = error()
    assert least < 0.02
    assert error(gain=1.0) > 1.2 * least  # of a car that does not roll
    assert error(single_track=True) > 0.06
    spin = 4.0 * parameters.wheel_inertia * (0.5 * parameters.track_width / parameters.wheel_radius) ** 2
    assert 0.05 < spin / parameters.yaw_inertia < 0.1
    assert error(less_inertia=spin) > 1.3 * least


def test_a_shaft_ties_the_axles_of_the_two_track_model_where_the_car_turns_tightly(tmp_path):
    car, error = two_track("growing_slalom[speed=2,frequency=0.5,angle=0.4]", tmp_path / "run")
    assert car.shaft and error() < 0.01 and error(shaft=False) > 0.02


def test_the_formula_is_the_published_one():
    b, c, d, e = tire = TIRES[0]
    curve = friction_curve(SLIPS, np.array((b * c * d, c, d, e)))
    assert curve == pytest.approx(car.magic_formula(SLIPS, tire), abs=1e-12)


def test_the_steering_follows_a_step_late_by_lag_and_delay():
    time = np.arange(0.0, 2.0, STEP)
    commands = Channel(name="commands", time=np.array((0.0, 0.5)), values=np.array(((0.0,), (0.1,))))
    steering = Steering(commands, time, limit=0.4, rate=100.0, held=True)
    angles = steering.angles(1.2, 0.02, 0.1, 0.05)
    expected = 0.02 + np.where(time < 0.55, 0.0, 0.12 * (1.0 - np.exp(-np.maximum(time - 0.55, 0.0) / 0.1)))
    assert angles == pytest.approx(expected, abs=1e-3)
    slow = Steering(commands, time, limit=0.4, rate=0.2, held=True).angles(1.0, 0.0, 0.0, 0.0)
    assert slow == pytest.approx(np.clip(0.2 * (time - 0.5), 0.0, 0.1), abs=1e-3 + 1e-9)


@each("delay", [0.0, 0.0013, 0.0025, 0.0041, 0.0172])
def test_the_steering_is_exact_wherever_a_command_falls_between_two_nodes(delay):
    """Against ten thousand small steps a second, at the greatest rate and below it."""
    time, lag, rate, fine = np.arange(0.0, 1.0, STEP), 0.014, 3.2, 1e-4
    ticks = np.arange(0.0, 1.0, 0.025)
    commands = Channel(name="commands", time=ticks, values=0.3 * np.sin(12.0 * ticks)[:, np.newaxis])
    angles = Steering(commands, time, limit=0.4, rate=rate, held=True).angles(1.0, 0.0, lag, delay)
    slow, angle = [], 0.0
    for moment in np.arange(0.0, 1.0, fine):
        slow.append(angle)
        last = max(int(np.floor((moment - delay) / 0.025 + 1e-9)), 0)
        angle += np.clip((commands.values[last, 0] - angle) / lag, -rate, rate) * fine
    assert angles == pytest.approx(np.interp(time, np.arange(0.0, 1.0, fine), slow), abs=1e-3)


def test_a_gentle_drive_tells_the_stiffness_and_which_drive_would_tell_the_peaks():
    partial = identify_drives([gentle(10.0)], single_track=True)
    assert {"front peak", "rear peak"} <= set(partial.untold)
    assert {"steering offset", "steering delay"} <= set(partial.told)
    said = partial.untold["front peak"]
    assert said.startswith("slip angles reach 0.0")
    assert "the peak needs about 0." in said
    assert "slaloms that grow" in said
    assert f"not told: front peak: {said}" in partial.summary()
    assert "# Not determined by the drives, usual values: front peak: " in tire_text(partial)
    found = identify_drives([gentle(20.0)], linear=True, single_track=True)
    for axle, tire in ((found.front, TIRES[0]), (found.rear, TIRES[1])):
        assert axle.stiffness.value == pytest.approx(stiffness(tire), rel=0.05)
    table = tomllib.loads(tire_text(found))
    assert table["model"] == "linear"
    assert table["rear"]["stiffness"] == pytest.approx(found.rear.stiffness.value, rel=1e-5)
    assert table["rear"]["D"] == 1.0


def test_the_tire_file_has_each_value_with_its_interval_and_source(found):
    text = tire_text(found)
    table = tomllib.loads(text)
    assert table["model"] == "magic_formula"
    for name, axle in (("front", found.front), ("rear", found.rear)):
        untold = {"sliding_share"} if axle.reached <= 2.0 * axle.peak_slip else set()
        assert set(table[name]) == untold | {"B", "C", "D", "E", "relaxation_length", "load_sensitivity",
                                             "nominal_load"}  # fmt: skip
        for letter in "BCDE":
            estimate = getattr(axle, letter)
            assert table[name][letter] == pytest.approx(estimate.value, rel=1e-5)
            assert f"+- {estimate.half:.2g}; drive 1 (sha256 000000000000)" in text


@pytest.fixture(scope="module")
def short_drive():
    return car.recorded(car.exciting(3, TIRES, 20.0), TIRES, seed=3, **STEERING)


@pytest.fixture(scope="module")
def bag(short_drive, tmp_path_factory):
    """The short drive as a robot records it: with the stamps of 2026, and a scan matcher's odometry."""
    pytest.importorskip("rosbags")
    return write_bag(tmp_path_factory.mktemp("bags") / "drive", entries_of(short_drive))


def entries_of(drive):
    def stamped(channel):
        times = [1_790_000_000 * SECOND + round(time * 1e9) for time in channel.time]
        return zip(times, channel.values.tolist(), strict=True)

    entries = []
    for time, (angle,) in stamped(drive.steering):
        entries.append(("/drive", time, drive_message(fg.DriveCommand(steering_angle=angle, speed=0.0), time)))
    for (time, (turn,)), (ahead, left) in zip(stamped(drive.yaw_rate), drive.acceleration.values, strict=True):
        entries.append(("/imu", time, robot_imu(time, (0.0, 0.0, turn), (ahead, left, 9.81))))
    for (time, (x, y, yaw)), (speed,) in zip(stamped(drive.pose), drive.speed.values.tolist(), strict=True):
        entries.append(("/odom", time, robot_odometry(time, x=x, y=y, yaw=yaw, speed=speed)))
    return sorted(entries, key=lambda entry: entry[1])


def test_a_bag_has_the_channels_that_were_recorded(bag, short_drive):
    from fg_mujoco.addons.realcar.bag_drive import read_drives

    (drive,) = read_drives(bag, vehicle="nuc2")
    assert drive.vehicle == "nuc2"
    assert drive.commanded
    for name in ("steering", "speed", "yaw_rate", "acceleration", "pose"):
        read, told = getattr(drive, name), getattr(short_drive, name)
        assert read.time == pytest.approx(told.time, abs=2e-7)
        wrapped = np.remainder(read.values - told.values + np.pi, 2.0 * np.pi) - np.pi if name == "pose" else None
        assert (wrapped if name == "pose" else read.values - told.values) == pytest.approx(0.0, abs=1e-6)
    assert len(drive.sha256) == 64


def test_the_command_writes_tires_and_a_page_of_a_bag(bag, tmp_path, capsys, page_of):
    pytest.importorskip("bokeh")
    out, report = tmp_path / "tires.toml", tmp_path / "page.html"
    words = ["identify", str(bag), "--out", str(out), "--report", str(report), "--vehicle", "nuc2"]
    assert main([*words, "--single-track"]) == 0
    said = capsys.readouterr().out
    assert "front stiffness" in said
    assert tomllib.loads(out.read_text())["front"]["D"] == pytest.approx(TIRES[0][2], rel=0.3)
    with opened(page_of, report) as page:
        assert page.locator(".bk-Figure, .bk-Canvas").count() >= 3 or page.locator("canvas").count() >= 3
        assert page.locator("td", has_text="front stiffness B C D").count() == 1


def test_a_run_has_the_sensors_that_its_car_had(tmp_path):
    result = fg.race("oval", laps=1, time_limit=7.0, tires="coulomb")  # wheels that hardly slip tell the car's speed
    run = fg.read_run(write_run(result, tmp_path / "run"))
    drive = Drive.of_run(run)
    assert drive.vehicle == "f1tenth"
    assert drive.car == result.world.parameters
    assert drive.sha256 == run.summary["trajectory_sha256"]
    for channel, column, place in ((drive.yaw_rate, "yaw_rate_rad_s", 0), (drive.pose, "x_m", 0),
        (drive.pose, "y_m", 1), (drive.pose, "heading_rad", 2), (drive.steering, "command_steering_rad", 0)):
        assert channel.time == pytest.approx(run.column("time_s"))
        assert channel.values[:, place] == pytest.approx(run.column(column), abs=1e-9)
    forward = run.column("speed_m_s") > 1.0
    assert drive.speed.values[forward, 0] == pytest.approx(run.column("speed_m_s")[forward], abs=0.2)
    turning = (run.column("yaw_rate_rad_s") * run.column("speed_m_s"))[20:]
    assert np.corrcoef(drive.acceleration.values[20:, 1], turning)[0, 1] > 0.9


def test_a_drive_that_is_held_out_changes_no_parameter(exciting_drive):
    gentle_drive = gentle(10.0)
    options = {"linear": True, "single_track": True}
    whole = identify_drives([gentle_drive], hold_out=[exciting_drive], **options)
    turned = replace(exciting_drive, yaw_rate=replace(exciting_drive.yaw_rate, values=-exciting_drive.yaw_rate.values))
    other = identify_drives([gentle_drive], hold_out=[exciting_drive, gentle_drive], **options)
    assert np.array_equal(whole.fit.parameters, other.fit.parameters)
    assert [name for name, _ in other.of_each] == [exciting_drive.name, gentle_drive.name]
    assert whole.fit.seconds > 8.0  # nothing of the drive itself is held back
    with pytest.raises(fg.SettingsError, match="explains nothing of the yaw rate"):
        identify_drives([gentle_drive], hold_out=[turned], budget=1.0, **options)


@each("accelerations, brakes", [(False, True), (True, True), (True, False)])
def test_the_response_of_the_speed_is_found(accelerations, brakes, exciting_drive):
    """Against a speed that is integrated finely; the car goes straight, so nothing but the drive changes it."""
    time, late, step = np.arange(0.0, 60.0, 0.04), 0.08, 0.001
    rng = np.random.default_rng(4)
    wanted = np.repeat(rng.uniform(2.0, 5.0, len(time) // 25), 25)
    fine = np.arange(0.0, 60.0, step)
    speed, speeds, commands = 3.0, [], []
    for moment in time:
        row = int(moment / 0.04 + 0.5)
        # an acceleration is what a driver without a speed servo would command towards the wanted speed
        commands.append(1.5 * (wanted[row] - speed) + 0.8 if accelerations else wanted[row])
        for _ in range(round(0.04 / step)):
            speeds.append(speed)
            u = commands[max(row - round(late / 0.04), 0)]
            push = 1.2 * (u if brakes else max(u, 0.0)) - 0.2 * speed if accelerations else (1.05 * u - speed) / 0.3
            speed += step * (push - 0.03 * 9.81)
    speeds = np.array(speeds)[: len(fine)]

    def channel(name, at, values):
        return Channel(name=name, time=at, values=np.asarray(values, float).reshape(len(at), -1))

    x = np.cumsum(speeds) * step
    poses = np.column_stack((np.interp(time, fine, x), 0 * time, 0 * time))
    drive = replace(exciting_drive, steering=channel("commands", time, 0 * time),
        yaw_rate=channel("gyro", time, 0 * time), speed=channel("speed", time, np.interp(time, fine, speeds)),
        pose=channel("pose", time, poses), acceleration=None, speed_command=channel("speed commands", time, commands))
    problem = DriveProblem(drive)
    parameters = np.array([12, 1.5, 1, 0.5] * 2 + [1, 0, 0, 0, 0.045, 0, 0, 1, 0, 0, 1, 1], float)
    found = speed_response([problem], parameters)
    assert (found.accelerations, found.braking) == (accelerations, brakes)
    assert found.delay[0] == pytest.approx(late, abs=0.024)
    assert found.gain[0] == pytest.approx(1.2 if accelerations else 1.05, rel=0.05)
    if accelerations:
        assert found.drag[0] == pytest.approx(0.2, abs=0.05)
    else:
        assert found.time_constant[0] == pytest.approx(0.3, rel=0.15)
    silent = replace(drive, speed_command=None)
    assert speed_response([DriveProblem(silent)], parameters) == "no speed commands are recorded"


def test_the_identified_car_is_one_that_turns_its_wheels_as_it_was_found(found, tmp_path):
    base = fg.Vehicle.load("f1tenth")
    path = write_vehicle(found, base, tmp_path / "my_car.xml", tires="f1tenth_gym")
    car = fg.Vehicle.load(path)
    gain, offset = found.steering_gain.value, found.steering_offset.value
    response = car.command_response
    assert response.wheel_angle(0.2) == pytest.approx(0.2 * gain + offset, abs=1e-5)
    assert response.steering_lag == pytest.approx(max(found.steering_lag.value, 0.02), rel=0.01)
    commands = fg.Commands(time=np.array([0.0, 1.5]), steering_angle=np.array([0.2, 0.2]), speed=np.array([1.0, 1.0]))
    angle = fg.drive(commands, vehicle=car).car.column("steering_angle_rad")[-1]
    assert angle == pytest.approx(0.2, abs=1e-3)
    assert "Not determined by the drives, the vehicle's values: speed response." in car.text
    assert "<!-- " in car.text and car.parameters.mass == base.parameters.mass
    again = write_vehicle(found, car, tmp_path / "again.xml", tires="f1tenth_gym")  # a car that was identified before
    assert fg.drive(commands, vehicle=again).car.column("steering_angle_rad")[-1] == pytest.approx(angle, abs=1e-6)
    written = replace(base, text=base.spec().to_xml())  # as MuJoCo writes it
    path = write_vehicle(found, written, tmp_path / "third.xml", tires="f1tenth_gym")
    assert fg.drive(commands, vehicle=path).car.column("steering_angle_rad")[-1] == pytest.approx(angle, abs=1e-6)


def test_a_page_escapes_what_a_name_says(found, tmp_path):
    pytest.importorskip("bokeh")
    from fg_mujoco.addons.realcar.identification.identification_page import write_identification_report

    named = replace(found, drives=(replace(found.drives[0], name="<script>alert(1)</script>"),))
    page = write_identification_report(named, tmp_path / "page.html").read_text()
    assert "<script>alert(1)" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert "default-src 'none'" in page
