"""What a VESC tells: odometry by motor and commanded steering, the battery; and where and how an IMU measures."""

import math
from importlib.resources import files
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.vehicle.sensors.bundled import Imu
from fg_mujoco.vehicle.sensors.vesc import Electrics
from hand_planners import driven
from map_oracles import DATA
from refusals import refused

QUIET = {"sensor": "vesc", "speed_noise_std": 0.0}
ERPM = 4614.0  # of 1 m/s
BATTERY, RESISTANCE, KT = 12.6, 0.0102, ERPM / 2 / 3500.0  # [V], [ohm], [N/A]


def heard(law, seconds, **settings):
    """The odometry of each decision of a drive on open ground."""
    told = []

    def listening(odometry):
        told.append(odometry)
        return law(odometry) if callable(law) else law

    settings = {"assist": "none", "odometry": "vesc", "sensors": [QUIET]} | settings
    fg.race(f"open_ground:{seconds}", driven(listening), **settings)
    return told


def all_of(told, name):
    """The stamps and the values of all that a sensor delivered."""
    readings = [odometry.readings[name] for odometry in told]
    return np.concatenate([each.stamps for each in readings]), np.concatenate([each.samples for each in readings])


# -- odometry


def test_speed_is_the_motors_and_the_pose_is_integrated_of_the_commanded_steering():
    law = lambda odometry: (0.2 * math.sin(3.0 * odometry.stamp), 2.0)  # noqa: E731
    told = heard(law, 2, sensors=[QUIET, {"sensor": "odometry", "rate": 50}, "imu"])
    (stamps, found), (_, encoders) = all_of(told, "vesc"), all_of(told, "odometry")
    np.testing.assert_allclose(stamps, 0.02 * np.arange(len(stamps)), atol=1e-9)
    seen = np.where(np.abs(encoders[:, 0]) < 0.05, 0.0, np.round(ERPM * encoders[:, 0]) / ERPM)
    np.testing.assert_allclose(found[:, 0], seen, atol=1e-12)
    x = y = heading = 0.0
    for k, (speed, steering, yaw_rate, *pose) in enumerate(found[1:, :6], start=1):
        asked = 0.025 * (math.ceil(0.02 * k / 0.025 - 1e-9) - 1)  # [s] of the last decision before it
        assert steering == pytest.approx(law(SimpleNamespace(stamp=asked))[0], abs=1e-9)
        assert yaw_rate == pytest.approx(speed * math.tan(steering) / 0.3302, rel=1e-6)
        x, y = x + 0.02 * speed * math.cos(heading), y + 0.02 * speed * math.sin(heading)
        heading += 0.02 * yaw_rate
        assert pose == pytest.approx((x, y, heading), abs=1e-9)
    for odometry in told:
        last = odometry.readings["vesc"]
        assert -1e-9 < odometry.stamp - last.stamp < 0.02 - 1e-9
        assert (odometry.speed, odometry.steering_angle, odometry.yaw_rate) == tuple(last.values[:3])
    assert max(abs(each.yaw_rate - each.readings["imu"]["angular_velocity_z"]) for each in told[20:]) > 0.005


def test_wheels_that_lock_are_believed():
    told = heard(lambda odometry: (0.0, 0.0 if odometry.stamp > 0.2 else 5.0), 1, mu=0.4, start_speed=5.0)
    way = np.linalg.norm(np.diff([odometry.pose[:2] for odometry in told], axis=0), axis=1)
    assert min(odometry.speed - true for odometry, true in zip(told[1:], way / 0.025, strict=True)) < -1.0


def test_noise_is_that_of_the_settings_and_the_same_for_a_seed():
    runs = [all_of(heard((0.0, 0.0), 8, sensors=[], seed=seed), "vesc")[1] for seed in (1, 1, 2)]
    assert np.array_equal(runs[0], runs[1]) and not np.array_equal(runs[0], runs[2])
    told = runs[0][:, 6] / ERPM
    assert abs(told.std() / 0.1 - 1.0) < 4.0 / math.sqrt(2 * len(told))
    assert (runs[0][np.abs(told) < 0.05, 0] == 0.0).all()


@each("name", controller_names())
def test_every_planner_drives_by_it(name):
    result = fg.race("oval", name, laps=1, time_limit=1.5, odometry="vesc", start_speed=1.0)
    assert result.car.planner_failure is None and result.car.crash is None


@each("assist", ("full", "safe"))
@each("settings", [{}, {"sensors": [QUIET]}, {"vehicle": "ipz", "floor": "ipz8"}])
def test_hairpins_are_driven_by_it(assist, settings):
    """There the path keeps half of the commanded curvature."""
    car = fg.race("hairpins", laps=1, odometry="vesc", assist=assist, **settings).car
    assert car.laps_completed == 1 and car.collisions_wall == 0


def test_a_lap_by_it_replays(tmp_path):
    result = fg.race("oval", laps=1, odometry="vesc", seed=3)
    assert result.car.laps_completed == 1 and fg.replay(fg.write_run(result, tmp_path / "run", picture=False)).holds


# -- motor and battery


@each("speed", (-2.0, 0.0, 3.0, 7.0))
@each("force", (-30.0, 0.0, 4.0, 38.0))
def test_the_battery_gives_the_power_at_a_voltage_that_sags(speed, force):
    voltage, duty, current, drawn = Electrics.bundled().at(speed, force)
    sagged = BATTERY
    for _ in range(50):  # the voltage of the current of the power at the voltage
        sagged = BATTERY - RESISTANCE * force * speed / sagged
    assert voltage == pytest.approx(sagged) and drawn == pytest.approx(force * speed / sagged)
    assert current == pytest.approx(force / KT) and duty == pytest.approx(KT * speed / sagged)
    warm = Electrics(ERPM, 3500.0, 2.0, 0.02, BATTERY, RESISTANCE).at(speed, force)
    assert warm[0] * warm[3] == pytest.approx(force * speed + 0.02 * current**2)


def test_the_motors_current_is_that_of_the_force_that_speeds_the_car_up():
    told = heard(lambda odometry: (0.0, 0.2 + 2.0 * odometry.stamp), 2, tires="coulomb")
    last, means = told[-1].readings["vesc"], all_of(told, "vesc")[1][-50:].mean(axis=0)  # of the last second
    mass = 3.74 + (4 * 1.7e-4 + 3e-4) / 0.049**2  # [kg] with the spins of the wheels and the motor
    assert means[9] == pytest.approx(mass * 2.0 / KT, rel=0.03)
    assert last["temperature_degC"] == 25.0 and last["voltage"] == pytest.approx(12.6 - 0.0102 * last["input_current"])


def without(folder, old, new=""):
    """The default car's file with a part replaced."""
    path = folder / "own.xml"
    text = (files("fg_mujoco.models") / "f1tenth.xml").read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


@each(
    ("old", "new", "said"),
    [
        ('<numeric name="battery" data="12.6 0.0102"/>', "", "'battery' of a car with a VESC is missing; accepted"),
        ('data="4614 3500 2 0"', 'data="4614 -3500 2 0"', "'motor' of a car with a VESC is 4614 -3500 2 0; accepted"),
        ('<actuatorfrc name="drive_force" actuator="speed"/>', "", "sensor 'drive_force' of a car with a VESC is miss"),
    ],
)
def test_a_car_that_does_not_say_what_a_vesc_must_know_is_refused(old, new, said, tmp_path, capsys):
    path = without(tmp_path, old, new)
    assert said in refused(tmp_path, capsys, "race", "--laps", "1", "--odometry", "vesc", "--vehicle", str(path))
    with pytest.raises(fg.SettingsError, match=r"odometry is 'gps'; accepted: '' or 'vesc'"):
        fg.race("oval", odometry="gps")
    with pytest.raises(fg.SettingsError, match=r"sensor 'vesc' is a Imu; accepted: another name for it, or a Vesc"):
        fg.race("oval", odometry="vesc", sensors=[{"sensor": "imu", "name": "vesc"}])
    with pytest.raises(fg.SettingsError, match=r"speed_noise_std is -1.0; accepted: a number from 0"):
        fg.race("oval", sensors=[QUIET | {"speed_noise_std": -1.0}])


# -- the IMU


def test_an_imu_reads_where_it_is_mounted_and_as_it_is_turned(tmp_path):
    turns, ahead = (0.1, -0.2, 1.0), 0.1
    site = '<site name="imu" pos="{} 0 0.0253925"'
    path = without(tmp_path, site.format(0.17145), f'{site.format(0.27145)} euler="{" ".join(map(str, turns))}"')
    law = lambda odometry: (0.2 if odometry.stamp > 0.5 else 0.0, 2.0 if odometry.stamp > 0.5 else 0.0)  # noqa: E731
    runs = [heard(law, 4, sensors=["imu", QUIET], **car) for car in ({}, {"vehicle": path})]
    plain, mounted = (np.array([odometry.readings["imu"].values for odometry in told]) for told in runs)
    quaternion, turn = np.zeros(4), np.zeros(9)
    mujoco.mju_euler2Quat(quaternion, turns, "xyz")
    mujoco.mju_quat2Mat(turn, quaternion)
    turn = turn.reshape(3, 3)  # takes what is in the IMU's axes into the car's
    np.testing.assert_allclose(turn @ mounted[10, 3:], (0.0, 0.0, 9.81), atol=0.02)  # a level car at rest
    np.testing.assert_allclose(mounted[:, :3], plain[:, :3] @ turn, atol=1e-5)  # of six digits
    level = plain[-1, 3:] - (ahead * plain[-1, 2] ** 2, 0.0, 0.0)  # it goes round a larger circle
    np.testing.assert_allclose(turn @ mounted[-1, 3:], level, atol=2e-3)


def test_bias_stays_for_a_run_and_vibration_grows_with_the_wheels_speed(monkeypatch):
    monkeypatch.setattr(Imu, "measure", lambda self, car: np.zeros(6))
    imu = Imu(bias_std=(0.1, 0.1, 0.1, 1.0, 1.0, 1.0), vibration=[0.003] * 6)

    def sampled(seed, speed, count):
        car = SimpleNamespace(time=0.0, odometry={"wheel_speeds": np.full(4, -speed)})
        measure = imu.begin(car, np.random.default_rng(seed))
        return np.array([measure(car) for _ in range(count)])

    biases = np.array([sampled(seed, 0.0, 1)[0] for seed in range(400)])
    assert (sampled(7, 0.0, 20) == biases[7]).all()
    np.testing.assert_allclose(biases.std(axis=0), [0.1] * 3 + [1.0] * 3, rtol=4.0 / math.sqrt(800))
    for speed in (1.0, 4.0):
        shaken = sampled(7, speed, 2000) - biases[7]
        np.testing.assert_allclose(shaken.std(axis=0), 0.003 * speed, rtol=4.0 / math.sqrt(4000))
    with pytest.raises(fg.SettingsError, match=r"Imu.vibration is \(1.0, -1.0\); accepted: a number from 0"):
        Imu(vibration=(1.0, -1.0))


# -- beside a real car


def spread(values, low, high):
    """Standard deviation of what is between two frequencies [Hz], of values 25 times a second."""
    window, parts = np.hanning(128), np.lib.stride_tricks.sliding_window_view(values, 128)[::64]
    line = np.polynomial.polynomial.Polynomial.fit
    rest = [part - line(np.arange(128), part, 1)(np.arange(128)) for part in parts]
    power = (np.abs(np.fft.rfft(window * rest)) ** 2).mean(axis=0)
    frequency = np.fft.rfftfreq(128, 0.04)
    chosen = power[(frequency >= low) & (frequency < high)].sum()
    return math.sqrt(2.0 * chosen / (window**2).sum() / 128)


@each("name", ("ipz8_circle_00", "ipz8_steer_06", "ipz8_steer_10"))
def test_its_spectrum_and_its_error_are_those_of_a_real_car(name):
    path = DATA / "real_drives" / f"{name}.csv"
    if not path.is_file():
        pytest.skip(f"needs {path.name} in ../shared/data, which is no part of this repository")
    drive = np.genfromtxt(path, delimiter=",", names=True, usecols=range(10))
    speed, yaw_rate, steering = (drive[c] for c in ("vx_m_s", "yaw_rate_rad_s", "steering_executed_rad"))
    times = 0.04 * np.arange(len(drive))
    asked = np.convolve(np.pad(speed, 12, "edge"), np.ones(25) / 25, "valid")  # without the noise

    def law(odometry):  # the servo of this car turns the wheels by more than it is sent
        turned = np.interp(odometry.stamp, times, 1.339 * steering + 0.0019)
        return float(turned), float(np.interp(odometry.stamp + 0.05, times, asked))

    imu = {"sensor": "imu", "rate": 50, "noise_std": 0.0005, "vibration": 0.003}
    settings = {"vehicle": "ipz", "floor": "ipz8", "start_speed": float(asked[0])}
    told = heard(law, int(times[-1]), sensors=[imu], **settings)
    near = np.searchsorted([odometry.stamp for odometry in told], times[times < times[-1] - 1.1] - 1e-9)
    of_motor = np.array([told[k].speed for k in near])
    of_gyro = np.array([told[k].readings["imu"]["angular_velocity_z"] for k in near])
    assert spread(of_motor, 3.0, 12.5) == pytest.approx(spread(speed, 3.0, 12.5), rel=0.4)
    assert spread(of_gyro, 6.0, 12.5) == pytest.approx(spread(yaw_rate, 6.0, 12.5), rel=0.5)
    errors = [
        np.sqrt(np.mean((v * np.tan(steering[: len(near)]) / 0.307 - r) ** 2))
        for v, r in ((of_motor, of_gyro), (speed[: len(near)], yaw_rate[: len(near)]))
    ]
    assert errors[0] == pytest.approx(errors[1], rel=0.5)  # of the heading that is integrated, [rad/s]
