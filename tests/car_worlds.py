"""Worlds for the tests of the car: an endless plane."""

import mujoco

from fg_mujoco.car import Car, car_spec


def flat_world(mu=None, prefix="", **ground):
    """Return (model, data, car) of the car on an endless plane; `ground` are attributes of the plane."""
    car = car_spec(mu)
    world = car
    if prefix:  # attached somewhere else, turned
        world = mujoco.MjSpec()
        world.option = car.option
        world.attach(car, prefix=prefix, frame=world.worldbody.add_frame(pos=(3.0, -2.0, 0.0), euler=(0, 0, 40)))
    world.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1), contype=1, **ground)
    model = world.compile()
    return model, mujoco.MjData(model), Car(model, prefix)


def run(model, data, seconds):
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
