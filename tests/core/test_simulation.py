"""One world, one tick: 25 ms, the same bits every time, and sensors that agree with the truth."""

from copy import copy

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.simulation.cars import CAR_PREFIX, UNREAD_SENSORS
from fg_mujoco.simulation.physics import STATE
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tire_forces import TireForces


@pytest.fixture(scope="module")
def world():
    return fg.World("oval")


@pytest.fixture
def simulation(world):
    return fg.Simulation(world)


def same_bits(first, second):
    return np.array_equal(first.view(np.uint64), second.view(np.uint64))


def measured_anew(world, state, others=()):
    """An MjData of the very state, with all sensors measured, and some `others` of the vehicle that the world drops."""
    model = world.model
    if others:
        spec, own = mujoco.MjSpec.from_string(world.xml), world.vehicle.spec()
        for name in others:
            plain = own.sensor(name)
            spec.add_sensor(
                name=f"car/{name}", type=plain.type, objtype=plain.objtype, objname=f"car/{plain.objname}",
                reftype=plain.reftype,
            )  # fmt: skip
        model = spec.compile()
    model = copy(model)
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, STATE)
    TireForces(model, CAR_PREFIX).forward(data)
    return data


@each("backend", ("raycast", "rangefinder"))
@pytest.mark.slow
def test_scan_and_odometry_are_of_the_end_of_their_tick(backend):
    """Oracle: the state at the end, measured anew; sensors a physics step late would be 20 mm off at 4 m/s."""
    world = fg.World("oval", lidar=backend)
    simulation = fg.Simulation(world)
    simulation.reset(s=8.0, speed=4.0)
    for tick in range(12):
        command = fg.DriveCommand(steering_angle=0.05 * (-1) ** (tick // 3), speed=2.0)
        scan, odometry = simulation.step(command)
        anew = measured_anew(world, simulation.state)
        sensors = measured_anew(world, simulation.state, UNREAD_SENSORS)
        wheels = [sensors.sensor(f"car/{wheel}_wheel_speed").data[0] for wheel in WHEELS]
        assert scan.ranges == pytest.approx(world.make_lidar().ranges(anew), abs=1e-9)
        assert odometry.stamp == anew.time
        assert odometry.steering_angle == sensors.sensor("car/steering_angle").data[0]
        assert odometry.wheel_speeds.tolist() == (np.array(wheels) * world.parameters.wheel_radius).tolist()
        assert odometry.speed == pytest.approx(odometry.wheel_speeds.mean(), rel=1e-12)
        assert odometry.angular_velocity == pytest.approx(sensors.sensor("car/gyro").data, abs=1e-12)
        assert simulation.pose[:2] == tuple(anew.body("car/base_link").xpos[:2])


@each("tires", ["coulomb", "contact"])
def test_the_accelerometer_is_that_of_the_last_physics_step(tires):
    """Oracle: another MjData, stepped alongside; the sensors of a step are those of the state that it starts from."""
    world = fg.World("oval", tires=tires)
    simulation, alongside = fg.Simulation(world), mujoco.MjData(world.model)
    forces = TireForces(copy(world.model), CAR_PREFIX)
    simulation.reset(s=8.0, speed=4.0)
    before = None
    for tick in range(12):
        command = fg.DriveCommand(steering_angle=0.08 * (-1) ** (tick // 3), speed=2.0)
        mujoco.mj_setState(world.model, alongside, simulation.state, STATE)
        world.car.apply(alongside, command)
        for _ in range(simulation.substeps - 1):
            forces.step(alongside)
        state = np.empty_like(simulation.state)
        mujoco.mj_getState(world.model, alongside, state, STATE)
        expected = measured_anew(world, state).sensor("car/accelerometer").data.tolist()
        forces.step(alongside)
        mujoco.mj_getState(world.model, alongside, state, STATE)
        _, odometry = simulation.step(command)
        assert same_bits(simulation.state, state)
        assert odometry.linear_acceleration.tolist() == expected != before
        before = expected


def test_a_crash_is_remembered_and_told_by_the_next_tick(simulation):
    """A physics step senses the state that it starts from: what only the last state touches, the next tick tells."""
    simulation.reset(s=52.0, speed=5.0)
    told = touching = False
    for _ in range(80):
        simulation.step(fg.DriveCommand(steering_angle=0.15, speed=5.0))
        assert simulation.crashed or not (told or touching)
        told = simulation.crashed
        touching = measured_anew(simulation.world, simulation.state).sensor("car/chassis_contact").data[0] > 0.0
    assert told
