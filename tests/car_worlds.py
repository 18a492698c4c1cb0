"""Worlds for the tests of the car: the endless ground of its MJCF."""

import mujoco

from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.vehicle import Vehicle


def flat_world(mu=None, prefix="", timestep=None, **ground):
    """Return (model, data, car) of the car on its endless plane; `ground` are attributes of the plane."""
    car = Vehicle.load().spec(mu)
    for name, value in ground.items():
        setattr(car.geom("ground"), name, value)
    world = car
    if prefix:  # attached somewhere else, turned
        world = mujoco.MjSpec()
        world.option, world.memory = car.option, car.memory
        world.attach(car, prefix=prefix, frame=world.worldbody.add_frame(pos=(3.0, -2.0, 0.0), euler=(0, 0, 40)))
    model = world.compile()
    if timestep is not None:
        model.opt.timestep = timestep
    return model, mujoco.MjData(model), Car(model, prefix)


def run(model, data, seconds):
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)


def tire_pairs(model):
    """The indices of the tires' pairs, in the order of WHEELS."""
    return [model.pair(f"{wheel}_tire").id for wheel in WHEELS]
