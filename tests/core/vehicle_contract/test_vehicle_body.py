"""The body of every vehicle: it lies on the ground, slides as Coulomb says, and is clear of it while the car drives."""

import math

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.vehicle.bodywork import FRICTION, HULL, RESTITUTION
from fg_mujoco.vehicle.car import Car
from fg_mujoco.vehicle.tire_forces import TireForces
from vehicle_worlds import load

every_vehicle = each("name", (*fg.vehicle_names(), "made"))
STEP = 0.005
HALF = math.sqrt(0.5)
ON_ROOF, ON_SIDE, ON_NOSE = (0.0, 1.0, 0.0, 0.0), (HALF, HALF, 0.0, 0.0), (HALF, 0.0, HALF, 0.0)


class Body:
    """A vehicle alone on its ground, with its motor off."""

    def __init__(self, name):
        self.model = load(name).compile()
        self.data, self.car = mujoco.MjData(self.model), Car(self.model)
        motor = self.model.actuator("speed").id
        self.model.actuator_gainprm[motor] = self.model.actuator_biasprm[motor] = 0.0
        self.hull = self.model.geom(HULL).id
        self.corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, 8).T * self.model.geom_size[self.hull]

    def put(self, turn, height, velocity=(0.0, 0.0, 0.0)):
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[2], self.data.qpos[3:7], self.data.qvel[:3] = height, turn, velocity
        mujoco.mj_forward(self.model, self.data)
        self.data.qpos[2] += height - self.lowest  # of the hull
        mujoco.mj_forward(self.model, self.data)
        return self

    @property
    def lowest(self):
        """Of the hull's corners over the ground [m]."""
        turned = self.corners @ self.data.geom_xmat[self.hull].reshape(3, 3).T
        return float((self.data.geom_xpos[self.hull] + turned)[:, 2].min())

    @property
    def energy(self):
        mujoco.mj_energyPos(self.model, self.data)
        mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy.sum())

    @property
    def touches(self):
        return any(self.hull in contact.geom for contact in self.data.contact)

    def run(self, seconds, step=None):
        """Return the heights, energies and speeds after each step (steps, 3)."""
        rows = []
        for _ in range(round(seconds / self.model.opt.timestep)):
            step(self.data) if step else mujoco.mj_step(self.model, self.data)
            rows.append((self.lowest, self.energy, math.hypot(*self.data.qvel[:2])))
        return np.array(rows)


@every_vehicle
@each("turn", (ON_ROOF, ON_SIDE, ON_NOSE), ids=("roof", "side", "nose"))
def test_it_falls_on_the_ground_and_comes_to_rest_on_it(name, turn):
    """A body that fell by .2 m arrives at 2 m/s, which is 10 mm a step: no deeper, and at rest on the ground."""
    body = Body(name).put(turn, 0.2)
    before = body.energy
    heights, energies, _ = body.run(3.0).T
    assert heights.min() > -math.sqrt(2.0 * 9.81 * 0.2) * STEP - 1e-3
    upright = 1.0 - 2.0 * (body.data.qpos[4] ** 2 + body.data.qpos[5] ** 2)
    lies = turn == ON_ROOF or upright < 0.5  # nuc2's CoG is below its chassis: from its side it falls on its wheels
    assert abs(body.lowest) < 1e-3 if lies else body.lowest > 0.01
    assert np.diff(energies, prepend=before).max() < 0.01 * (before - energies.min())


@every_vehicle
def test_a_body_on_its_roof_slides_to_rest_as_coulomb_says(name):
    """From 5 m/s in v^2 / (2 mu g) = 4.25 m, and nothing of it goes into the ground; from 20 m/s likewise."""
    for speed, depth in ((5.0, 3e-3), (20.0, 6e-3)):
        body = Body(name).put(ON_ROOF, 0.0, (speed, 0.0, 0.0))
        x, seconds = body.data.qpos[0], speed / (FRICTION * 9.81)
        heights, energies, _ = body.run(1.2 * seconds).T
        assert body.data.qpos[0] - x == pytest.approx(speed**2 / (2.0 * FRICTION * 9.81), rel=0.03)
        assert heights.min() > -depth and np.diff(energies).max() < 1e-3 * energies[0]


@every_vehicle
def test_a_body_that_falls_flat_bounces_by_its_restitution(name):
    body = Body(name).put(ON_ROOF, 0.3)
    speeds = []
    while not body.touches:
        mujoco.mj_step(body.model, body.data)
        speeds.append(body.data.qvel[2])
    for _ in range(8):
        mujoco.mj_step(body.model, body.data)
        speeds.append(body.data.qvel[2])
    assert max(speeds) / -min(speeds) == pytest.approx(RESTITUTION, abs=0.15)


@every_vehicle
def test_its_body_stays_off_the_ground_while_it_brakes_as_hard_as_it_can(name):
    body, whole = Body(name), load(name).compile()
    body.model.actuator_gainprm[:], body.model.actuator_biasprm[:] = whole.actuator_gainprm, whole.actuator_biasprm
    body.car.set_pose(body.data, 0.0, 0.0, 0.0, 8.0)
    body.data.ctrl[:] = 0.0
    heights, _, speeds = body.run(1.5, TireForces(body.model).step).T
    assert speeds[-1] < 0.3 and heights.min() > 0.005


@every_vehicle
def test_its_hull_is_its_chassis_and_is_no_crash(name):
    body = Body(name).put(ON_ROOF, 0.0)
    body.run(0.2)
    chassis = body.model.geom("chassis").id
    for values in (body.model.geom_size, body.model.geom_pos, body.model.geom_quat):
        assert (values[body.hull] == values[chassis]).all()
    assert body.touches and not body.car.crashed(body.data)


def own_vehicle(tmp_path, edit):
    spec = fg.Vehicle.load("f1tenth").spec()
    edit(spec)
    spec.compile()
    path = tmp_path / "own.xml"
    path.write_text(spec.to_xml(), encoding="utf-8")
    return fg.Vehicle.load(path)


def test_a_chassis_in_the_ground_is_refused_and_a_hull_above_it_accepted(tmp_path):
    def lower(spec):
        spec.geom("chassis").pos[2] -= 0.035

    with pytest.raises(
        fg.ModelError, match=r"geom 'chassis' is 5 mm in the ground at rest; accepted: above the ground"
    ):
        own_vehicle(tmp_path, lower)

    def with_hull(spec):
        lower(spec)
        spec.body("base_link").add_geom(
            name=HULL, type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.29, 0.155, 0.02), pos=(0.17, 0.0, 0.02), mass=0.0,
            contype=0, conaffinity=0,
        )  # fmt: skip

    assert own_vehicle(tmp_path, with_hull).parameters.width == 0.31
