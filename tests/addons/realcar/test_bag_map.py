"""Maps from bags: a race here, its bag, the map of it and a race on that; against the true walls and the true lap."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial import cKDTree

import fg_mujoco as fg
from bag_worlds import CAR, EPOCH, SECOND, robot_odometry, robot_scan, rotation, transforms, vector, write_bag
from cases import each
from fg_mujoco.addons.realcar.mapping import recorded_map
from fg_mujoco.addons.realcar.mapping.bag_sweeps import read_sweeps
from fg_mujoco.addons.realcar.mapping.recorded_map import make_map, write_map
from fg_mujoco.addons.realcar.mapping.scan_matching import match_scans, step_between, stepped
from fg_mujoco.addons.ros.bag_recording import Recording
from fg_mujoco.addons.ros.bag_writer import export_bag
from fg_mujoco.cli.main import main
from fg_mujoco.course.maps.map_server import FREE
from fg_mujoco.course.polyline import subdivide
from fg_mujoco.simulation.course_loading import load_track

STEP = SECOND // 10


@pytest.fixture(scope="module")
def lap(tmp_path_factory):
    """A lap of the oval with the noise of a UST-10LX: the race, and its bag."""
    folder = tmp_path_factory.mktemp("lap")
    effects = fg.LidarEffects(range_noise_std=0.01, dropout_probability=0.01, motion_distortion=True)
    result = fg.race("oval", laps=1, max_speed=4.0, effects=effects, seed=1)
    assert result.car.finished
    fg.write_run(result, folder / "run", picture=False)
    export_bag(folder / "run", folder / "lap.mcap")
    return result, folder / "lap.mcap"


@pytest.fixture(scope="module")
def sweeps(lap):
    with Recording(lap[1]) as bag:
        return read_sweeps(bag, CAR)


def walls(track):
    return np.concatenate([subdivide(wall, 0.01)[0] for wall in (track.left_wall, track.right_wall, *track.islands)])


def apart(made, true):
    """How far the walls of a track are from those of another, each from the nearest, both ways [m]."""
    made, true = walls(made), walls(true)
    return np.concatenate((cKDTree(true).query(made)[0], cKDTree(made).query(true)[0]))


def test_a_map_of_a_lap_has_the_walls_and_the_lap_of_the_course(lap, tmp_path, capsys):
    result, bag = lap
    path = tmp_path / "made.yaml"
    assert main(["bag", str(bag), "--map", str(path)]) == 0
    said = capsys.readouterr().out
    assert "/scan                            sensor_msgs/msg/LaserScan" in said
    assert "scans at the transforms from map" in said
    assert f"fg-mujoco race --track {path} drives it" in said
    made, true = load_track(str(path)), load_track("oval")
    off = apart(made, true)
    assert off.mean() < 0.045 and off.max() < 0.12  # with cells of 0.05 m
    assert made.islands == ()
    assert made.length == pytest.approx(true.length, rel=0.01)
    x, y = made.centreline[0]
    assert math.hypot(x, y) < 0.5  # it begins where the car did
    # with the guidance, the cells' edges and the last digits of mu decide between 13.8 and 14.8 s, on any tires
    again = fg.race(str(path), laps=1, max_speed=4.0, planner_settings={"assist": "safe"})
    assert again.car.finished
    assert again.car.lap_times_s[0] == pytest.approx(result.car.lap_times_s[0], rel=0.03)


def test_the_car_is_mapped_the_way_it_went(sweeps, tmp_path):
    """The same scans, as if the course were driven the other way round: seen in a mirror."""
    poses, track = sweeps.poses * (1.0, -1.0, -1.0), sweeps.track * (1.0, 1.0, -1.0, -1.0)
    scans = [replace(scan, ranges=scan.ranges[::-1], time_increment=-scan.time_increment) for scan in sweeps.scans]
    write_map(make_map(replace(sweeps, poses=poses, track=track, scans=scans)), tmp_path / "made.yaml")
    made = load_track(str(tmp_path / "made.yaml"))
    write_map(make_map(sweeps), tmp_path / "usual.yaml")
    usual = load_track(str(tmp_path / "usual.yaml"))
    ahead = [track.centreline[1] - track.centreline[0] for track in (made, usual)]
    assert ahead[0] @ (ahead[1] * (1.0, -1.0)) > 0.0
    area = [np.cross(track.centreline, np.roll(track.centreline, -1, axis=0)).sum() for track in (made, usual)]
    assert area[0] * area[1] < 0.0


def drifted(sweeps, *, scale, turn):
    """The sweeps with the odometry of wheels that say too much, and of a gyro that does."""
    poses = [sweeps.poses[0].copy()]
    for before, after in zip(sweeps.poses[:-1], sweeps.poses[1:], strict=True):
        step = step_between(before, after) * (1.0 + scale, 0.0, 1.0 + turn)
        poses.append(stepped(poses[-1], step))
    poses = np.array(poses)
    return replace(sweeps, poses=poses, track=np.column_stack((sweeps.times, poses)), drifts=True,
                   source="the odometry on /odom")  # fmt: skip


def test_poses_that_drift_are_corrected_by_the_scans(sweeps, tmp_path, monkeypatch):
    off = drifted(sweeps, scale=0.03, turn=0.03)
    before = np.hypot(*(off.poses - sweeps.poses)[:, :2].T)
    assert before.max() > 0.5
    found = []
    monkeypatch.setattr(recorded_map, "match_scans", lambda *a, **k: found.append(match_scans(*a, **k)) or found[-1])
    made = make_map(off)
    assert made.matched
    ((numbers, poses, _),) = found
    after = np.hypot(*(poses - sweeps.poses[numbers])[:, :2].T)
    assert after.mean() < 0.6 * before.mean()  # the oval's curves look alike along them
    write_map(made, tmp_path / "made.yaml")
    assert "poses: the odometry on /odom, corrected by the scans" in (tmp_path / "made.yaml").read_text()
    track = load_track(str(tmp_path / "made.yaml"))
    assert track.length == pytest.approx(load_track("oval").length, rel=0.02)
    assert fg.race(track, laps=1, max_speed=4.0).car.finished


def refusal(capsys, *words):
    """The line that refuses a map that cannot be made, behind the table of the topics and what is odd about them."""
    assert main(["bag", "bag", "--map", *words]) == 2
    (line,) = (line for line in capsys.readouterr().err.splitlines() if ": warning: " not in line)
    return line


def test_scans_alone_make_no_map_and_what_does_is_said(here, capsys):
    write_bag("bag", [("/scan", EPOCH, robot_scan(np.ones(9), time=EPOCH))])
    said = "does not say where the LiDAR was: it has /scan (sensor_msgs/msg/LaserScan); accepted: nav_msgs"
    assert said in refusal(capsys, "made.yaml")


ROOM = 3.0  # [m] half of its side


def seen(x, y, heading, *, mounted=(0.0, 0.0, 0.0), beams=360):
    """What a LiDAR sees from a car's pose in a square room, whose axes are turned on the car as said."""
    c, s = math.cos(heading), math.sin(heading)
    at = np.array((x + c * mounted[0] - s * mounted[1], y + s * mounted[0] + c * mounted[1]))
    angles = heading + mounted[2] + np.linspace(-math.pi, math.pi, beams, endpoint=False)
    ahead = np.column_stack((np.cos(angles), np.sin(angles)))
    with np.errstate(divide="ignore"):
        return np.min(np.where(ahead > 0.0, (ROOM - at) / ahead, (-ROOM - at) / ahead), axis=1)


def in_a_room(tmp_path, *, links=(), source="odom", child="base_link", frame="map", mounted=(0.0, 0.0, 0.0), shift=0):
    """A bag of a car that goes round in a room; the poses have stamps `shift` [ns] off those of the scans."""
    entries = [("/tf_static", EPOCH, transforms(EPOCH, *links))] if links else []
    for number in range(40):
        time, heading = EPOCH + number * STEP, 0.1 * number
        x, y = math.sin(heading), 1.0 - math.cos(heading)
        if source == "odom":
            odometry = robot_odometry(time - shift, x=x, y=y, yaw=heading, speed=1.0, frame=frame)
            odometry.child_frame_id = child
            entries.append(("/odom", time, odometry))
        else:
            placed = transforms(time - shift, (frame, child, vector(x=x, y=y), rotation(heading)))
            entries.append(("/tf", time, placed))
        ranges = seen(x, y, heading, mounted=mounted)
        scan = robot_scan(ranges, first=-math.pi, step=math.tau / 360, time=time)
        entries.append(("/scan", time, scan))
    return write_bag(tmp_path / "bag", entries)


def room_of(bag, **options):
    """The sides of the room that was mapped [m]: between the outermost free cells."""
    with Recording(bag) as recording:
        made = make_map(read_sweeps(recording, CAR, **options), match=False)
    rows, columns = np.nonzero(made.cells == FREE)
    left, right = (made.origin[0] + made.resolution * columns.min(),
                   made.origin[0] + made.resolution * (columns.max() + 1))  # fmt: skip
    low, high = made.origin[1] + made.resolution * rows.min(), made.origin[1] + made.resolution * (rows.max() + 1)
    return np.array((left, right, low, high))


EXPECTED = np.array((-ROOM, ROOM, -ROOM, ROOM))


@pytest.mark.filterwarnings("ignore::UserWarning")
@each("mounted, source", product(((0.0, 0.0, 0.0), (0.3, -0.1, 0.0), (0.2, 0.0, 1.0), (-0.2, 0.1, math.pi)),
                                 ("odom", "tf")))  # fmt: skip
def test_the_room_is_where_it_is_wherever_the_lidar_is_on_the_car(mounted, source, tmp_path):
    links = [("base_link", "laser", vector(mounted[0], mounted[1]), rotation(mounted[2]))]
    bag = in_a_room(tmp_path, links=links, source=source, mounted=mounted)
    assert room_of(bag) == pytest.approx(EXPECTED, abs=0.06)


@pytest.mark.filterwarnings("ignore::UserWarning")
@each("frame, drifts", [("map", False), ("odom", True)])
def test_odometry_drifts_unless_it_is_on_the_map(frame, drifts, tmp_path):
    with Recording(in_a_room(tmp_path, frame=frame)) as bag:
        assert read_sweeps(bag, CAR).drifts is drifts


@each("arguments, said",
      [(("map.png",), "map.png: is no name for a map; accepted: one that ends in .yaml or .yml"),
       (("nowhere/map.yaml",), "cannot be written"),
       (("map.yaml", "--resolution", "0"), "resolution is 0.0 m; accepted: from 0.01 to 1"),
       (("map.yaml", "--pose-topic", "/pose"), "on /pose; accepted: /odom"),
       (("there.yaml",), "there.yaml: exists; accepted: a new file, or --force")])  # fmt: skip
def test_what_cannot_be_mapped_is_refused_in_one_line(arguments, said, here, capsys):
    in_a_room(here, links=[("base_link", "laser", vector(), rotation())])
    (here / "there.yaml").write_text("")
    assert said in refusal(capsys, *arguments)
    assert sorted(path.name for path in here.iterdir()) == ["bag", "there.yaml"]
