"""The LiDAR: its beams, and both back ends against closed forms, against each other and against mj_ray."""

import math

import mujoco
import numpy as np
import pytest

from cases import each
from fg_mujoco.errors import ModelError
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.lidar.lidar import LIDAR_BACKENDS, RangefinderLidar, RaycastLidar, make_lidar
from lidar_worlds import GEOM, PREFIX, disagreements, mujoco_rays, place, random_spec, rig_spec, room

BEAMS = LidarModel.load().beams

both_backends = each("backend", LIDAR_BACKENDS)


def scanner(spec, backend):
    model = spec.compile()
    return model, mujoco.MjData(model), make_lidar(backend, model, PREFIX)


# --- beams ---


def test_beams_are_those_of_a_ust_10lx():
    beams = BEAMS
    assert beams.bearings.shape == (1081,)
    np.testing.assert_allclose(np.degrees(beams.bearings), np.arange(1081) * 0.25 - 135.0, rtol=0, atol=1e-12)
    assert beams.angle_increment == pytest.approx(math.radians(0.25), abs=1e-15)
    assert (beams.angle_min, beams.angle_max) == pytest.approx((-0.75 * math.pi, 0.75 * math.pi), abs=1e-14)
    assert (beams.range_min, beams.range_max) == (0.02, 30.0)
    assert 1.0 / beams.period == 40.0


# --- closed forms ---


@both_backends
def test_room_is_measured_to_its_walls(backend):
    spec = rig_spec(sensors=backend == "rangefinder")
    room(spec, half_length=6.0, half_width=4.0)
    model, data, lidar = scanner(spec, backend)
    x, y, yaw = 1.3, -0.7, 0.4
    place(model, data, (x, y, 0.2), yaw=yaw)
    cos, sin = np.cos(lidar.beams.bearings + yaw), np.sin(lidar.beams.bearings + yaw)
    exact = np.minimum((np.sign(cos) * 6.0 - x) / cos, (np.sign(sin) * 4.0 - y) / sin)
    np.testing.assert_allclose(lidar.ranges(data), exact, rtol=0, atol=1e-9)


@both_backends
@each(
    ("distance", "reading"),
    [(0.0199, -math.inf), (0.0201, 0.0201), (29.999, 29.999), (30.001, math.inf), (100.0, math.inf)],
)
def test_readings_outside_the_limits_are_infinite(backend, distance, reading):
    spec = rig_spec(sensors=backend == "rangefinder")
    spec.worldbody.add_geom(type=GEOM.mjGEOM_BOX, size=(0.1, 1, 1), pos=(0.1 + distance, 0, 0))
    model, data, lidar = scanner(spec, backend)
    place(model, data, (0, 0, 0.2))
    assert lidar.ranges(data)[540] == pytest.approx(reading, abs=1e-9)
    assert lidar.ranges(data)[0] == math.inf


# --- the back ends against each other and mj_ray ---


@each("seed", range(6))
def test_both_backends_and_single_mujoco_rays_agree_in_random_worlds(seed):
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


MATERIALS = {"clear": 0.0, "solid": 1.0}


@each("alpha", [0.0, 0.5, 1.0])
@each("material", ["", "clear", "solid"])
@each("group", [0, 5])
def test_transparent_geoms_are_invisible_to_both_backends(alpha, material, group):
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


def test_raycast_does_not_see_the_car_that_carries_it():
    spec = rig_spec(sensors=False)
    spec.body("rig").add_geom(type=GEOM.mjGEOM_BOX, size=(0.1, 1, 1), pos=(1, 0, 0))
    spec.body("rig").add_geom(type=GEOM.mjGEOM_SPHERE, size=(0.1, 0, 0), pos=(0, 1, 0))  # nor minds its shapes
    model, data, lidar = scanner(spec, "raycast")
    place(model, data, (0, 0, 0.1))
    assert np.isinf(lidar.ranges(data)).all()


# --- the protocol of MuJoCo's own sensors ---


def test_rangefinder_reads_the_present_state_at_every_tick_and_leaves_the_state_alone():
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


# --- refusals ---


@both_backends
def test_model_without_lidar_is_refused(backend):
    with pytest.raises(ModelError, match="no body 'car/hokuyo'"):
        make_lidar(backend, rig_spec().compile(), "car/")


def test_raycast_refuses_shapes_it_cannot_see():
    spec = rig_spec()
    spec.add_hfield(name="hill", nrow=2, ncol=2, size=(1, 1, 1, 0.1), userdata=[0.0, 1.0, 0.5, 0.2])
    spec.worldbody.add_geom(name="hill", type=GEOM.mjGEOM_HFIELD, hfieldname="hill")
    with pytest.raises(ModelError, match=r"hill .* hfield.*mesh, box, plane.*rangefinder"):
        make_lidar("raycast", spec.compile(), PREFIX)
