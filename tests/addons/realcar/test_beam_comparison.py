"""Recorded beams beside cast ones: a made-up drive in a made-up map, of which all errors are known."""

from __future__ import annotations

import math
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.realcar.drives.beam_comparison import compare_beams, pose_jumps
from fg_mujoco.addons.realcar.drives.beam_text import comparison_text
from fg_mujoco.addons.realcar.drives.recorded_beams import LidarMount, RecordedBeams, cast_beams
from fg_mujoco.addons.realcar.drives.wall_rays import MapWalls
from fg_mujoco.cli.main import main
from fg_mujoco.lidar.effects import LidarEffects
from map_oracles import draw_map, ring

BEARINGS = np.radians(np.arange(-125.0, 120.0, 6.25))
MOUNT = LidarMount(ahead=0.27, left=0.012, yaw=-0.006, delay=0.004, wall_depth=0.0)
NOISE = 0.012


@pytest.fixture(scope="module")
def map_file(tmp_path_factory):
    """A map of a hall with an infield: two squares, so that each scan tells its pose."""
    free = np.zeros((160, 160), bool)
    free[10:150, 10:150] = True
    free[60:100, 55:110] = free[124:130, 120:126] = False
    return draw_map(tmp_path_factory.mktemp("map"), free, name="hall", origin=(-4.0, -4.0, 0.0))


def made_up(walls: MapWalls, seed: int, rows: int = 500) -> RecordedBeams:
    """A circle of 2.6 m at 1 to 5 m/s, whose beams have noise, and some of which see a person or fail."""
    rng = np.random.default_rng(seed)
    time = 0.04 * np.arange(rows)
    speed = 3.0 + 2.0 * np.sin(time)  # at one speed a delay would look like a LiDAR that sits further ahead
    turn = speed / 2.6
    yaw = (3.0 * time - 2.0 * np.cos(time)) / 2.6 + seed
    poses = np.column_stack((2.6 * np.sin(yaw), -2.6 * np.cos(yaw), yaw))
    drive = RecordedBeams(
        name=f"drive {seed}", time=time, poses=poses, speed=speed, yaw_rate=turn,
        ranges=np.zeros((rows, len(BEARINGS))), bearings=BEARINGS,
    )  # fmt: skip
    ranges = cast_beams(drive, walls, MOUNT).hits.ranges
    ranges = ranges + NOISE * rng.standard_normal(ranges.shape)
    person = rng.random(ranges.shape) < 0.05
    ranges = np.where(person, 0.5 * ranges, ranges)
    ranges = np.where(rng.random(ranges.shape) < 0.01, math.inf, ranges)
    moved = poses + np.array((0.03, 0.03, 0.01)) * rng.standard_normal(poses.shape)
    object.__setattr__(drive, "ranges", ranges)
    object.__setattr__(drive, "poses", moved)
    return drive


@pytest.fixture(scope="module")
def compared(map_file):
    walls = MapWalls.of(map_file)
    return compare_beams([made_up(walls, seed) for seed in range(3)], walls, map_name="hall")


def test_rays_end_where_the_beams_of_the_compiled_course_end(tmp_path) -> None:
    """Oracle: the LiDAR of the compiled map, which draws the same walls in 3D by a z-buffer."""
    file = draw_map(tmp_path, ring())
    track = fg.load_track(str(file))
    loops = [track.wall_left, track.wall_right]
    ends = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    walls = MapWalls(starts=np.concatenate(loops), ends=ends, resolution=0.05)
    world = fg.World(track)
    data, lidar, ahead = mujoco.MjData(world.model), world.make_lidar(), world.parameters.lidar_offset
    for s in (0.0, 0.3 * track.length):
        x, y, yaw = track.start_pose(s)
        world.car.set_pose(data, x, y, yaw)
        origins = np.tile((x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)), (1081, 1))
        cast = walls.hits(origins, yaw + lidar.beams.bearings)
        away = (cast.ranges - lidar.ranges(data)) * cast.cosines
        assert np.abs(away).max() < 3e-4  # m square to the wall; the LiDAR nods with the car on its tires
        of_map = MapWalls.of(file).hits(origins, yaw + lidar.beams.bearings)
        assert np.abs((of_map.ranges - cast.ranges) * cast.cosines).max() < 0.025  # half a pixel: traced by itself
        turned = walls.hits(origins + np.array((1e-6, 0.0)), yaw + lidar.beams.bearings)
        steep = cast.cosines > 0.3
        slopes = (turned.ranges - cast.ranges)[steep] / 1e-6
        assert np.median(np.abs(slopes - cast.derivatives[steep, 0])) < 1e-5


def test_the_mount_is_found_without_the_errors_of_poses_and_beams(compared) -> None:
    mount = compared.mount
    assert (mount.ahead, mount.left) == pytest.approx((0.27, 0.012), abs=0.006)
    assert mount.yaw == pytest.approx(-0.006, abs=0.002)
    assert mount.delay == pytest.approx(0.004, abs=0.003)
    assert mount.wall_depth == pytest.approx(0.0, abs=0.004)


def test_noise_dropouts_and_what_is_not_in_the_map_are_told_apart(compared) -> None:
    many = [band for band in compared.by_range if band.pairs > 300]
    assert many
    for band in many:
        assert band.noise == pytest.approx(NOISE, rel=0.15)
        assert band.left == pytest.approx(NOISE, rel=0.25)
        assert band.recorded.median > 1.5 * band.fitted.median
    for drive in compared.drives:
        assert drive.not_in_map == pytest.approx(0.05, abs=0.02)
        recorded, posed, _ = drive.spreads
        assert recorded > 0.025 > 1.2 * NOISE > posed
    failed = sum(band.dropouts * band.recorded.count for band in compared.by_bearing)
    assert failed / sum(band.recorded.count for band in compared.by_bearing) == pytest.approx(0.01, rel=0.2)


def test_the_errors_are_those_that_a_race_can_have(compared) -> None:
    errors = compared.errors
    assert np.median(errors.noise) == pytest.approx(NOISE, rel=0.1)
    assert np.abs(errors.bias).max() < 0.01
    assert np.mean(errors.dropout) == pytest.approx(0.01, rel=0.5)
    assert fg.Setup.of("oval", lidar_effects=errors).first.effects.errors == errors
    assert "drive 0" in comparison_text(compared)


def test_one_drive_is_shown_by_its_halves_and_jumps_of_the_pose_are_left_out(map_file) -> None:
    walls = MapWalls.of(map_file)
    drive = made_up(walls, 1, rows=800)
    drive.poses[400:405, 0] += 0.5
    assert set(np.flatnonzero(pose_jumps(drive))) >= {399, 400, 404, 405}
    found = compare_beams([drive], walls)
    assert [each.name for each in found.drives] == ["drive 1, first half", "drive 1, second half"]
    assert found.mount.ahead == pytest.approx(0.27, abs=0.01)


REAL = Path(__file__).parents[4] / "shared" / "data" / "real_drives"


@pytest.mark.skipif(not REAL.is_dir(), reason="the recorded drives are not here")
def test_the_command_finds_the_lidar_of_a_real_car(tmp_path, capsys) -> None:
    """The mount is within 3 cm of .27 m ahead, at which others found the least difference; the noise is that of its
    data sheet, 3 cm at most.
    """
    lines = (REAL / "ipz20_race_00.csv").read_text().splitlines()
    (tmp_path / "part.csv").write_text("\n".join(lines[:800]) + "\n")
    drive, effects = str(tmp_path / "part.csv"), tmp_path / "lidar.toml"
    command = ["validate", drive, "--beams", "--map", str(REAL / "IPZ20.yaml")]
    assert main([*command, "--effects", str(effects)]) == 0
    said = re.search(r"LiDAR: ([\d.]+) \+- [\d.]+ cm ahead", capsys.readouterr().out)
    assert said is not None
    assert abs(float(said[1]) - 27.0) < 3.0
    errors = LidarEffects(measured=effects).errors
    assert errors is not None
    assert 0.001 < np.median(errors.noise) < 0.03
    assert main([*command, "--effects", str(effects)]) == 2
    assert "exists; accepted: a new file" in capsys.readouterr().err
    assert main(["validate", drive, "--beams"]) == 2
    assert "--beams without --map; accepted" in capsys.readouterr().err
