"""A planner over a bag's scans: on its own run's bag it commands what it commanded in the race."""

import csv
import itertools
import math

import numpy as np
import pytest

import fg_mujoco as fg
from bag_worlds import EPOCH, SECOND, robot_odometry, robot_scan, write_bag
from cases import each
from fg_mujoco.addons.ros.bag_reader import ScanBag
from fg_mujoco.addons.ros.bag_replay import COLUMNS
from fg_mujoco.addons.ros.bag_writer import export_bag
from fg_mujoco.cli.main import main
from fg_mujoco.lidar.effects import LidarEffects
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.simulation.settings import Start

STEERING_TOLERANCE, SPEED_TOLERANCE = 1e-6, 1e-5  # [rad], [m/s]; float32 knows 1e-6 m of a range of 10 m
HAIRPIN = 26.0  # [m] along the line


def read_commands(path):
    with path.open() as file:
        header, *rows = csv.reader(file)
    assert tuple(header) == COLUMNS
    return np.array(rows, np.float64).reshape(-1, 4)


def race_and_bag(folder, **settings):
    """Race 1.25 s into the first hairpin, and return the race and its bag."""
    result = fg.race("hairpins", laps=1, time_limit=1.24, start=Start(s=HAIRPIN, speed=3.0), **settings)
    fg.write_run(result, folder / "run", picture=False)
    export_bag(folder / "run", folder / "run.mcap")
    return result, folder / "run.mcap"


def assert_same_commands(rows, result):
    assert len(rows) == len(result.car.telemetry)
    np.testing.assert_allclose(rows[:, 0], result.car.column("time_s"), atol=1e-9)
    np.testing.assert_allclose(rows[:, 2], result.car.column("command_steering_rad"), atol=STEERING_TOLERANCE)
    np.testing.assert_allclose(rows[:, 3], result.car.column("command_speed_m_s"), atol=SPEED_TOLERANCE)
    assert np.ptp(rows[:, 2]) > 0.1  # there was something to decide


@pytest.mark.slow
@each("name", controller_names())
def test_every_planner_commands_over_its_own_bag_what_it_commanded_in_the_race(name, tmp_path):
    result, bag = race_and_bag(tmp_path, controller=name)
    out = tmp_path / f"{name}.csv"
    assert main(["replay-scans", str(bag), "--controller", name, "--track", "hairpins", "--out", str(out)]) == 0
    assert_same_commands(read_commands(out), result)


@pytest.mark.slow
def test_late_noisy_and_distorted_scans_are_replayed_as_they_were(tmp_path):
    effects = LidarEffects(range_noise_std=0.01, dropout_probability=0.02, latency=0.06, motion_distortion=True)
    settings = {"planner_mu": math.inf, "max_speed": 5.0}
    result, bag = race_and_bag(tmp_path, controller="gap_finder", effects=effects, seed=2, **settings)
    out = tmp_path / "commands.csv"
    assert main(["replay-scans", str(bag), "--planner-mu", "off", "--max-speed", "5", "--out", str(out)]) == 0
    rows = read_commands(out)
    assert_same_commands(rows, result)
    late = rows[:, 0] - rows[:, 1]  # three sweeps, and the sweep that a stamp is the start of
    assert late[10:] == pytest.approx(0.075 + 0.75 * 0.025, abs=1e-6)


def robot_bag(folder, ranges, **geometry):
    entries = []
    for i in range(5):
        time = EPOCH + i * SECOND // 40
        entries.append(("/odom", time, robot_odometry(time, speed=1.0)))
        entries.append(("/scan", time, robot_scan(ranges, time=time, **geometry)))
    return write_bag(folder, entries)


def test_a_planner_of_ones_own_is_run_and_what_it_was_told_without_odometry_is_said(here, capsys):
    (here / "mine.py").write_text("from fg_mujoco.messages import DriveCommand\n" "class Mine:\n"
        "    def reset(self):\n        print('hello')\n" "    def __call__(self, scan, odometry):\n"
        "        return DriveCommand(steering_angle=0.0, speed=float(scan.ranges[0]) + odometry.speed)\n")  # fmt: skip
    write_bag(here / "drive", [("/front", EPOCH, robot_scan([2.5, 1.0], time=EPOCH))])
    assert main(["replay-scans", "drive", "--controller", "mine.py:Mine"]) == 0
    captured = capsys.readouterr()
    assert captured.out == "drive_commands.csv: 1 commands to the scans on /front\n"
    assert "no odometry; the speed is taken to be 0" in captured.err
    assert read_commands(here / "drive_commands.csv")[0, 2:].tolist() == [0.0, 2.5]


def test_commands_up_to_a_planners_failure_are_on_disk(here, capsys):
    (here / "mine.py").write_text("from fg_mujoco.messages import STOP\n" "class Mine:\n"
        "    def reset(self):\n        self.count = 0\n" "    def __call__(self, scan, odometry):\n"
        "        self.count += 1\n" "        return STOP if self.count < 4 else None\n")  # fmt: skip
    robot_bag(here / "bag", np.full(41, 3.0))
    assert main(["replay-scans", "bag", "--controller", "mine.py:Mine", "--out", "out.csv"]) == 1
    said = capsys.readouterr().err.splitlines()[-1]
    assert "answered None" in said and said.endswith("out.csv has the commands up to there")
    assert len(read_commands(here / "out.csv")) == 3


def test_a_bag_that_is_damaged_in_the_middle_leaves_no_file(here, monkeypatch, capsys):
    robot_bag(here / "bag", np.full(41, 3.0))
    before, deliver = sorted(here.rglob("*")), ScanBag.__iter__

    def damaged(self):
        yield from itertools.islice(deliver(self), 2)
        raise fg.BagError("bag: is damaged")

    monkeypatch.setattr(ScanBag, "__iter__", damaged)
    for name in ("out.csv", "out.mcap"):
        assert main(["replay-scans", "bag", "--out", name]) == 2
        assert "bag: is damaged" in capsys.readouterr().err
        assert sorted(here.rglob("*")) == before
