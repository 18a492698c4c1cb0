"""Worlds for the tests of the car: the endless ground of its MJCF."""

from weakref import WeakKeyDictionary

import mujoco
import numpy as np

from fg_mujoco.vehicle.car import Car
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle

_FORCES = WeakKeyDictionary()


def flat_world(mu=None, prefix="", timestep=None, tires="contact", vehicle="f1tenth", **ground):
    """Return (model, data, car) of the car on its endless plane; `ground` are attributes of the plane.

    On MuJoCo's contacts mujoco.mj_step steps it; on tires of ours `step` and `run` do.
    """
    car = Vehicle.load(vehicle).spec(mu, tires=Tires.load(tires))
    for name, value in ground.items():
        setattr(car.geom("ground"), name, value)
    world = car
    if prefix:  # attached somewhere else, turned
        world = mujoco.MjSpec()
        world.option, world.memory, world.nuserdata = car.option, car.memory, car.nuserdata
        world.attach(car, prefix=prefix, frame=world.worldbody.add_frame(pos=(3.0, -2.0, 0.0), euler=(0, 0, 40)))
    model = world.compile()
    if timestep is not None:
        model.opt.timestep = timestep
    data = mujoco.MjData(model)
    _FORCES[model] = forces = TireForces(model, prefix)
    if len(forces.rows):
        forces.begin(data)
    return model, data, Car(model, prefix)


def step(model, data):
    """Do one physics step of a model of `flat_world`, whatever its tires."""
    if model in _FORCES:
        _FORCES[model].step(data)
    else:
        mujoco.mj_step(model, data)


def forward(model, data):
    """Work out everything of the state of such a model."""
    _FORCES[model].forward(data)


def run(model, data, seconds):
    steps = round(seconds / model.opt.timestep)
    if model in _FORCES:
        _FORCES[model].run(data, *np.empty((2, steps, 0)))
        return
    for _ in range(steps):
        mujoco.mj_step(model, data)
