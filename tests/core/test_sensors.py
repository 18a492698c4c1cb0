"""Sensors with a rate, delay, noise and dropouts of their own: what they deliver, and who sees it."""

import math
import pickle
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.cli.options import _with_files
from fg_mujoco.racing.resimulation import load_world, resimulate
from fg_mujoco.racing.run_folder import read_failed_scan
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.sensing import Sampler
from fg_mujoco.simulation.settings import Start
from fg_mujoco.vehicle.sensors import SENSORS, Sensor, as_sensors
from refusals import refused

MIXED = (
    "imu", {"sensor": "pose", "rate": 100, "delay": 0.013, "noise_std": (0.02, 0.02, 0.01)},
    {"sensor": "wheel_speeds", "rate": 20, "dropout_probability": 0.3}, {"sensor": "lidar", "noise_std": 0.03},
    {"sensor": "odometry", "name": "slow", "rate": 200, "delay": 0.3},
)  # fmt: skip

TICKS = 24
NOISE = fg.LidarEffects(range_noise_std=0.02, latency=0.03)


@dataclass(frozen=True, kw_only=True)
class Constant(Sensor):
    """Says the time, and 5."""

    columns = ("time_s", "five_m")

    def measure(self, car):
        return car.time, 5.0


@pytest.fixture
def constant():
    SENSORS["constant"] = Constant
    return Constant


class Listener:
    """Drives a curve, and keeps the scans and the odometry that it is given."""

    sensors = ("imu",)

    def __init__(self):
        self.scans, self.told = [], []

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        self.scans.append(scan)
        self.told.append(odometry)
        return fg.DriveCommand(steering_angle=0.1 if odometry.stamp > 0.2 else 0.0, speed=3.0)


def heard(sensors=MIXED, **settings):
    """The result of a race, and the odometry of each of its decisions."""
    listener = Listener()
    result = fg.race("oval", listener, laps=1, time_limit=TICKS * 0.025 - 0.01, sensors=sensors, **settings)
    return result, listener.told


def same(first, second):
    """Whether two readings are the same bit for bit."""
    parts = ("stamp", "values", "stamps", "samples")
    return all(np.array_equal(getattr(first, name), getattr(second, name), equal_nan=True) for name in parts)


def all_same(first, second):
    return list(first) == list(second) and all(same(first[name], second[name]) for name in first)


def sampled(sensor, count, *, steps=5, seed=1):
    """The samples and stamps of so many ticks of 25 ms of five steps."""
    sampler, samples, stamps = Sampler(sensor, seed, steps=steps, size=len(sensor.columns)), [], []
    for tick in range(count):
        sampler.measure(5 * tick, SimpleNamespace(time=0.025 * tick))
        sampler.deliver(0.025 * tick)
        samples.append(sampler.reading.values)
        stamps.append(sampler.reading.stamp)
    return np.array(samples), np.array(stamps)


# -- rate and delay


@each("rate", (5.0, 10, 40.0, 50.0, 66.6667, 100, 200.0))
@each("delay", (0.0, 0.012, 0.1))
def test_stamps_are_those_of_the_rate_and_at_least_the_delay_old(rate, delay, constant):
    _, told = heard(["imu", constant(rate=rate, delay=delay)])
    period = round(200.0 / rate) * 0.005
    delivered = []
    for odometry in told:
        reading = odometry.readings["constant"]
        number = math.floor((odometry.stamp - delay) / period + 1e-6)  # of the last that is old enough
        assert reading.stamp == pytest.approx(number * period) if number >= 0 else math.isnan(reading.stamp)
        assert math.isnan(reading["five"]) == (number < 0)
        assert reading.values[0] == reading.stamp or number < 0
        delivered += reading.stamps.tolist()
        assert reading.samples[:, 0].tolist() == reading.stamps.tolist()
    assert delivered == pytest.approx(np.arange(len(delivered)) * period)  # each once


def test_without_settings_the_bundled_ones_are_the_odometry_of_the_tick():
    _, told = heard(["odometry", "imu", "wheel_speeds", "pose", "lidar"], odometry_drift=0.1)
    for odometry in told:
        readings = odometry.readings
        assert {reading.stamp for reading in readings.values()} == {odometry.stamp}
        np.testing.assert_array_equal(readings["wheel_speeds"].values, odometry.wheel_speeds)
        np.testing.assert_array_equal(readings["imu"].values[:3], odometry.angular_velocity)
        np.testing.assert_array_equal(readings["imu"].values[3:], odometry.linear_acceleration)
        np.testing.assert_array_equal(readings["pose"].values, odometry.pose)
        measured = readings["odometry"]
        assert measured["speed"] == odometry.speed and measured["yaw_rate"] == odometry.yaw_rate
        assert measured["steering_angle"] == odometry.steering_angle


# -- noise and dropouts


def test_noise_is_gaussian_around_what_is_measured(constant):
    count = 20_000
    samples, _ = sampled(constant(noise_std=[0.0, 0.2]), count)
    np.testing.assert_array_equal(samples[:, 0], 0.025 * np.arange(count))
    noise = samples[:, 1] - 5.0
    assert abs(noise.mean()) < 4.0 * 0.2 / math.sqrt(count)
    assert abs(noise.std() / 0.2 - 1.0) < 4.0 / math.sqrt(2 * count)
    assert abs(np.mean(np.abs(noise) < 0.2) - 0.6827) < 4.0 * math.sqrt(0.6827 * 0.3173 / count)
    assert abs(np.corrcoef(noise[:-1], noise[1:])[0, 1]) < 4.0 / math.sqrt(count)


def test_a_reading_that_drops_out_leaves_the_last_and_its_stamp(constant):
    count = 20_000
    samples, stamps = sampled(constant(dropout_probability=0.3), count)
    known = ~np.isnan(stamps)
    assert known[-1] and (np.isnan(samples).all(axis=1) == ~known).all()
    np.testing.assert_array_equal(samples[known, 0], stamps[known])
    missing = stamps[known] < 0.025 * np.flatnonzero(known)
    assert abs(missing.mean() - 0.3) < 4.0 * math.sqrt(0.21 / count)
    assert abs(np.mean(missing[1:] & missing[:-1]) - 0.09) < 4.0 * math.sqrt(0.09 * 0.91 * 2 / count)


def test_streams_follow_from_seed_and_name_only(constant):
    def noise(name="a", seed=1):
        return sampled(constant(name=name, noise_std=1.0), 50, seed=seed)[0][:, 1].tolist()

    assert noise() == noise() != noise(name="b") != noise(seed=2) != noise()
    _, told = heard(MIXED, seed=5)
    _, turned = heard((*reversed(MIXED), {"sensor": "pose", "name": "more", "noise_std": 1}), seed=5, effects=NOISE)
    for one, other in zip(told, turned, strict=True):
        assert all(same(reading, other.readings[name]) for name, reading in one.readings.items())


def readings_of(count, threads, own, *, alone=None):
    """The readings of some worlds over some ticks; of one world alone, that world's."""
    worlds = range(count) if alone is None else [alone]
    engine = Engine(own, len(worlds), threads=threads, time_limit=10.0)
    cars = engine.cars_per_world
    starts = [Start(s=2.0 * i + 1.0 * car) for i in worlds for car in range(cars)]
    seeds = [100 * i + car for i in worlds for car in range(cars)]
    engine.place(
        starts, effects=[NOISE] * len(starts), seeds=seeds, odometry_drifts=[0.01 * seed for seed in seeds],
        sensors=[as_sensors(MIXED)] * len(starts),
    )  # fmt: skip
    found = []
    for _ in range(8):
        engine.sense()
        found.append([engine.readings(row) for row in range(len(starts))])
        engine.commands[:] = [[0.02 * i, 2.0] for i in worlds for _ in range(cars)]
        engine.drive()
        engine.judge()
    engine.close()
    return found


@each("cars", (1, 2))
def test_readings_are_the_same_in_any_batch_and_number_of_threads(cars):
    own = fg.World("oval", others=[WorldCar()] * (cars - 1))
    together = readings_of(17, 1, own)
    threaded = readings_of(17, 2, own)
    for first, second in zip(together, threaded, strict=True):
        assert all(all_same(one, other) for one, other in zip(first, second, strict=True))
    for world in (0, 5, 16):
        alone = readings_of(17, 1, own, alone=world)
        for first, second in zip(together, alone, strict=True):
            for car in range(cars):
                assert all_same(first[cars * world + car], second[car])


@each("planner", ("gap_finder", "disparity_extender"))
def test_what_is_measured_changes_no_bit_of_the_race(planner):
    plain = fg.race("oval", planner, laps=1, time_limit=1.0)
    measured = fg.race("oval", planner, laps=1, time_limit=1.0, sensors=MIXED)
    assert plain.trajectory_sha256 == measured.trajectory_sha256
    assert np.array_equal(plain.car.telemetry, measured.car.telemetry, equal_nan=True)
    assert "sensors" not in plain.summary() and "sensors" in measured.summary()


# -- the others' odometry


def among(listener, **settings):
    """The result of a short race of three cars, of which the first listens."""
    others = [fg.Entry(start=Start(s=4.0)), fg.Entry(start=Start(s=8.0, offset=0.2))]
    entries = [fg.Entry(controller=listener, **settings), *others]
    return fg.race("oval", entries=entries, laps=1, time_limit=TICKS * 0.025 - 0.01)


def test_a_planner_that_knows_its_opponents_is_told_where_they_are():
    listener = Listener()
    result = among(listener, knows="opponents", sensors=["imu"])
    assert len(listener.told) == TICKS
    for tick, odometry in enumerate(listener.told):
        reading = odometry.readings["opponents"]
        assert reading.stamp == odometry.stamp
        for number, car in enumerate(result.cars[1:], start=1):
            for name in ("x_m", "y_m", "heading_rad", "yaw_rate_rad_s"):
                assert reading[f"other_{number}_{name}"] == pytest.approx(car.column(name)[tick], abs=1e-12)
        poses = result.cars[1].column("x_m"), result.cars[1].column("y_m")
        if 0 < tick < TICKS - 1:
            way = math.hypot(*(each[tick + 1] - each[tick - 1] for each in poses))
            assert reading["other_1_speed"] == pytest.approx(way / 0.05, abs=0.1)
        assert math.isnan(reading["other_3_x"])


# -- run folders and bags


def bits(message):
    """All of a message but the readings of its sensors."""
    return {name: np.asarray(value).tobytes() for name, value in vars(message).items() if name != "readings"}


def test_what_was_told_follows_from_a_run_folder_at_each_time(tmp_path):
    listener = Listener()
    effects = fg.LidarEffects(range_noise_std=0.02, dropout_probability=0.1, latency=0.03)
    settings = {"time_limit": TICKS * 0.025 - 0.01, "sensors": MIXED, "seed": 4, "odometry_drift": 0.1}
    result = fg.race("oval", listener, laps=1, effects=effects, **settings)
    folder = fg.write_run(result, tmp_path / "run", picture=False)
    run = fg.read_run(folder)
    again = [tick.sensed.odometry for tick in resimulate(run, load_world(run))]
    for one, other in zip(listener.told, again, strict=True):
        assert bits(one) == bits(other) and all_same(one.readings, other.readings)
    assert fg.replay(folder).holds
    for source in (result, run):
        # 0.31 s is between two decisions
        for time, tick in ((None, -1), (0.0, 0), (0.3, 12), (0.31, 12), (result.sim_time_s, -1)):
            scan, odometry = fg.scan_at(source) if time is None else fg.scan_at(source, time)
            assert bits(scan) == bits(listener.scans[tick]) and bits(odometry) == bits(listener.told[tick])
            assert all_same(odometry.readings, listener.told[tick].readings)
    assert not np.array_equal(listener.scans[12].ranges, listener.scans[13].ranges)
    for time in (-0.1, 1e3, math.nan):
        with pytest.raises(fg.SettingsError, match=r"accepted: 0 to \d+\.\d+ s"):
            fg.scan_at(result, time)


def test_the_reading_at_which_a_planner_failed_is_kept(tmp_path):
    class Fails(Listener):
        def __call__(self, scan, odometry):
            return super().__call__(scan, odometry) if len(self.told) < 5 else 1 / 0

    with pytest.warns(UserWarning, match="ZeroDivisionError"):
        result = fg.race("oval", Fails(), laps=1, sensors=MIXED)
    _, odometry = read_failed_scan(fg.write_run(result, tmp_path / "run", picture=False))
    assert all_same(odometry.readings, result.car.planner_failure.odometry.readings)
    assert odometry.readings["pose"].columns == ("x_m", "y_m", "heading_rad")


# -- settings


def test_a_sensor_that_measures_something_else_is_refused(constant):
    with pytest.raises(fg.SettingsError, match=r"Unknown is not registered; accepted: SENSORS\['a_name'\] = Unknown"):
        type("Unknown", (Constant,), {})()
    for answer, said in (((1.0,), r"shape \(1,\); accepted: \(2,\), time_s, five_m"), ("x", "ValueError")):
        kind = type("Wrong", (Constant,), {"measure": lambda self, car, answer=answer: answer})
        SENSORS["constant"] = kind
        with pytest.raises(fg.SettingsError, match=f"sensor 'constant' .*{said}"):
            fg.race("oval", laps=1, time_limit=0.1, sensors=["constant"])


OWN = """from dataclasses import dataclass
from fg_mujoco.vehicle.sensors import Sensor

@dataclass(frozen=True, kw_only=True)
class Fails(Sensor):
    columns = ("a_m",)

    def measure(self, car):
        return self.look_up(car)

    def look_up(self, car):
        return [{False: 1.0}[car.time > 0.099]]  # line 12

@dataclass(frozen=True, kw_only=True)
class Unmade(Sensor):
    def __post_init__(self):
        super().__post_init__()
        self.gain  # line 18

class imu(Sensor):
    pass

@dataclass(frozen=True, kw_only=True)
class Leaves(Sensor):
    def measure(self, car):
        raise SystemExit(3)  # line 26
"""


@each(
    ("given", "said"),
    [
        ("own.py:Fails", "sensor 'Fails' failed at t = 0.100 s: KeyError: True (own.py, line 12)"),
        ("sensor=own.py:Fails,rate=100", "failed at t = 0.100 s: KeyError: True (own.py, line 12)"),
        ("own.py:Unmade", "cannot be made: AttributeError: 'Unmade' object has no attribute 'gain' (own.py, line 18)"),
        ("own.py:Leaves", "failed at t = 0.000 s: SystemExit: 3 (own.py, line 26)"),
        ("own.py:imu", "has a class imu, the name of a bundled sensor; accepted: another name"),
        ("own.py:Fail", "sensor 'own.py' has no Fail; accepted: Fails, Unmade, imu, Leaves; did you mean 'Fails'?"),
        ("own.py", "sensor 'own.py' has no class named behind it; accepted: Fails, Unmade, imu, Leaves"),
        ("typo.py:Fails", "sensor 'typo.py' does not import: NameError: name 'numpy' is not defined (typo.py, line 2)"),
        ("none.py:Fails", "sensor 'none.py': there is no file none.py"),
    ],
)
def test_a_sensor_of_a_file_that_fails_is_told_with_its_line(given, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(SENSORS, "_own", dict(SENSORS._own))
    Path("own.py").write_text(OWN)
    Path("typo.py").write_text("\nnumpy.pi")
    assert said in refused(tmp_path, capsys, "race", "--assist", "none", "--laps", "1", "--sensors", given)


def test_a_run_with_a_sensor_of_a_file_is_raced_again_where_the_file_is_named(
    tmp_path, monkeypatch, capsys, without_pictures
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(SENSORS, "_own", dict(SENSORS._own))
    Path("own.py").write_text(OWN.replace("car.time > 0.099", "False"))
    named = ["--sensors", "sensor=own.py:Fails,rate=50", "--out", "run"]
    assert main(["race", "--assist", "none", "--laps", "1", "--time-limit", "0.1", *named]) == 1
    del SENSORS._own["Fails"]  # as in another process
    assert main(["race", "--config", "run", "--sensors", "own.py:Fails"]) == 1
    del SENSORS._own["Fails"]
    capsys.readouterr()
    assert "sensors[0] is 'Fails'; accepted" in refused(tmp_path, capsys, "race", "--config", "run")


def test_a_sensor_of_a_file_travels_to_a_process_that_has_not_read_the_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(SENSORS, "_own", dict(SENSORS._own))
    Path("own.py").write_text(OWN)
    [given] = _with_files([{"sensor": "own.py:Fails", "rate": 50}])
    sensor = SENSORS.find(given["sensor"])(rate=50)
    sent = pickle.dumps(sensor)
    del SENSORS._own["Fails"], sys.modules[type(sensor).__module__]  # as in that process
    assert vars(pickle.loads(sent)) == vars(sensor)
    assert "Fails" in SENSORS


# -- environments


def environments(**settings):
    """A Gymnasium environment, one in a vector environment, and the observations of each after the same actions."""
    gymnasium = pytest.importorskip("gymnasium")
    from fg_mujoco.envs.gym_environment import F1TenthEnv
    from fg_mujoco.envs.gym_vector import F1TenthVectorEnv

    one, many = F1TenthEnv(**settings), F1TenthVectorEnv(3, **settings)
    assert isinstance(one.observation_space, gymnasium.spaces.Dict)
    seen = [one.reset(seed=5)[0]], [many.reset(seed=[4, 5, 6])[0]]
    action = np.array([0.1, 2.0], np.float32)
    for _ in range(6):
        seen[0].append(one.step(action)[0])
        seen[1].append(many.step(np.tile(action, (3, 1)))[0])
    many.close()
    return one, *seen


ENVIRONMENT = {"track": "oval", "beam_step": 90, "sensors": MIXED}


def test_environments_observe_sensors_by_name():
    env, seen, together = environments(**ENVIRONMENT)
    sizes = {"imu": 6, "pose": 3, "wheel_speeds": 4, "lidar": 1081, "slow": 3}
    for name, size in sizes.items():
        space = env.observation_space[name]
        assert space.shape == (size,) and space.dtype == np.float32 and not space.is_bounded()
        for own, all_of_them in zip(seen, together, strict=True):
            assert own[name].shape == (size,) and own[name].dtype == np.float32
            np.testing.assert_array_equal(all_of_them[name][1], own[name])
    for name, first in {"imu": 0, "pose": 1, "lidar": 0, "slow": 7}.items():  # tick of the first reading
        received = [float(observation[f"{name}_received"].item()) for observation in seen]
        assert received == [float(tick >= first) for tick in range(7)]
    assert not seen[-1]["slow"].any()  # nothing is .3 s old yet
    np.testing.assert_allclose(seen[3]["imu"][2], seen[3]["yaw_rate"][0])
    np.testing.assert_allclose(seen[3]["imu"][3:5], seen[3]["acceleration"])


@each("face", ["gymnasium", "vector", "parallel", "dm_env"])
@each("shape", ["", ",flat,history:3,normalised"])
def test_what_is_late_or_no_number_is_observed_within_the_space(face, shape):
    gymnasium, action = pytest.importorskip("gymnasium"), np.zeros(2, np.float32)
    sensors = [{"sensor": "pose", "rate": 10, "delay": 0.1}, {"sensor": "imu", "dropout_probability": 0.9},
               "opponents", "lidar"]  # fmt: skip
    settings = {"track": "oval", "beam_step": 180, "sensors": sensors, "observation": f"scan,speed{shape}"}
    if face == "dm_env":
        dm_environment = pytest.importorskip("fg_mujoco.envs.dm_environment", exc_type=ImportError)
        env = dm_environment.load(**settings, flat_observation=bool(shape))
        seen = [env.reset().observation, *(env.step(action).observation for _ in range(6))]
        space = gymnasium.spaces.Dict(
            {name: gymnasium.spaces.Box(spec.minimum, spec.maximum) for name, spec in env.observation_spec().items()}
        )
        seen = [dict(observation) for observation in seen]
    elif face == "parallel":
        env = fg.parallel_env(1, **settings)
        space = env.observation_space("car_0")
        seen = [env.reset(seed=1)[0]["car_0"], *(env.step({"car_0": action})[0]["car_0"] for _ in range(6))]
    else:
        many = face == "vector"
        make = gymnasium.make_vec if many else gymnasium.make
        env = make("fg_mujoco/F1Tenth-v0", **settings, **({"num_envs": 2} if many else {}))
        space, action = env.observation_space, np.tile(action, (2, 1)) if many else action
        seen = [env.reset(seed=1)[0], *(env.step(action)[0] for _ in range(6))]
    for observation in seen:
        assert space.contains(observation)
        parts = observation.values() if isinstance(observation, dict) else [observation]
        assert all(np.isfinite(part).all() for part in parts)
