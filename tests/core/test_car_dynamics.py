"""The car drives as closed forms say: Ackermann geometry, servo rates, traction limits, steady circles."""

import numpy as np
import pytest

from car_worlds import flat_world as flat_world_of
from car_worlds import run, step
from cases import each
from fg_mujoco.course.open_ground import OpenGround
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.settings import Start
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.changes import CarChanges
from fg_mujoco.vehicle.motion import ground_speed
from vehicle_worlds import open_file

# The ideal, and MuJoCo's own contacts. These know no slip by a ratio: where a shaft ties axles that roll on radii that
# differ by 32 um, as their loads do, it winds up to all of the friction at 15 m/s. So there a differential is between.
VEHICLES = {"coulomb": "f1tenth", "contact": open_file()}


@pytest.fixture(autouse=True, params=VEHICLES)
def tires(request, monkeypatch):
    """All tests are of the car on ideal tires, and on MuJoCo's contacts."""
    monkeypatch.setitem(ON, "tires", request.param)
    monkeypatch.setitem(ON, "vehicle", VEHICLES[request.param])
    return request.param


ON = {"tires": "coulomb", "vehicle": "f1tenth"}


def flat_world(**settings):
    return flat_world_of(**ON, **settings)


@each(
    ("speed", "start", "end", "holds"),
    [(0.0, -0.4189, 0.4189, True), (4.0, -0.15, 0.15, True), (8.0, -0.1, 0.1, False)],
)
def test_steering_turns_at_its_rate_standing_and_at_speed(speed, start, end, holds):
    model, data, car = flat_world()
    car.set_pose(data, 0, 0, 0, speed)
    data.ctrl[0] = start
    run(model, data, 1.0)
    data.ctrl[0] = end
    rates = []
    while abs(data.joint("steering").qpos[0] - end) > 1e-3:
        step(model, data)
        rates.append(data.joint("steering").qvel[0])
        assert len(rates) * model.opt.timestep < 1.0
    assert max(rates) == pytest.approx(car.parameters.max_steering_rate, rel=0.02)
    # the rate limit's time plus the servo's own lag, twice its time constant of 10 ms
    assert len(rates) * model.opt.timestep == pytest.approx((end - start) / 3.2, abs=0.06)
    run(model, data, 0.3)
    reached = []
    for _ in range(round(1.0 / model.opt.timestep)):
        step(model, data)
        reached.append(data.joint("steering").qpos[0])
    # turning wheels are gyroscopes, and sliding tires hop a little: the servo is shaken, by 1.3e-3 rad at most
    assert np.mean(reached) == pytest.approx(end, abs=2e-4)
    assert reached == pytest.approx([end] * len(reached), abs=2e-4 if holds else 2e-3)


@each(("period", "delay"), [(0.01, 0.0), (0.025, 0.0), (0.1, 0.0), (0.025, 0.02)])
def test_full_throttle_gives_the_motors_power_at_every_speed(period, delay):
    """Oracle: v dv/dt = 9.51 * 7.319, whatever the rate of the commands, and their delay."""
    world = World(OpenGround(seconds=60.0), mu=2.0, changes=CarChanges(command_delay=delay), **ON)
    engine = Engine(world, period=period)
    engine.place([Start(speed=7.5)])
    speeds = []
    while not speeds or speeds[-1] < 19.2:
        for _ in range(round(0.1 / period)):
            engine.commands[:] = 0.0, 20.0
            engine.drive()
        speeds.append(ground_speed(engine.qpos(0), engine.qvel(0), world.car.constants))
    power = np.diff(np.square(speeds)) / 0.2 / (9.51 * 7.319)
    assert speeds[0] < 8.5
    assert power.min() > 0.98
    assert power.max() < 1.003  # of contacts: it is that at a step's start


@each("speed", [-3.0, 2.0, 15.0])
def test_wheel_speed_odometry_is_the_true_speed_when_rolling(speed):
    """Under the car's weight the contact lies a rolling radius below the axle; the axles' loads differ by 8%."""
    model, data, car = flat_world()
    car.set_pose(data, 0, 0, 0, speed)
    run(model, data, 1.0)
    assert car.odometry(data).speed == pytest.approx(car.ground_speed(data), rel=1e-4)
    assert car.odometry(data).wheel_speeds == pytest.approx([speed] * 4, rel=5e-4)
