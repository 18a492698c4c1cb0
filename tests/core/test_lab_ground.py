"""The friction lab on ground that is not level, against closed forms and the plane."""

import math

import numpy as np
import pytest

from cases import each
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.ground_circles import EXPERIMENT, closed_form
from fg_mujoco.racing.entries import Entry


def measure(kind, value, *, tires="coulomb"):
    settings = LabSettings(entry=Entry(tires=tires), mus=(0.8,))
    (row,) = EXPERIMENT.measure({"mu": 0.8, "steering": 0.1, "ground": kind, "value": value}, settings)
    return row


@each("tires, near", [("coulomb", 0.035), ("f1tenth", 0.06)])
@each("degrees", [-10, 10, 20])
def test_a_car_leaves_its_circle_on_a_bank_at_the_speed_of_the_closed_form(degrees, tires, near):
    row = measure("bank", degrees, tires=tires)
    assert row["leaves_over_law"] == pytest.approx(row["closed_form_over_law"], rel=near)
    assert row["load_over_closed_form"] == pytest.approx(1.0, rel=0.01)
    assert row["safe"] == (degrees > 0)


def test_on_a_crest_a_tire_slides_by_the_closed_form_earlier_than_on_the_plane():
    plane, crest = measure("bank", 0), measure("crest", 16)
    share = crest["slides_over_law"] / plane["slides_over_law"]
    assert share == pytest.approx(crest["closed_form_over_law"], rel=0.02)
    assert crest["load_over_closed_form"] == pytest.approx(1.0, rel=0.01)
    sag = measure("crest", -16)
    assert sag["load_over_closed_form"] == pytest.approx(1.0, rel=0.01)
    assert math.isnan(sag["slides_over_law"]) and "crests" in sag["reason"]
    assert "'contact' on ground that is not level" in measure("crest", 16, tires="contact")["reason"]


def test_the_load_varies_twice_as_much_on_the_next_class_of_roughness_and_not_on_the_plane():
    varies = [measure("roughness", each)["load_variation"] for each in "BCD"]
    assert np.diff(np.log2(varies)) == pytest.approx(1.0, rel=0.05)
    assert measure("bank", 0)["load_variation"] < 1e-3


def test_no_circle_ends_where_the_bank_holds_the_car():
    assert closed_form("bank", 46.0, 1.0, 2.0) == math.inf == closed_form("crest", -1.0, 1.0, 2.0)
