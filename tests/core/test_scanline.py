"""The scan drawn as a picture, against single MuJoCo rays: nasty places to stand, any scanline, many worlds."""

import math
from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import each
from fg_mujoco.errors import ModelError
from fg_mujoco.lidar import lidar as lidar_module
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.lidar.body_poses import mounted_pose
from fg_mujoco.lidar.lidar import RaycastLidar
from fg_mujoco.lidar.scanline import scan
from fg_mujoco.lidar.visible_surfaces import ScanlineScene, is_scanline
from fg_mujoco.simulation.world import World
from lidar_worlds import (
    EYE,
    GEOM,
    PREFIX,
    RIG,
    add_mesh,
    disagreements,
    mujoco_rays,
    place,
    random_poses,
    random_spec,
    rig_spec,
    room,
)

INCREMENT = LidarModel.load().beams.angle_increment


def scanner(spec):
    model = spec.compile()
    return model, mujoco.MjData(model), RaycastLidar(model, PREFIX)


def explained(model, data, lidar, pose, nudge=1e-9):
    """Which readings are those of MuJoCo's rays there, or a nudge [rad] to the right or left, as along an edge."""
    place(model, data, **pose)
    readings = lidar.ranges(data)
    same = np.zeros(len(readings), dtype=bool)
    for turn in (0.0, -nudge, nudge):
        place(model, data, **{**pose, "yaw": pose.get("yaw", 0.0) + turn})
        oracle = mujoco_rays(model, data, lidar.beams)
        with np.errstate(invalid="ignore"):
            same |= (readings == oracle) | (np.abs(readings - oracle) < 1e-5)
    return same


# --- against single MuJoCo rays ---


@pytest.mark.slow
@given(
    pieces=st.lists(
        st.tuples(st.floats(-4, 4), st.floats(-4, 4), st.floats(-0.5, 1), st.floats(0.05, 2), st.integers(0, 10**6)),
        min_size=1,
        max_size=5,
    ),
    position=st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(0.001, 1)),
    angles=st.tuples(st.floats(-3.2, 3.2), st.floats(-0.4, 0.4), st.floats(-3.2, 3.2)),
)
@settings(max_examples=60, deadline=None)
def test_random_convex_pieces_are_seen_as_mujoco_sees_them(pieces, position, angles):
    spec = rig_spec(sensors=False)
    for index, (x, y, z, size, seed) in enumerate(pieces):
        corners = np.array([x, y, z]) + size * np.random.default_rng(seed).normal(0, 0.4, (9, 3))
        add_mesh(spec, f"piece_{index}", corners)
    model, data, lidar = scanner(spec)
    pose = dict(zip(("yaw", "pitch", "roll"), angles, strict=True))
    assert explained(model, data, lidar, {"position": position, **pose}).all()


@pytest.mark.slow
@each("seed", range(4))
@each(
    ("first", "count", "increment"),
    [(-math.pi, 1440, math.tau / 1440), (-3.0, 600, 0.01), (-0.4, 91, 0.01), (0.5, 40, 0.03), (-3.1, 2, 0.2)],
    ids=["all round", "nearly all round", "narrow", "left only", "two beams"],
)
def test_any_scanline_sees_what_mujoco_sees(first, count, increment, seed):
    beams = beams_at(first + increment * np.arange(count))
    assert is_scanline(beams)
    model = random_spec(np.random.default_rng(seed)).compile()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    scene = ScanlineScene(model, beams, model.body(EYE).id)
    scratch, readings = scene.scratch(), np.empty(count)
    for position, rotation in zip(*random_poses(rng, 20), strict=True):
        put(model, data, position, rotation)
        bodies = list(scene.moving)
        scan(scene.arrays, position, rotation, data.xpos[bodies], rotations_of(data, bodies), scratch, readings)
        assert not disagreements(readings, mujoco_rays(model, data, beams), 1e-9).size


def beams_at(bearings):
    directions = np.column_stack((np.cos(bearings), np.sin(bearings), 0.0 * bearings))
    steps = np.diff(bearings)
    return replace(
        LidarModel.load().beams, directions=directions, origins=0.0 * directions, bearings=bearings,
        angle_min=float(bearings[0]), angle_max=float(bearings[-1]), angle_increment=float(steps.mean()),
    )  # fmt: skip


def put(model, data, position, rotation):
    mocap = model.body(RIG).mocapid[0]
    data.mocap_pos[mocap] = position
    mujoco.mju_mat2Quat(data.mocap_quat[mocap], rotation.ravel())
    mujoco.mj_kinematics(model, data)


def rotations_of(data, bodies):
    return data.xmat[bodies].reshape(-1, 3, 3)


def test_planes_on_mocap_bodies_and_free_bodies_are_followed_in_the_present_state():
    """No mj_kinematics between the state and the scan."""
    spec = rig_spec(sensors=False, floor=False)
    board = spec.worldbody.add_body(name="board", mocap=True)
    board.add_geom(type=GEOM.mjGEOM_PLANE, size=(1, 2, 1), pos=(0, 0.1, 0))
    box = spec.worldbody.add_body(name="box").add_body(name="inner", pos=(0.5, 0, 0))
    box.add_geom(type=GEOM.mjGEOM_BOX, size=(0.3, 0.2, 0.4), quat=(1, 0.3, 0, 0.2))
    spec.body("box").add_freejoint()
    model, data, lidar = scanner(spec)
    rng = np.random.default_rng(0)
    oracle_data = mujoco.MjData(model)
    returns = 0
    for _ in range(60):
        data.qpos[:] = (*rng.uniform(-2, 2, 3), *rng.normal(size=4))
        data.mocap_pos[:], data.mocap_quat[:] = rng.uniform(-2, 2, (2, 3)), rng.normal(size=(2, 4))
        oracle_data.qpos[:], oracle_data.mocap_pos[:] = data.qpos, data.mocap_pos
        oracle_data.mocap_quat[:] = data.mocap_quat
        mujoco.mj_kinematics(model, oracle_data)
        oracle = mujoco_rays(model, oracle_data, lidar.beams)
        assert not disagreements(lidar.ranges(data), oracle, 1e-9).size
        returns += np.isfinite(oracle).sum()
    assert returns > 2000


# --- nasty places to stand ---


@each("far_wall", [False, True])
def test_in_line_with_a_face_no_beam_reads_a_place_where_nothing_is(far_wall):
    """Boxes ahead, left, right and behind, a face of each in one plane with the LiDAR."""
    spec = rig_spec(sensors=False)
    for x, y in ((2, 0.5), (-2, 0.5), (0.5, 2), (0.5, -2)):
        spec.worldbody.add_geom(type=GEOM.mjGEOM_BOX, size=(0.5, 0.5, 1), pos=(x, y, 0))
    if far_wall:
        room(spec, half_length=7.0, half_width=6.0)
    model, data, lidar = scanner(spec)
    for off in (0.0, 1e-17, -1e-17, 1e-13, -1e-13, 1e-10, -1e-10, 1e-6):
        for yaw_steps in (0, 17, -400, 720):
            pose = {"position": (off, off, 0.2), "yaw": yaw_steps * INCREMENT}
            assert explained(model, data, lidar, pose).all(), (off, yaw_steps)


@each("pitch", [0.25, -0.25, 1e-3])
def test_on_the_ground_the_beams_that_point_down_read_closer_than_range_min(pitch):
    model, data, lidar = scanner(rig_spec(sensors=False))
    place(model, data, (1, 2, 0), pitch=pitch)
    down = math.sin(pitch) * np.cos(lidar.beams.bearings) > 1e-12  # the beams to the side run along the ground
    np.testing.assert_array_equal(lidar.ranges(data), np.where(down, -np.inf, np.inf))


@each("diagonals", [0, 1])
@each("height", [0.05, 0.1, 0.2, 0.27])
def test_no_beam_leaks_through_a_vertex_or_along_a_row_of_them(diagonals, height):
    """A ring of three rows of vertices, each straight ahead of a beam; two of the heights are those of a row."""
    count, radius = 1440, 10.0
    around = radius * np.exp(1j * (LidarModel.load().beams.bearings[0] + np.arange(count) * INCREMENT))
    rows = [np.column_stack((around.real, around.imag, np.full(count, z))) for z in (0.0, 0.1, 0.2, 0.3)]
    index, following = np.arange(count), (np.arange(count) + 1) % count
    faces = []
    for row in range(3):
        low, high = count * row, count * (row + 1)
        if diagonals:
            faces += [(index + low, following + low, following + high), (index + low, following + high, index + high)]
        else:
            faces += [(index + low, following + low, index + high), (following + low, following + high, index + high)]
    spec = rig_spec(sensors=False)
    add_mesh(spec, "ring", np.concatenate(rows), np.concatenate([np.column_stack(face) for face in faces]))
    room(spec, half_length=20.0, half_width=20.0)  # where a beam that leaks ends
    model, data, lidar = scanner(spec)
    for quarter in range(4):
        place(model, data, (0, 0, height), yaw=quarter * 360 * INCREMENT)
        np.testing.assert_allclose(lidar.ranges(data), radius, atol=1e-4)


@each("storeys", [1, 2])
@each("turn", [0, 180])  # of the boxes, and so of the diagonals of their sides
@each("yaw", [0.0, 0.3, 2.0, -1.1])
def test_no_beam_leaks_past_boxes_that_end_at_the_very_height_of_the_lidar(yaw, turn, storeys):
    spec = rig_spec(sensors=False)
    for x, y, length, width in ((4.5, 0, 0.5, 5), (-4.5, 0, 0.5, 5), (0, 4.5, 5, 0.5), (0, -4.5, 5, 0.5)):
        for z in (0.5, 1.5)[:storeys]:
            spec.worldbody.add_geom(type=GEOM.mjGEOM_BOX, size=(length, width, 0.5), pos=(x, y, z), euler=(0, 0, turn))
    model, data, lidar = scanner(spec)
    for x, y in np.random.default_rng(0).uniform(-3, 3, (20, 2)):
        place(model, data, (x, y, 1.0), yaw=yaw)
        cos, sin = np.cos(lidar.beams.bearings + yaw), np.sin(lidar.beams.bearings + yaw)
        exact = np.minimum((np.sign(cos) * 4.0 - x) / cos, (np.sign(sin) * 4.0 - y) / sin)
        np.testing.assert_allclose(lidar.ranges(data), exact, rtol=0, atol=1e-9)


# --- where the LiDAR is ---


def test_mounted_pose_is_that_of_mj_kinematics():
    world = World("oval")
    data, lidar = mujoco.MjData(world.model), world.make_lidar()
    assert isinstance(lidar, RaycastLidar)
    mount = lidar.mount
    assert mount is not None
    rng = np.random.default_rng(0)
    position, rotation = np.empty(3), np.empty((3, 3))
    for length in (1.0, 1.0, 0.3, 40.0, 1e-20):
        pose = data.qpos[mount.qpos_address : mount.qpos_address + 7]
        pose[:] = *rng.uniform(-1, 1, 3), *rng.normal(size=4)
        pose[3:] *= length / np.linalg.norm(pose[3:])
        mounted_pose(pose.copy(), False, mount.offset_position, mount.offset_rotation, position, rotation)
        mujoco.mj_kinematics(world.model, data)
        np.testing.assert_allclose(position, data.xpos[lidar.body], rtol=0, atol=1e-15)
        np.testing.assert_allclose(rotation.ravel(), data.xmat[lidar.body], rtol=0, atol=1e-15)


# --- beams that are no scanline ---


def other_beams():
    beams = LidarModel.load().beams
    up = beams.directions + np.array([0.0, 0.0, 0.1])
    ring = 0.05 * np.column_stack((np.cos(beams.bearings), np.sin(beams.bearings), 0.0 * beams.bearings))
    return {
        "cone": replace(beams, directions=up / np.linalg.norm(up, axis=1, keepdims=True)),
        "from a ring": replace(beams, origins=ring),
    }


@each("kind", other_beams())
def test_beams_that_are_no_scanline_are_refused(kind, monkeypatch):
    lidar = SimpleNamespace(beams=other_beams()[kind], body=EYE)
    monkeypatch.setattr(lidar_module, "lidar_of", lambda *model: lidar)
    with pytest.raises(ModelError, match="has beams that 'raycast' does not draw; accepted: of one point and plane"):
        scanner(random_spec(np.random.default_rng(2)))
