"""What every track keeps: the bundled circuits, random ones, and real ones that nobody here drew."""

import functools
from pathlib import Path

import numpy as np
import pytest
from track_oracles import distances_to_line, inside_prisms, ray_distances, room_beside, winding

from cases import each
from fg_mujoco.course.centreline_csv import read_centreline, write_centreline
from fg_mujoco.course.formats import track_names
from fg_mujoco.course.polyline import self_crossings
from fg_mujoco.course.track_mesh import wall_prisms
from fg_mujoco.course.track_walls import WALL_TOLERANCE
from fg_mujoco.simulation.course_loading import default_car, load_track

DATA = Path(__file__).resolve().parent.joinpath("../../../../shared/data").resolve()
REAL = ("maps/mco", "circuits/Monza", "circuits/Zandvoort")

# The widths of real circuits jump from point to point: there the room square to the line is off by what the corner
# between two offset segments moves.
ROOM_TOLERANCE = 2.0 * WALL_TOLERANCE


RANDOM = (*(f"random:{seed}" for seed in range(4)), *(f"random:{seed}:tight" for seed in range(2)))


@functools.cache
def made(name):
    if name in REAL:
        path = DATA / f"{name}_centerline.csv"
        if not path.exists():
            pytest.skip(f"no {path}: the real circuits are read from the folder {DATA}")
        name = path
    track = load_track(name)
    track.check_car(default_car())
    return track


every_track = each("track", [*track_names(), *RANDOM, *REAL], made=made)


@every_track
def test_corridor_is_as_wide_as_the_widths_say(track):
    short = room_beside(track) < -ROOM_TOLERANCE
    left = np.column_stack((-np.sin(track.headings), np.cos(track.headings)))
    for row, wall, width in ((0, track.left_wall, track.corridor_left), (1, track.right_wall, -track.corridor_right)):
        # where a ray grazes the side of a box, what counts is how far its end is from the wall
        ends = (track.centreline + width[:, None] * left)[short[row]]
        assert len(ends) == 0 or distances_to_line(ends, wall).min(axis=1).max() <= ROOM_TOLERANCE


@every_track
def test_walls_do_not_cross_themselves(track):
    for wall in (track.left_wall, track.right_wall):
        assert len(self_crossings(wall)[0]) == 0


@every_track
def test_centreline_runs_between_the_walls(track):
    about_left, about_right = (winding(track.centreline, wall) for wall in (track.left_wall, track.right_wall))
    counterclockwise = np.all(about_right == 1) and np.all(about_left == 0)
    clockwise = np.all(about_left == -1) and np.all(about_right == 0)
    assert counterclockwise or clockwise


@every_track
def test_projection_is_the_nearest_place_in_whose_corridor_the_point_lies(track):
    rng = np.random.default_rng(0)
    s = rng.uniform(0.0, track.length, 200)
    points = track.position(s, rng.uniform(-1.0, 1.0, 200))
    found, offset = track.project(points)
    away = np.linalg.norm(track.position(found, 0.0) - points, axis=1)
    by_section = away > np.abs(offset) + 1e-9
    assert np.all(away >= np.abs(offset) - 1e-9) and (len(track.table) > 6 or not by_section.any())
    nearest = distances_to_line(points, track.centreline).min(axis=1)
    width = np.where(
        offset > 0.0,
        np.interp(found, track.arc_length, track.corridor_left, period=track.length),
        np.interp(found, track.arc_length, track.corridor_right, period=track.length),
    )
    farther = (np.abs(offset) > nearest + 1e-9) & ~by_section
    assert np.all(np.abs(offset) >= nearest - 1e-9)
    assert np.all(np.abs(offset)[farther] <= width[farther] + 1e-6)


@every_track
def test_pieces_are_convex_with_volume_and_their_inner_faces_are_the_walls(track):
    prisms = wall_prisms(track.edges)
    feet = prisms[:, :4, :2]
    sides = np.roll(feet, -1, axis=1) - feet
    following = np.roll(sides, -1, axis=1)
    corner = sides[..., 0] * following[..., 1] - sides[..., 1] * following[..., 0]
    assert corner.min() > 0.0  # counterclockwise at every corner: convex, with area
    np.testing.assert_array_equal(prisms[:, :4, 2], 0.0)
    np.testing.assert_array_equal(prisms[:, 4:, 2], 0.3)
    np.testing.assert_array_equal(prisms[:, 4:, :2], feet)
    left, right = np.split(feet, [len(track.left_wall)])
    np.testing.assert_array_equal(left[:, 0], track.left_wall)
    np.testing.assert_array_equal(left[:, 1], np.roll(track.left_wall, -1, axis=0))
    np.testing.assert_array_equal(right[:, 1], track.right_wall)
    np.testing.assert_array_equal(right[:, 0], np.roll(track.right_wall, -1, axis=0))


@every_track
def test_no_piece_reaches_into_the_corridor(track):
    rng = np.random.default_rng(0)
    between = track.position(rng.uniform(0.0, track.length, 400), 0.0)
    angles = rng.uniform(0.0, 2.0 * np.pi, 400)
    beams = np.column_stack((np.cos(angles), np.sin(angles)))
    free = np.minimum(*(ray_distances(between, beams, wall) for wall in (track.left_wall, track.right_wall)))
    points = between + (rng.uniform(0.0, 1.0, 400) * (free - 1e-6))[:, None] * beams
    prisms = wall_prisms(track.edges)
    assert not inside_prisms(points, prisms).any()
    assert inside_prisms(between + (free + 1e-6)[:, None] * beams, prisms).mean() > 0.99


@every_track
def test_written_and_read_again_it_is_the_same(track, tmp_path):
    write_centreline(track, tmp_path / "again.csv", ["a comment", "second line"])
    lines = (tmp_path / "again.csv").read_text().splitlines()
    assert lines[:3] == ["# a comment", "# second line", "# x_m, y_m, w_tr_right_m, w_tr_left_m"]
    again = read_centreline(tmp_path / "again.csv")
    for name in ("centreline", "width_right", "width_left"):
        np.testing.assert_array_equal(getattr(again, name), getattr(track, name))
