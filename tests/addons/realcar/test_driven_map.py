"""Maps from driving: pose graphs in closed form, and the map of a drive against the course it was driven on."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.realcar.mapping.driven_map import map_course, mapped_walls
from fg_mujoco.addons.realcar.mapping.pose_graph import laid_out
from fg_mujoco.addons.realcar.mapping.recorded_map import write_map
from fg_mujoco.addons.realcar.mapping.scan_matching import step_between
from fg_mujoco.course.maps.map_server import FREE, OCCUPIED, UNKNOWN
from fg_mujoco.errors import TrackError
from fg_mujoco.racing.setup import Setup
from fg_mujoco.racing.trust import planner_files
from fg_mujoco.simulation.settings import DriveSettings

pytest.importorskip("scipy")
COURSE = "elbow"
DRIFT = 0.05


@pytest.fixture(scope="module")
def driven():
    effects = fg.LidarEffects(range_noise_std=0.02)
    setup = Setup.of(COURSE, laps=2, effects=effects, odometry_drift=DRIFT, max_speed=4.0, seed=5)
    return map_course(setup)  # the car turns in one move everywhere: odometry that drifts errs otherwise in several


def test_a_loop_spreads_its_error_over_equal_steps():
    # four steps of 1 m, and one from the first pose to the last of 3.6 m: 4 (d - 1)^2 + (4 d - 3.6)^2 is least at .92
    poses = np.column_stack((np.arange(5.0), np.zeros(5), np.zeros(5)))
    ends = np.array([(0, 1), (1, 2), (2, 3), (3, 4), (0, 4)], float)
    steps = np.array([(1.0, 0.0, 0.0)] * 4 + [(3.6, 0.0, 0.0)])
    found = laid_out(poses, ends, steps, np.ones((5, 3)))
    assert found[:, 0] == pytest.approx(0.92 * np.arange(5.0)) and np.abs(found[:, 1:]).max() < 1e-12


def test_true_steps_lead_back_to_the_true_poses():
    rng = np.random.default_rng(1)
    true = np.column_stack((rng.uniform(-5.0, 5.0, (30, 2)), rng.uniform(-9.0, 9.0, 30)))
    ends = np.concatenate((np.column_stack((np.arange(29), np.arange(1, 30))), rng.integers(0, 30, (40, 2))))
    ends = ends[ends[:, 0] != ends[:, 1]].astype(float)
    steps = np.array([step_between(true[int(a)], true[int(b)]) for a, b in ends])
    guess = true + rng.normal(0.0, 0.1, true.shape)
    guess[0] = true[0]
    off = laid_out(guess, ends, steps, np.full((len(ends), 3), 0.1)) - true
    off[:, 2] = np.remainder(off[:, 2] + math.pi, math.tau) - math.pi
    assert np.abs(off).max() < 1e-6


def test_walls_of_a_map_are_the_occupied_cells_next_to_free_ones():
    cells = np.full((5, 6), UNKNOWN, np.int8)
    cells[1:4, 2], cells[2, 1], cells[2, 3] = FREE, OCCUPIED, OCCUPIED
    cells[2, 4] = OCCUPIED  # behind another one
    made = SimpleNamespace(cells=cells, origin=(10.0, 20.0), resolution=0.1)
    assert mapped_walls(made) == pytest.approx(np.array([[10.15, 20.25], [10.35, 20.25]]))
    with pytest.raises(TrackError, match="saw no walls"):
        mapped_walls(SimpleNamespace(cells=np.full((3, 3), FREE), origin=(0.0, 0.0), resolution=0.1))


def test_the_map_of_a_drive_is_that_of_the_course(driven):
    assert driven.race.car.finished and driven.graph.loops > 10
    assert np.median(driven.wall_errors) < 0.05 and np.quantile(driven.wall_errors, 0.95) < 0.12
    assert driven.seen > 0.97
    assert np.median(driven.pose_errors) < 0.06 and np.quantile(driven.pose_errors, 0.95) < 0.15
    assert np.quantile(driven.pose_errors, 0.95) < 0.2 * np.quantile(driven.odometry_errors, 0.95)


def test_the_map_can_be_raced_on(driven, tmp_path):
    files = write_map(driven.made, tmp_path / "my_map")
    assert [file.name for file in files] == ["my_map.yaml", "my_map.png"]
    track, true = fg.load_track(str(files[0])), fg.load_track(COURSE)
    assert track.closed and track.length == pytest.approx(true.length, rel=0.05)
    middle = true.position(np.linspace(0.0, true.length, 50), 0.0)  # the map is in the course's frame
    assert np.abs(track.project(middle)[1]).max() < 0.5
    result = fg.race(track, "pure_pursuit[pose=scan_matching]", laps=1, max_speed=3.0, time_limit=1.0)
    assert result.car.end_reason == "time_limit"


def test_the_course_is_driven_by_the_map_in_place_of_the_true_one(driven, here):
    write_map(driven.made, "my_map")
    context = DriveSettings().context(fg.Vehicle.load().parameters, fg.load_track(COURSE).map_line)
    told = {"pose": "particle_filter", "pose_map": "my_map.yaml"}
    planner = fg.make_controller("pure_pursuit", context, settings=told)
    own, mapped = fg.make_controller("pure_pursuit", context), fg.load_track("my_map.yaml")
    assert planner.speed_profile()[0, :2] == pytest.approx(mapped.map_line.points[0])
    assert own.speed_profile()[0, :2] == pytest.approx(context.map_line.points[0])
    assert [Path(file).name for file in planner_files(planner, told)] == ["my_map.yaml"]
    with pytest.raises(TrackError, match=r"nowhere\.yaml"):
        fg.make_controller("pure_pursuit", context, settings={"pose_map": "nowhere.yaml"})
