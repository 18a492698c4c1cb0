"""The fastest line of a circuit: closed forms, finite differences, and the racelines that others made."""

import math
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.drivers.line_profile import read_line
from fg_mujoco.addons.drivers.map_raceline import Walls, optimize_line
from fg_mujoco.addons.drivers.racelines import raceline
from fg_mujoco.addons.drivers.racelines.raceline import make_raceline
from fg_mujoco.cli.main import main
from fg_mujoco.controllers.safety.line_optimizer import Grip, fastest_lap, spread
from fg_mujoco.course.clearance import clearances
from fg_mujoco.course.course import outline
from fg_mujoco.errors import TrackError
from fg_mujoco.lab.lap_time_bound import PointMass, fastest_speeds, lap_time, smooth_line
from fg_mujoco.racing.setup import Setup
from fg_mujoco.vehicle.vehicle import Vehicle

CAR = Vehicle.load().parameters
MU = 1.0489
SHARED = Path(__file__).parents[4] / "shared" / "data" / "circuits"
TURNS = 2.0 * math.pi * np.arange(400) / 400


def ring(radius):
    return radius * np.column_stack((np.cos(TURNS), np.sin(TURNS)))


def even_grip(lateral=8.0, ahead=4.0, back=5.0, power=30.0, max_speed=9.0, turning=0.0):
    """A g-g diagram of ellipses."""
    left = np.sqrt(1.0 - np.linspace(0.0, 1.0, 65) ** 2)
    return Grip(lateral, ahead * left, back * left, power, max_speed, 1.3, 0.93, turning, 0.6 * turning)


def lap(bends, steps, grip):
    arrays = [np.empty(len(bends)) for _ in range(3)]
    return fastest_lap(bends, steps, grip, *arrays), *arrays


@each("turning", [0.0, 0.5])
@each("seed", range(3))
def test_derivative_of_the_lap_time_is_that_of_finite_differences(seed, turning):
    grip = even_grip(turning=turning)
    rng, phase = np.random.default_rng(seed), 2.0 * math.pi * np.arange(150) / 150
    waves = (rng.normal(0.0, 0.6 / n) * np.sin(n * phase + rng.uniform(0.0, 6.3)) for n in range(1, 9))
    values = np.array([sum(waves), rng.uniform(0.15, 0.25, 150)])  # bends and steps
    time, _, *found = lap(*values, grip)
    for row in (0, 1) if turning == 0.0 else (0,):  # the steps' part in turning is left out
        for place in rng.integers(0, 150, 25):
            around = []
            for change in (-1e-7, 1e-7):
                changed = values.copy()
                changed[row, place] += change
                around.append(lap(*changed, grip)[0])
            assert found[row][place] == pytest.approx((around[1] - around[0]) / 2e-7, abs=2e-4 * time)


@each("direction", [1, -1])
def test_fastest_line_of_a_ring_is_at_its_inner_wall(direction):
    """A lap of radius R takes 2 pi sqrt(R / a), so the least radius is best: half a car and the margin off the wall."""
    sides = [ring(4.0)[::direction]], [ring(6.0)[::direction]]
    walls = Walls.of(*sides[::direction])
    found = optimize_line(ring(5.0)[::direction], walls, CAR, even_grip(max_speed=20.0, power=1e3), margin=0.1)
    radius = 4.0 + 0.5 * CAR.width + 0.1
    assert np.hypot(*found.points.T) == pytest.approx(radius, abs=0.005)
    assert found.lap_time == pytest.approx(2.0 * math.pi * math.sqrt(radius / 8.0), rel=2e-3)


@pytest.mark.skipif(not SHARED.exists(), reason="the shared circuits are not here")
def test_bound_is_at_least_as_good_as_that_of_the_shared_raceline():
    ours = make_raceline(Setup(track=str(SHARED / "Zandvoort_map.yaml")))
    theirs = smooth_line(read_line(SHARED / "Zandvoort_raceline.csv")[0][:-1], 0.002, spacing=0.1)
    own = smooth_line(spread(ours.points[::5], 5 * len(ours.points[::5])), 0.002, spacing=0.1)
    limits = PointMass(mu=MU, car=CAR, max_speed=8.0)
    assert lap_time(own, fastest_speeds(own, limits)) < lap_time(theirs, fastest_speeds(theirs, limits))
    assert ours.clearance > 0.08


def test_file_is_read_back_and_its_columns_agree(tmp_path):
    line = make_raceline(Setup(track="oval"))
    points, speeds = read_line(line.write(tmp_path / "line.csv"))
    rows = np.loadtxt(tmp_path / "line.csv", delimiter=";")
    s, x, y, heading, bend, speed, ahead = rows.T
    assert points == pytest.approx(np.column_stack((x, y))) and speeds == pytest.approx(speed)
    assert rows[0, 1:] == pytest.approx(rows[-1, 1:], abs=1e-6) and s[-1] == pytest.approx(line.length)
    assert np.diff(np.unwrap(heading)) / np.diff(s) == pytest.approx(0.5 * (bend[1:] + bend[:-1]), abs=0.02)
    along = np.arctan2(np.diff(y), np.diff(x))
    assert np.cos(along - heading[:-1]) == pytest.approx(1.0, abs=1e-3)
    gained = np.diff(speed**2) / (2.0 * np.diff(s))
    assert np.median(np.abs(gained - ahead[:-1])) < 0.05
    assert (line.use < 1.1).all() and line.use.max() > 0.95


def test_command_writes_line_and_picture(tmp_path, capsys):
    csv, png = tmp_path / "line.csv", tmp_path / "line.png"
    assert main(["raceline", "oval", "--mu", "0.66", "--out", str(csv), "--picture", str(png)]) == 0
    assert "lap-time bound" in capsys.readouterr().out
    assert read_line(csv)[1].max() <= 8.0 and png.read_bytes().startswith(b"\x89PNG")


def test_pure_pursuit_makes_its_own_line_and_is_faster_on_it():
    centreline, own = (fg.race("oval", f"pure_pursuit[line={line}]", laps=1).car for line in ("centreline", "raceline"))
    assert own.finished and own.max_slide_m_s < 0.01 and own.lap_times_s[0] < centreline.lap_times_s[0]


def test_the_clearance_of_a_line_is_that_to_everything_that_stands():
    course = fg.load_track("hairpins")
    poses = np.column_stack((course.centreline, course.headings))
    poses[:, :2] += np.random.default_rng(0).normal(0.0, 0.1, (len(poses), 2))
    standing = np.concatenate([outline(each) for each in course.edges])
    every = clearances(poses, standing, CAR)
    reach = CAR.length + float((course.corridor_left + course.corridor_right).max())
    np.testing.assert_array_equal(raceline._clearances(poses, standing, CAR, reach), every)


def test_a_circuit_whose_line_would_take_minutes_is_refused_at_once():
    count = 4500
    turns = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
    line = 1400.0 * np.column_stack((np.cos(turns), np.sin(turns)))
    long = fg.Track(name="long", centreline=line, width_right=np.full(count, 1.5), width_left=np.full(count, 1.5))
    with pytest.raises(TrackError, match=r"'long' is 8796 m long; accepted: up to 8000 m"):
        make_raceline(Setup(track=long))
