"""Patches of floor: the friction that acts is the one asked for, and nothing else changes."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.errors import SettingsError
from fg_mujoco.lab.lab_laps import drive_laps
from fg_mujoco.lab.patch_manoeuvres import brake_onset, circle, sliding_sideways
from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.friction_patches import Patch, PatchedFloor, add_patches, random_patches
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle


def floor_under(x, y, heading, *patches):
    """Put a car on a floor; return the frictions of its tires' pairs (4,), and the middles of its wheels (4, 2)."""
    spec = Vehicle.load().spec(tires=Tires())
    add_patches(spec, patches)
    model = spec.compile()
    data, floor = mujoco.MjData(model), PatchedFloor(model)
    Car(model).set_pose(data, x, y, heading)
    floor.apply(data.qpos)
    pairs = [model.pair(f"{wheel}_tire").id for wheel in WHEELS]
    assert (model.pair_friction[pairs, 0] == model.pair_friction[pairs, 1]).all()
    assert (model.pair_friction[pairs, 0] == floor.mu).all()
    return floor.mu, np.array([data.body(f"{wheel}_wheel").xpos[:2] for wheel in WHEELS])


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
    mu, wheels = floor_under(x, y, heading, patch)
    assert mu.tolist() == [0.4 if is_inside(wheel, patch) else Vehicle.load().nominal_mu for wheel in wheels]


# Measured at 1 ms: 1.0008, 0.9975
@each("mu", [0.2, 0.7])
def test_friction_that_acts_on_a_patch_is_the_one_asked_for(mu):
    assert sliding_sideways("site", mu) == pytest.approx(mu, rel=0.005)


@each("mu", [0.35, 0.7])
def test_circle_on_a_patch_holds_up_to_its_law_and_widens_beyond(mu):
    # measured: onset .9996; beyond, 1.004 to 1.008 times the square, and .992 to .996 mu g
    radius = 3.0
    driven, slip, _ = circle(mu, radius, 0.97)
    assert driven == pytest.approx(radius, rel=3e-3)
    assert not slip.slides.any()
    driven, _, lateral = circle(mu, radius, 1.1)
    assert driven / radius == pytest.approx(1.1**2, rel=0.02)
    assert lateral == pytest.approx(1.0, abs=0.02)


def test_rear_axle_lets_go_in_braking_on_a_patch_at_its_closed_form():
    assert brake_onset(0.35) == pytest.approx(1.0, abs=0.02)


def test_patch_of_the_tires_own_friction_changes_no_bit_and_without_patches_it_is_race():
    everywhere = Patch(x=0.0, y=0.0, length=200.0, width=200.0, mu=Vehicle.load().nominal_mu)
    expected = fg.race("oval", laps=1)
    for world in (fg.World("oval"), fg.World("oval", patches=(everywhere,))):
        laps = drive_laps(world, laps=1)
        assert laps.trajectory_sha256 == expected.trajectory_sha256
        assert laps.lap_times_s == expected.car.lap_times_s
        assert np.array_equal(laps.telemetry, expected.car.telemetry, equal_nan=True)


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
