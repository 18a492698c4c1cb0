"""The friction lab on ground that is not level, against closed forms and the plane."""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.errors import SettingsError
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.ground_circles import EXPERIMENT, GroundCircle, closed_form, surface_of
from fg_mujoco.racing.entries import Entry


def measure(kind, value, *, tires="coulomb", mu=0.8, steering=0.1):
    settings = LabSettings(entry=Entry(tires=tires), mus=(mu,))
    (row,) = EXPERIMENT.measure({"mu": mu, "steering": steering, "ground": kind, "value": value}, settings)
    return row


def friction_on(bank, speed, radius, gravity):
    """Friction over load of a point on a bank: gravity and the acceleration inwards, along it and across it."""
    down, inward = gravity, speed**2 / radius
    return (inward * math.cos(bank) - down * math.sin(bank)) / (down * math.cos(bank) + inward * math.sin(bank))


@each("degrees", [-10.0, -5.0, 5.0, 10.0, 15.0, 20.0])
@each("mu", [0.5, 0.8, 1.0])
def test_the_closed_form_of_a_bank_uses_all_of_the_friction(degrees, mu):
    speed = closed_form("bank", degrees, mu, 3.0) * math.sqrt(9.81 * mu * 3.0)
    assert friction_on(math.radians(degrees), speed, 3.0, 9.81) == pytest.approx(mu)


@each("degrees", [-10, 10, 20])
def test_a_car_on_ideal_tires_leaves_its_circle_on_a_bank_at_the_speed_of_the_closed_form(degrees):
    row = measure("bank", degrees)
    assert row["leaves_over_law"] == pytest.approx(row["closed_form_over_law"], rel=0.035)
    assert row["load_over_closed_form"] == pytest.approx(1.0, rel=0.01)


@each("tires", ["coulomb", "f1tenth"])
def test_the_default_car_and_the_ideal_one_are_within_six_hundredths_of_it_on_ten_degrees(tires):
    row = measure("bank", 10, tires=tires, steering=0.2)
    assert row["leaves_over_law"] == pytest.approx(row["closed_form_over_law"], rel=0.06)
    assert row["safe"] == (tires == "f1tenth")  # the shaft makes ideal tires slide at .2 rad at any speed


def test_on_a_crest_a_tire_slides_by_the_closed_form_earlier_than_on_the_plane():
    plane, crest = measure("bank", 0), measure("crest", 16)
    share = crest["slides_over_law"] / plane["slides_over_law"]
    assert share == pytest.approx(crest["closed_form_over_law"], rel=0.02)
    assert crest["load_over_closed_form"] == pytest.approx(1.0, rel=0.01)
    sag = measure("crest", -16)
    assert sag["load_over_closed_form"] == pytest.approx(1.0, rel=0.01)
    assert math.isnan(sag["slides_over_law"]) and "crests" in sag["reason"]


def test_the_load_varies_twice_as_much_on_the_next_class_of_roughness_and_not_on_the_plane():
    varies = [measure("roughness", each)["load_variation"] for each in "BCD"]
    assert np.diff(np.log2(varies)) == pytest.approx(1.0, rel=0.05)
    assert measure("bank", 0)["load_variation"] < 1e-3


@each("radius", [1.6, 3.3])
@each("crest", [8.0, -8.0])
def test_a_crest_has_its_radius_along_the_circle(crest, radius):
    angles = np.array([-0.15, 0.0, 0.15])
    before, top, after = surface_of("crest", crest, radius).at(
        radius * np.column_stack((np.sin(angles), -np.cos(angles)))
    )
    assert (before + after - 2.0 * top) / (0.15 * radius) ** 2 == pytest.approx(-1.0 / crest, rel=0.06)


def test_no_circle_ends_where_the_bank_holds_the_car_and_contacts_cannot_stand_on_it():
    assert closed_form("bank", 46.0, 1.0, 2.0) == math.inf == closed_form("crest", -1.0, 1.0, 2.0)
    with pytest.raises(SettingsError, match="'contact' on ground that is not level; accepted"):
        GroundCircle(0.8, 0.1, LabSettings(entry=Entry(tires="contact")), "bank", 5.0)
