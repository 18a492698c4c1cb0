"""The LiDAR: its beams, and both back ends against closed forms, against each other and against mj_ray."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fg_mujoco.errors import ModelError, SettingsError
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.lidar.embree_rays import RayScene
from fg_mujoco.lidar.lidar import LIDAR_BACKENDS, RangefinderLidar, RaycastLidar, lidar_spec, make_lidar
from lidar_worlds import (
    GEOM,
    PREFIX,
    add_mesh,
    curvy_walls,
    disagreements,
    mujoco_rays,
    place,
    random_spec,
    rig_spec,
    room,
)

BEAMS = LidarModel.load().beams

both_backends = pytest.mark.parametrize("backend", LIDAR_BACKENDS)


def scanner(spec: Any, backend: str) -> Any:
    model = spec.compile()
    return model, mujoco.MjData(model), make_lidar(backend, model, PREFIX)


# --- beams ---


def test_beams_are_those_of_a_ust_10lx() -> None:
    beams = BEAMS
    assert beams.bearings.shape == (1081,)
    np.testing.assert_allclose(np.degrees(beams.bearings), np.arange(1081) * 0.25 - 135.0, rtol=0, atol=1e-12)
    assert beams.angle_increment == pytest.approx(math.radians(0.25), abs=1e-15)
    assert (beams.angle_min, beams.angle_max) == pytest.approx((-0.75 * math.pi, 0.75 * math.pi), abs=1e-14)
    assert (beams.range_min, beams.range_max) == (0.02, 30.0)
    assert 1.0 / beams.period == 40.0


def test_middle_beam_points_straight_ahead_and_bearings_grow_to_the_left() -> None:
    beams = BEAMS
    np.testing.assert_allclose(beams.directions[540], (1, 0, 0), atol=1e-14)
    np.testing.assert_allclose(beams.directions[540 + 360], (0, 1, 0), atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(beams.directions, axis=1), 1.0, atol=1e-15)
    assert np.abs(beams.directions[:, 2]).max() < 1e-15


def test_sweep_of_270_degrees_takes_three_quarters_of_the_period() -> None:
    beams = BEAMS
    assert beams.time_increment * 1080 == pytest.approx(0.01875, abs=1e-12)


def test_beams_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        BEAMS.directions[0, 0] = 2.0


def test_geometry_of_the_beams_is_what_their_scans_say() -> None:
    beams = BEAMS
    scan = beams.to_scan(np.ones(1081), 2.0)
    shared = ("angle_min", "angle_max", "angle_increment", "range_min", "range_max", "scan_time")
    assert [getattr(beams.geometry, name) for name in shared] == [getattr(scan, name) for name in shared]
    assert np.array_equal(beams.geometry.bearings, scan.bearings)
    assert beams.geometry is beams.geometry


def test_lidar_adds_no_mass_and_touches_nothing() -> None:
    model = lidar_spec().compile()
    assert model.body("hokuyo").mass == 0.0
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()


def test_lidar_without_sensors_has_no_sites() -> None:
    model = lidar_spec(sensors=False).compile()
    assert (model.nsite, model.nsensor, model.nbody) == (0, 0, 2)


# --- closed forms ---


@both_backends
def test_room_is_measured_to_its_walls(backend: str) -> None:
    spec = rig_spec(sensors=backend == "rangefinder")
    room(spec, half_length=6.0, half_width=4.0)
    model, data, lidar = scanner(spec, backend)
    x, y, yaw = 1.3, -0.7, 0.4
    place(model, data, (x, y, 0.2), yaw=yaw)
    cos, sin = np.cos(lidar.beams.bearings + yaw), np.sin(lidar.beams.bearings + yaw)
    exact = np.minimum((np.sign(cos) * 6.0 - x) / cos, (np.sign(sin) * 4.0 - y) / sin)
    np.testing.assert_allclose(lidar.ranges(data), exact, rtol=0, atol=1e-9)


@both_backends
def test_pitched_lidar_sees_the_floor(backend: str) -> None:
    model, data, lidar = scanner(rig_spec(sensors=backend == "rangefinder"), backend)
    height, pitch = 0.11, 0.05
    place(model, data, (3.0, 2.0, height), pitch=pitch, yaw=1.0)
    down = math.sin(pitch) * np.cos(lidar.beams.bearings)  # drop of each beam per metre
    with np.errstate(divide="ignore"):
        exact = np.where(down > height / 30.0, height / down, math.inf)
    ranges = lidar.ranges(data)
    assert ranges[540] == pytest.approx(height / math.sin(pitch), abs=1e-9)
    np.testing.assert_allclose(ranges, exact, rtol=0, atol=1e-9)


@both_backends
@pytest.mark.parametrize(("pitch_up", "sees"), [(0.0, True), (0.066, True), (0.067, False), (0.2, False)])
def test_low_wall_is_overshot_by_beams_that_point_up(backend: str, pitch_up: float, sees: bool) -> None:
    """0.2 m of wall above the LiDAR at 3 m: seen up to atan(0.2 / 3) = 0.06657 rad."""
    spec = rig_spec(sensors=backend == "rangefinder")
    spec.worldbody.add_geom(type=GEOM.mjGEOM_BOX, size=(0.05, 5.0, 0.15), pos=(3.05, 0, 0.15))
    model, data, lidar = scanner(spec, backend)
    place(model, data, (0, 0, 0.1), pitch=-pitch_up)
    assert lidar.ranges(data)[540] == pytest.approx(3.0 / math.cos(pitch_up) if sees else math.inf, abs=1e-9)


@both_backends
@pytest.mark.parametrize(
    ("distance", "reading"),
    [(0.0199, -math.inf), (0.0201, 0.0201), (29.999, 29.999), (30.001, math.inf), (100.0, math.inf)],
)
def test_readings_outside_the_limits_are_infinite(backend: str, distance: float, reading: float) -> None:
    spec = rig_spec(sensors=backend == "rangefinder")
    spec.worldbody.add_geom(type=GEOM.mjGEOM_BOX, size=(0.1, 1, 1), pos=(0.1 + distance, 0, 0))
    model, data, lidar = scanner(spec, backend)
    place(model, data, (0, 0, 0.2))
    assert lidar.ranges(data)[540] == pytest.approx(reading, abs=1e-9)
    assert lidar.ranges(data)[0] == math.inf


@both_backends
def test_no_return_reads_what_the_message_says(backend: str) -> None:
    model, data, lidar = scanner(rig_spec(sensors=backend == "rangefinder"), backend)
    place(model, data, (0, 0, 0.2), pitch=0.1)
    plain = lidar.beams.to_scan(lidar.ranges(data), 1.5)
    at_most = lidar.beams.to_scan(lidar.ranges(data), 1.5, no_return="range_max")
    assert (plain.no_return, at_most.no_return) == (math.inf, 30.0)
    assert plain.ranges[0] == math.inf
    assert at_most.ranges[0] == 30.0
    assert at_most.ranges[540] == plain.ranges[540] < 30.0
    np.testing.assert_allclose(plain.bearings, lidar.beams.bearings, rtol=0, atol=1e-12)


# --- the back ends against each other and mj_ray ---


@pytest.mark.parametrize("seed", range(6))
def test_both_backends_and_single_mujoco_rays_agree_in_random_worlds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = random_spec(rng).compile()
    data = mujoco.MjData(model)
    raycast, rangefinder = RaycastLidar(model, PREFIX), RangefinderLidar(model, PREFIX)
    finite = total = 0
    for _ in range(15):
        data.qpos[:] += rng.normal(0, 0.2, model.nq)
        data.mocap_pos[:] += rng.normal(0, 0.2, data.mocap_pos.shape)
        centre = rng.choice([[0.0, 0.0], [40.0, -25.0]])
        position = (*(centre + rng.uniform(-9, 9, 2)), rng.uniform(0.02, 0.5))
        place(model, data, position, roll=rng.normal(0, 0.1), pitch=rng.normal(0, 0.1), yaw=rng.uniform(-3, 3))
        oracle = mujoco_rays(model, data, raycast.beams)
        finite += np.isfinite(oracle).sum()
        assert not disagreements(rangefinder.ranges(data), oracle, 1e-9).size
        assert not disagreements(raycast.ranges(data), oracle, 1e-9).size
        total += oracle.size
    assert finite > 0.3 * total


def test_far_from_the_origin_the_backends_agree() -> None:
    rng = np.random.default_rng(3)
    spec = rig_spec()
    vertices, faces, radius = curvy_walls(rng, centre=(3000.0, -5000.0))
    add_mesh(spec, "walls", vertices, faces)
    model = spec.compile()
    data = mujoco.MjData(model)
    raycast = RaycastLidar(model, PREFIX)
    for angle in rng.uniform(0, 6, 20):
        position = (3000 + radius(angle) * math.cos(angle), -5000 + radius(angle) * math.sin(angle), 0.1)
        place(model, data, position, yaw=angle, pitch=0.02)
        assert not disagreements(raycast.ranges(data), mujoco_rays(model, data, raycast.beams), 1e-6).size


def test_no_beam_leaks_between_neighbouring_wall_segments() -> None:
    """From the middle of a closed ring every beam sees the ring, also those aimed at its vertices."""
    n, radius = 1440, 10.0
    bearings = BEAMS.bearings[0] + np.arange(n) * BEAMS.angle_increment
    around = radius * np.column_stack((np.cos(bearings), np.sin(bearings)))
    vertices = np.concatenate([np.column_stack((around, np.full(n, z))) for z in (0.0, 0.3)])
    index, following = np.arange(n), (np.arange(n) + 1) % n
    faces = np.concatenate(
        [np.column_stack((index, following, following + n)), np.column_stack((index, following + n, index + n))]
    )
    spec = rig_spec(sensors=False)
    add_mesh(spec, "ring", vertices, faces)
    model, data, lidar = scanner(spec, "raycast")
    rng = np.random.default_rng(0)
    for _ in range(50):
        place(
            model,
            data,
            (0, 0, rng.uniform(0.05, 0.25)),
            yaw=rng.integers(4) * BEAMS.angle_increment,
        )
        np.testing.assert_allclose(lidar.ranges(data), radius, atol=1e-4)


MATERIALS = {"clear": 0.0, "solid": 1.0}


@pytest.mark.parametrize("alpha", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("material", ["", "clear", "solid"])
@pytest.mark.parametrize("group", [0, 5])
def test_transparent_geoms_are_invisible_to_both_backends(alpha: float, material: str, group: int) -> None:
    spec = rig_spec()
    for name, value in MATERIALS.items():
        spec.add_material(name=name, rgba=(1, 1, 1, value))
    spec.worldbody.add_geom(
        type=GEOM.mjGEOM_BOX, size=(1, 1, 1), pos=(4, 0, 0), rgba=(1, 0, 0, alpha), material=material, group=group
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    place(model, data, (0, 0, 0.3))
    visible = MATERIALS.get(material, alpha) > 0.0
    for backend in LIDAR_BACKENDS:
        assert make_lidar(backend, model, PREFIX).ranges(data)[540] == (pytest.approx(3.0) if visible else math.inf)


def test_planes_are_seen_from_the_front_only_and_end_where_they_end() -> None:
    spec = rig_spec(floor=False)
    spec.worldbody.add_geom(type=GEOM.mjGEOM_PLANE, size=(2, 3, 1), pos=(1, 0, 0), euler=(0, 0, 30))
    spec.worldbody.add_geom(type=GEOM.mjGEOM_PLANE, size=(0, 1, 1), pos=(6, 0, 0), euler=(0, -90, 0))
    spec.worldbody.add_geom(type=GEOM.mjGEOM_PLANE, size=(0, 0, 1), pos=(0, 8, 0), euler=(-90, 0, 0))
    model = spec.compile()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    raycast = RaycastLidar(model, PREFIX)
    seen = 0
    for _ in range(40):
        place(model, data, rng.uniform(-2, 5, 3), roll=rng.normal(), pitch=rng.normal(), yaw=rng.uniform(-3, 3))
        ranges = raycast.ranges(data)
        seen += np.isfinite(ranges).sum()
        assert not disagreements(ranges, mujoco_rays(model, data, raycast.beams), 1e-9).size
    assert seen > 1000


@both_backends
def test_moving_obstacle_is_seen_where_it_is(backend: str) -> None:
    spec = rig_spec(sensors=backend == "rangefinder")
    obstacle = spec.worldbody.add_body(name="obstacle", mocap=True)
    obstacle.add_geom(type=GEOM.mjGEOM_BOX, size=(0.2, 0.2, 0.2))
    model, data, lidar = scanner(spec, backend)
    for distance in (2.0, 5.0, 29.5):
        data.mocap_pos[model.body("obstacle").mocapid[0]] = (distance, 0, 0.2)
        place(model, data, (0, 0, 0.1))
        assert lidar.ranges(data)[540] == pytest.approx(distance - 0.2, abs=1e-9)
    data.mocap_pos[model.body("obstacle").mocapid[0]] = (-3, 0, 0.2)
    place(model, data, (0, 0, 0.1))
    assert np.isinf(lidar.ranges(data)).all()


def test_raycast_does_not_see_the_car_that_carries_it() -> None:
    spec = rig_spec(sensors=False)
    spec.body("rig").add_geom(type=GEOM.mjGEOM_BOX, size=(0.1, 1, 1), pos=(1, 0, 0))
    spec.body("rig").add_geom(type=GEOM.mjGEOM_SPHERE, size=(0.1, 0, 0), pos=(0, 1, 0))  # nor minds its shapes
    model, data, lidar = scanner(spec, "raycast")
    place(model, data, (0, 0, 0.1))
    assert np.isinf(lidar.ranges(data)).all()


def test_distance_from_a_point_on_a_surface_is_never_negative() -> None:
    spec = rig_spec(sensors=False, floor=False)
    spec.worldbody.add_geom(type=GEOM.mjGEOM_BOX, size=(1, 1, 1), pos=(0.1, 0.2, 0.3), euler=(10, 20, 30))
    model, data, lidar = scanner(spec, "raycast")
    place(model, data, (9, 9, 9))
    rng = np.random.default_rng(0)
    face = np.column_stack((np.ones(2000), rng.uniform(-1, 1, (2000, 2))))
    box = next(geom for geom in range(model.ngeom) if model.geom_type[geom] == GEOM.mjGEOM_BOX)
    rotation = data.geom_xmat[box].reshape(3, 3)
    origins = data.geom_xpos[box] + face @ rotation.T
    scene = RayScene(model, carrier=lidar.body, reach=30.0)
    distances = scene.distances(data, origins, np.tile(-rotation[:, 0], (2000, 1)))
    assert (distances >= 0.0).all()
    assert np.isin(np.round(distances, 6), (0.0, 2.0)).all()


# --- the protocol of MuJoCo's own sensors ---


def test_rangefinder_reads_the_present_state_at_every_tick_and_leaves_the_state_alone() -> None:
    """Ten steps of 2.5 ms a tick: by rounding, the engine's own 25 ms fall one step late on some of them."""
    spec = rig_spec()
    spec.option.timestep = 0.0025
    room(spec, half_length=6.0, half_width=4.0)
    model, data, lidar = scanner(spec, "rangefinder")
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    after = state.copy()
    stale = 0
    for tick in range(12):
        place(model, data, (0.1 * tick, 0, 0.2))
        mujoco.mj_forward(model, data)
        stale += abs(data.sensordata[540] - (6.0 - 0.1 * tick)) > 1e-6
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        assert lidar.ranges(data)[540] == pytest.approx(6.0 - 0.1 * tick, abs=1e-9)
        mujoco.mj_getState(model, data, after, mujoco.mjtState.mjSTATE_INTEGRATION)
        assert np.array_equal(state, after)
        for _ in range(10):
            mujoco.mj_step(model, data)
    assert stale > 0  # or this test shows nothing
    mujoco.mj_resetData(model, data)
    for x in (2.0, -1.0):  # teleported twice within one instant
        place(model, data, (x, 0, 0.2))
        assert lidar.ranges(data)[540] == pytest.approx(6.0 - x, abs=1e-9)


def test_rangefinder_beams_survive_the_rounding_of_mjcf_text() -> None:
    """Six digits turn a beam by 2.5e-6 rad: 1 mm at 29 m along a wall 1 m away."""
    spec = rig_spec()
    spec.worldbody.add_geom(type=GEOM.mjGEOM_BOX, size=(50, 0.1, 1), pos=(0, -1.1, 0))
    spec.compile()
    model = mujoco.MjModel.from_xml_string(spec.to_xml())
    data = mujoco.MjData(model)
    lidar = make_lidar("rangefinder", model, PREFIX)
    place(model, data, (0, 0, 0.2))
    with np.errstate(divide="ignore"):
        exact = lidar.beams.readings(np.where(lidar.beams.bearings < 0, -1.0 / np.sin(lidar.beams.bearings), np.inf))
    np.testing.assert_allclose(lidar.ranges(data), exact, rtol=0, atol=1e-9)


# --- refusals ---


def test_unknown_backend_is_refused_with_the_known_ones() -> None:
    with pytest.raises(SettingsError, match=r"'sonar'; accepted: raycast, rangefinder"):
        make_lidar("sonar", rig_spec().compile(), PREFIX)


@both_backends
def test_model_without_lidar_is_refused(backend: str) -> None:
    with pytest.raises(ModelError, match="no body 'car/hokuyo'"):
        make_lidar(backend, rig_spec().compile(), "car/")


def test_rangefinder_without_sensors_is_refused() -> None:
    with pytest.raises(ModelError, match=r"0 rangefinders; accepted: 1081"):
        make_lidar("rangefinder", rig_spec(sensors=False).compile(), PREFIX)


def test_other_beams_than_those_of_the_model_are_refused() -> None:
    model = rig_spec().compile()
    model.site_quat[7] = (1, 0, 0, 0)
    with pytest.raises(ModelError, match="site_quat"):
        make_lidar("rangefinder", model, PREFIX)


def test_raycast_refuses_shapes_it_cannot_see() -> None:
    spec = rig_spec()
    spec.add_hfield(name="hill", nrow=2, ncol=2, size=(1, 1, 1, 0.1), userdata=[0.0, 1.0, 0.5, 0.2])
    spec.worldbody.add_geom(name="hill", type=GEOM.mjGEOM_HFIELD, hfieldname="hill")
    with pytest.raises(ModelError, match=r"hill .* hfield.*mesh, box, plane.*rangefinder"):
        make_lidar("raycast", spec.compile(), PREFIX)


def test_raycast_refuses_a_flex_object() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="hokuyo"/><flexcomp name="cloth" type="grid" count="3 3 1" dim="2"
        spacing=".1 .1 .1" mass="1"/></worldbody></mujoco>"""
    )
    with pytest.raises(ModelError, match=r"1 flex.*rangefinder"):
        make_lidar("raycast", model)


def test_unknown_no_return_is_refused() -> None:
    with pytest.raises(SettingsError, match="accepted: inf, range_max"):
        BEAMS.to_scan(np.zeros(3), 0.0, no_return="nan")


# --- invariants ---


@pytest.fixture(scope="module")
def rooms() -> dict[str, Any]:
    made = {}
    for backend in LIDAR_BACKENDS:
        spec = rig_spec(sensors=backend == "rangefinder")
        room(spec, half_length=40.0, half_width=3.0, height=0.3)
        made[backend] = scanner(spec, backend)
    return made


small = st.floats(-0.3, 0.3)


@both_backends
@given(x=st.floats(-45, 45), y=st.floats(-4, 4), z=st.floats(0.001, 1), roll=small, pitch=small, yaw=st.floats(-4, 4))
@settings(max_examples=60, deadline=None)
def test_readings_are_within_the_limits_or_infinite(
    rooms: dict[str, Any], backend: str, x: float, y: float, z: float, roll: float, pitch: float, yaw: float
) -> None:
    model, data, lidar = rooms[backend]
    place(model, data, (x, y, z), roll=roll, pitch=pitch, yaw=yaw)
    ranges = lidar.ranges(data)
    assert (np.isinf(ranges) | ((ranges >= 0.02) & (ranges < 30.0))).all()


@both_backends
@given(x=st.floats(-39, 39), y=st.floats(-2.9, 2.9), yaw=st.floats(-4, 4), beams=st.integers(1, 400))
@settings(max_examples=40, deadline=None)
def test_turning_by_whole_increments_shifts_the_scan(
    rooms: dict[str, Any], backend: str, x: float, y: float, yaw: float, beams: int
) -> None:
    model, data, lidar = rooms[backend]
    place(model, data, (x, y, 0.1), yaw=yaw)
    before = lidar.ranges(data)
    place(model, data, (x, y, 0.1), yaw=yaw + beams * lidar.beams.angle_increment)
    after = lidar.ranges(data)
    # At 30 m along a wall 0.1 m away, 1e-15 rad of rounding in the turn is 1e-11 m.
    with np.errstate(invalid="ignore"):
        same = (before[beams:] == after[:-beams]) | (np.abs(before[beams:] - after[:-beams]) < 1e-8)
    near_limit = np.minimum(before[beams:], after[:-beams]) > 30.0 - 1e-8
    assert (same | near_limit).all()
