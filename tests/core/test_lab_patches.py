"""Patches of floor: the friction that acts is the one asked for, and nothing else changes."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.errors import SettingsError
from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.friction_patches import (
    Patch,
    add_patches,
    look_at_floor,
    patch_table,
    random_patches,
    wheel_positions,
)
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle


def model_with(tires, *patches):
    """Return a car's compiled model on a floor, and what tells its tires' frictions (4,) where it stands now."""
    spec = Vehicle.load().spec(tires=tires)
    add_patches(spec, patches)
    model = spec.compile()
    car, wheels, table, under = Car(model), wheel_positions(model, ""), patch_table(model), np.empty(4)

    def look(data):
        look_at_floor(*car.pose(data), wheels, table, np.full(4, car.mu), under)
        return under

    return model, car, look


def is_inside(point, patch):
    """Oracle: left of each edge, counterclockwise."""
    corners = patch.corners()
    edges = np.roll(corners, -1, axis=0) - corners
    away = point - corners
    return bool((edges[:, 0] * away[:, 1] - edges[:, 1] * away[:, 0] >= 0.0).all())


@settings(max_examples=30, deadline=None)
@given(
    x=st.floats(-1.0, 1.0), y=st.floats(-1.0, 1.0), heading=st.floats(-4.0, 4.0), turned=st.floats(-4.0, 4.0),
    length=st.floats(0.1, 2.0), width=st.floats(0.1, 2.0),
)  # fmt: skip
def test_each_tire_has_the_friction_of_what_is_under_its_wheel(x, y, heading, turned, length, width):
    patch = Patch(x=0.0, y=0.0, length=length, width=width, heading=turned, mu=0.4)
    model, car, look = model_with(Tires(), patch)
    data = mujoco.MjData(model)
    car.set_pose(data, x, y, heading)
    wheels = [data.body(f"{wheel}_wheel").xpos[:2] for wheel in WHEELS]
    assert look(data).tolist() == [0.4 if is_inside(wheel, patch) else car.mu for wheel in wheels]


@each("mu", [0.2, 0.7])
def test_friction_that_acts_on_a_patch_is_the_one_asked_for(mu):
    """A car put sideways on it slows by mu g: no wheel can roll away from that."""
    patch = Patch(x=0.0, y=0.0, length=40.0, width=40.0, mu=mu)
    model, car, look = model_with(Tires.load("coulomb"), patch)
    data, forces = mujoco.MjData(model), TireForces(model)
    car.set_pose(data, 0.0, 0.0, 0.0)
    forces.begin(data)
    speeds = []
    for step in range(60 + round(2.4 / (9.81 * mu) / model.opt.timestep)):
        if step == 60:  # at rest on its springs
            data.qvel[1] = 3.0
        forces.mu[:] = look(data)
        forces.step(data)
        mujoco.mj_subtreeVel(model, data)
        speeds.append(data.subtree_linvel[model.body("base_link").id, 1])
    used = np.array(speeds[60:])[len(speeds) // 4 :]
    slope = np.polyfit(model.opt.timestep * np.arange(len(used)), used, 1)[0]
    assert -slope / 9.81 == pytest.approx(mu, rel=0.01)


def test_patch_of_the_tires_own_friction_changes_no_bit():
    everywhere = Patch(x=0.0, y=0.0, length=200.0, width=200.0, mu=Vehicle.load().greatest_mu())
    plain, patched = (fg.race("oval", laps=1, patches=patches, tires="coulomb") for patches in ((), (everywhere,)))
    assert plain.trajectory_sha256 == patched.trajectory_sha256


def test_random_patches_are_those_of_the_seed_on_the_track_and_away_from_the_start():
    track = fg.load_track("tight")
    patches = random_patches(track, 6, np.random.default_rng(3), mu=0.5)
    assert patches == random_patches(track, 6, np.random.default_rng(3), mu=0.5)
    assert patches != random_patches(track, 6, np.random.default_rng(4), mu=0.5)
    s, offset = track.project([(patch.x, patch.y) for patch in patches])
    assert (np.diff(s) > 0.0).all() and s[0] > 3.0 and s[-1] < track.length - 3.0
    assert (np.abs(offset) < 0.51 * max(track.corridor_left.max(), track.corridor_right.max())).all()
    for count in (0, -1, 100):
        with pytest.raises(SettingsError, match="accepted: at least 1, and room for each"):
            random_patches(track, count, np.random.default_rng(3), mu=0.5)
