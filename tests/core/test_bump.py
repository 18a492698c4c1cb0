"""A car over a smooth bump: against a linear half car, and against MuJoCo's own contacts with the same surface."""

import math

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.course.ground import Ground
from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tires import Tires

HEIGHT, LENGTH, SPEED, CELL, RADIUS = 0.005, 0.4, 2.0, 0.02, 0.0486  # [m], [m/s]; of a loaded wheel
SPRUNG, AXLE, PITCH_INERTIA = 3.14, 0.3, 0.0221  # [kg], [kg m^2] of f1tenth.xml, as are
SPRINGS, DAMPERS, TIRES, TIRE_DAMPERS = 4000.0, 80.0, 23400.0, 40.0  # these of an axle [N/m], [N s/m]
FRONT, REAR = 0.1575, 0.1727  # [m] of the axles from the centre of the sprung mass


def bump(x):
    return np.where(np.abs(x) < 0.5 * LENGTH, 0.5 * HEIGHT * (1.0 + np.cos(2.0 * math.pi * x / LENGTH)), 0.0)


def slope(x):
    return (bump(x + 1e-6) - bump(x - 1e-6)) / 2e-6


def extremes(values):
    """Greatest height, greatest travel of both springs, and their least, of rows from where the car was level."""
    values = np.asarray(values) - values[0]
    return np.concatenate((values.max(axis=0), values.min(axis=0)[1:]))


def driven(model, prefix="", before=lambda model, data: None):
    data, car, forces, found = mujoco.MjData(model), Car(model, prefix), TireForces(model, prefix), []
    model.opt.timestep = 0.001
    car.set_pose(data, -1.4, 0.0, 0.0, SPEED)
    forces.begin(data)
    while data.qpos[0] < 1.0:
        car.apply(data, fg.DriveCommand(steering_angle=0.0, speed=SPEED))
        before(model, data)
        forces.step(data)
        springs = [data.joint(f"{prefix}{axle}_left_suspension").qpos[0] for axle in ("front", "rear")]
        found.append((data.subtree_com[model.body(f"{prefix}base_link").id][2], *springs))
    return extremes(found[400:])


def on_contacts():
    """Each wheel on a plane of MuJoCo's, which is put where it touches the bump: a mesh has several contacts there."""
    spec = fg.Vehicle.load().spec(tires=Tires.load("contact"))
    for wheel in WHEELS:
        body = spec.worldbody.add_body(name=f"under_{wheel}", mocap=True)
        body.add_geom(name=f"under_{wheel}", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 0.1), conaffinity=0)
        next(pair for pair in spec.pairs if pair.name == f"{wheel}_tire").geomname2 = f"under_{wheel}"

    def put(model, data):
        for wheel in WHEELS:
            x = data.body(f"{wheel}_wheel").xpos[0]
            x += RADIUS * slope(x)
            half, place = -0.5 * math.atan(slope(x)), model.body(f"under_{wheel}").mocapid[0]
            data.mocap_pos[place] = x, 0.0, bump(x)
            data.mocap_quat[place] = math.cos(half), 0.0, math.sin(half), 0.0

    return driven(spec.compile(), before=put)


def of_a_half_car():
    """A mass that heaves and pitches on the springs of two axles, each a mass on the springs of its tires."""
    travel, tires = np.array([[1.0, FRONT, -1.0, 0.0], [1.0, -REAR, 0.0, -1.0]]), np.eye(4)[2:]
    masses = np.array([SPRUNG, PITCH_INERTIA, AXLE, AXLE])
    stiffness = SPRINGS * travel.T @ travel + TIRES * tires.T @ tires
    damping = DAMPERS * travel.T @ travel + TIRE_DAMPERS * tires.T @ tires
    place, rate, step, found = np.zeros(4), np.zeros(4), 5e-5, []
    for k in range(30_000):
        x = -1.0 + SPEED * step * k + np.array([FRONT + REAR, 0.0])
        push = tires.T @ (TIRES * bump(x) + TIRE_DAMPERS * SPEED * slope(x))
        rate = rate + step * (push - stiffness @ place - damping @ rate) / masses
        place = place + step * rate
        found.append(((SPRUNG * place[0] + AXLE * place[2:].sum()) / (SPRUNG + 2.0 * AXLE), *(-travel @ place)))
    return extremes(found)


def test_a_smooth_bump_moves_a_car_as_a_linear_half_car_and_as_contacts_of_mujoco_do():
    x, _ = np.meshgrid(np.arange(-3.0, 3.0, CELL), np.arange(-0.5, 0.5, CELL))
    surface = Ground(heights=bump(x), corner=(-3.0, -0.5), cell=CELL)
    ours = driven(LabGround(tires=Tires.load("coulomb"), surface=surface).model, "car/")
    assert np.abs(ours).min() > 4e-4
    assert ours == pytest.approx(of_a_half_car(), rel=0.05)
    assert ours == pytest.approx(on_contacts(), rel=0.05)
