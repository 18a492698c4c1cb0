"""From free places of real maps the LiDAR measures what a ray marched through the image itself does, to a pixel.

A wall may be half a pixel from the pixels' edge, and at a grazing angle half a pixel beside the wall is any distance
along the ray. So what is compared is where a beam ends: within a pixel of the image's walls, and without having gone
deeper than a pixel into what is not free. Square to a wall, that is the difference of the ranges.
"""

import math

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.maps.map_server import read_map_file
from map_oracles import draw_map, march, real_map, ring

POSES = 100
EVERY = 4  # of the 1081 beams
CLOSEST = 3  # [pixel] from a wall that the LiDAR is put


def region_of(occupancy, place):
    """Return the free pixels that can be reached from a place [m]."""
    from scipy import ndimage

    labels, _ = ndimage.label(occupancy.free)
    column, row = np.floor(occupancy.to_pixels(place)).astype(int)
    return labels == labels[row, column]


def edges_of(region):
    """Middle of each edge between a pixel of a region and one that is not. Shape (n, 2), columns and rows."""
    up, right = np.diff(np.pad(region, 1), axis=0)[:, 1:-1], np.diff(np.pad(region, 1), axis=1)[1:-1]
    lower, left = np.argwhere(up)[:, ::-1] + (0.5, 0.0), np.argwhere(right)[:, ::-1] + (0.0, 0.5)
    return np.concatenate((lower, left))


def scan_all(world, occupancy, places, headings):
    """Return range and world angle of every few beams of a LiDAR at places (k, 2) [pixel]. Shapes (k, n)."""
    data, lidar, ahead = mujoco.MjData(world.model), world.make_lidar(), world.parameters.lidar_offset
    ranges = []
    for (x, y), heading in zip(occupancy.to_world(places), headings, strict=True):
        world.car.set_pose(data, x - ahead * math.cos(heading), y - ahead * math.sin(heading), heading)
        ranges.append(lidar.ranges(data)[::EVERY])
    return np.array(ranges), headings[:, None] + lidar.beams.bearings[::EVERY]


def misses(world, occupancy, rng):
    """Return how far from the image's walls beams end, how deep they go into them, and by how much ranges differ.

    In pixels; shape (k,) each.
    """
    from scipy.spatial import cKDTree

    region = region_of(occupancy, world.track.start_pose()[:2])
    edges = cKDTree(edges_of(region))
    middles = np.argwhere(region)[:, ::-1] + 0.5
    free = middles[edges.query(middles)[0] > CLOSEST]
    places = free[rng.integers(len(free), size=POSES)] + rng.uniform(-0.5, 0.5, (POSES, 2))
    ranges, angles = scan_all(world, occupancy, places, rng.uniform(-math.pi, math.pi, POSES))
    starts = np.repeat(places, ranges.shape[1], axis=0)
    ranges, angles = ranges.ravel() / occupancy.resolution, angles.ravel() - occupancy.origin[2]
    longest = world.make_lidar().beams.range_max / occupancy.resolution
    marched = march(occupancy.free, starts, angles, longest)
    hit, ranges = np.isfinite(ranges), np.minimum(ranges, longest)
    beams = np.column_stack((np.cos(angles), np.sin(angles)))
    beside = np.where(hit, edges.query(starts + ranges[:, None] * beams)[0], 0.0)
    depth = np.zeros(len(ranges))
    for i in np.flatnonzero(ranges > marched + 1.0):  # to be a pixel deep it must be a pixel on
        way = starts[i] + np.arange(marched[i], ranges[i], 0.1)[:, None] * beams[i]
        column, row = np.floor(way).astype(int).T
        way = way[~region[row, column]]
        depth[i] = edges.query(way)[0].max(initial=0.0)
    return beside, depth, np.abs(ranges - marched)


@pytest.mark.slow
@each("name", ["maps/aut", "maps/mco", "maps/CornerHall"])
def test_scans_agree_with_the_image_within_a_pixel(name):
    path = real_map(name)
    beside, depth, difference = misses(fg.World(path), read_map_file(path), np.random.default_rng(7))
    assert len(beside) == POSES * 271
    assert beside.max() <= 1.0
    assert depth.max() <= 1.0
    assert np.median(difference) < 0.5
    assert np.mean(difference <= 1.0) > 0.85  # the others graze a wall


@pytest.mark.slow
def test_the_comparison_trips_where_walls_are_a_pixel_and_a_half_off(tmp_path):
    path = draw_map(tmp_path, ring())
    moved = draw_map(tmp_path, ring(), name="moved", origin=(0.0, 1.5 * 0.05, 0.0))
    beside, depth, _ = misses(fg.World(moved), read_map_file(path), np.random.default_rng(9))
    assert beside.max() > 1.0 and depth.max() > 1.0
