"""Sets of tires: their curves against closed forms, their files, and what is refused."""

import json
import math
import re
from importlib.resources import files

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.vehicle.tires import (
    DEFAULT_TIRES,
    IDEAL_TIRES,
    LAWS,
    NUMBERS,
    Brush,
    Coulomb,
    Linear,
    MagicFormula,
    Tires,
    curve_force,
    tire_names,
)

FOLDER = files("fg_mujoco.models") / "tires"
NAMES = [name for name in tire_names() if name != "contact"]
PLAIN = """
model = "magic_formula"
[front]
B = 10.0
C = 1.5
D = 1.0
E = 0.5
relaxation_length = 0.05
[rear]
B = 10.0
C = 1.5
D = 0.9
E = 0.5
relaxation_length = 0.05
"""


@each("name", NAMES)
def test_each_number_of_a_set_says_its_unit_and_source(name):
    lines = (FOLDER / f"{name}.toml").read_text("utf-8").splitlines()
    numbers = [line for line in lines if re.match(r"\w+ = [-\d.]", line)]
    assert len(numbers) >= 8 or any(line.startswith("like = ") for line in lines)
    for line in numbers:
        assert re.search(r"  # \[[^\]]+\] .{8,}", line), line


@each("name", NAMES)
def test_a_set_is_read_back_from_what_it_says_of_itself(name):
    tires = fg.Tires.load(name)
    again = Tires.load(json.loads(json.dumps(tires.described())))
    assert again == tires and again.name == name and again.sha256 == tires.sha256
    assert len({Tires.load(other).sha256 for other in NAMES}) == len(NAMES)


@each("name", NAMES)
def test_curves_are_the_formula_up_to_their_peak_and_never_fall_below_the_share_that_slides(name):
    for axle in Tires.load(name).on(1.0489).axles:
        for curve in (axle.lateral, axle.longitudinal):
            slips = np.linspace(0.0, 1.0, 1001)
            forces = np.array([curve.force(slip) for slip in slips])
            assert [curve.force(-slip) for slip in slips[1:]] == (-forces[1:]).tolist()
            if not isinstance(curve, MagicFormula):
                continue  # their closed forms are below
            x = curve.B * slips
            formula = curve.D * np.sin(curve.C * np.arctan(x - curve.E * (x - np.arctan(x))))
            held = slips <= curve.hold_slip
            np.testing.assert_allclose(forces[held], formula[held], rtol=1e-12)
            np.testing.assert_allclose(forces[~held], curve.sliding_share * curve.peak, rtol=1e-9)
            assert curve.peak == pytest.approx(forces.max(), rel=1e-4)
            assert (forces[slips > curve.peak_slip] >= curve.sliding_share * curve.peak * (1.0 - 1e-9)).all()
            assert curve.force(1e-6) == pytest.approx(1e-6 * curve.B * curve.C * curve.D, rel=1e-4)


CLOSED_FORMS = (
    (Coulomb(D=0.9, stiffness=80.0), lambda slip: 0.9 * np.minimum(80.0 * slip, 1.0), 1.0 / 80.0, 0.9),
    (Linear(D=0.9, stiffness=5.0), lambda slip: 4.5 * slip, math.inf, 0.9),
    # Fiala's: bristles under a load that is a parabola over the patch, x = stiffness slip / 3
    (
        Brush(D=1.2, stiffness=15.0),
        lambda slip: (
            1.2 * np.where(slip < 0.2, 15.0 * slip - (15.0 * slip) ** 2 / 3.0 + (15.0 * slip) ** 3 / 27.0, 1.0)
        ),
        0.2,
        1.2,
    ),
)


@each(("law", "formula", "peak_slip", "peak"), CLOSED_FORMS, ids=lambda each: type(each).__name__)
def test_laws_are_their_closed_forms(law, formula, peak_slip, peak):
    slips = np.linspace(0.0, 1.0, 1001)
    forces = np.array([law.force(slip) for slip in slips])
    np.testing.assert_allclose(forces, formula(slips), rtol=1e-12, atol=1e-15)
    assert [law.force(-slip) for slip in slips[1:]] == (-forces[1:]).tolist()
    assert (law.peak_slip, law.peak) == (pytest.approx(peak_slip), peak)
    assert law.force(1e-7) == pytest.approx(1e-7 * law.slope, rel=1e-5)


@each("law", [*(each[0] for each in CLOSED_FORMS), MagicFormula(B=10.0, C=1.6, D=1.1, E=0.3)])
def test_the_kernel_of_a_law_is_its_force(law):
    assert len(law.numbers) <= NUMBERS
    for slip in np.linspace(0.0, 1.0, 201):
        assert curve_force(LAWS.index(type(law)), law.row(), slip) == pytest.approx(law.force(slip), rel=1e-14)


def test_a_set_of_the_vehicles_friction_is_scaled_to_it():
    bare, car = Tires.load(IDEAL_TIRES), fg.Vehicle.load()
    assert bare.peak is None and bare.least_peak is None and bare.least_share == 1.0
    worn = bare.on(0.7)
    assert worn.peak == worn.least_peak == worn.axles[1].longitudinal.D == 0.7 and worn.on(0.4) == worn
    assert car.reliable_mu(bare) == car.greatest_mu(bare) == 1.0489
    assert Tires.load("contact").on(0.7) == Tires.load("contact")
    split = bare.on(0.5, 0.7)
    assert [axle.lateral.peak for axle in split.axles] == [0.5, 0.7] and split.least_share == pytest.approx(5.0 / 7.0)


def test_the_default_set_has_measured_curves_and_the_friction_of_a_race():
    """Of `ipz`, whose front tires let go first, all forces times one number; planners are told the curves as scaled."""
    measured, car = Tires.load("ipz"), fg.Vehicle.load()
    assert car.tires == Tires.load(DEFAULT_TIRES) and car.greatest_mu() == 1.0489
    assert car.nominal_mu == pytest.approx(1.0489 * measured.least_share) and measured.least_share < 0.9
    scaled, share = car.tires.on(1.0489), 1.0489 / measured.peak
    for ours, own in zip(scaled.axles, measured.axles, strict=True):
        assert ours.relaxation_length == own.relaxation_length and ours.lateral.peak_slip == own.lateral.peak_slip
        for slip in (0.02, 0.1, 0.5):
            assert ours.lateral.force(slip) == pytest.approx(share * own.lateral.force(slip), rel=1e-12)
    told = car.parameters
    assert (told.front_peak, told.rear_peak) == pytest.approx([a.lateral.peak for a in scaled.axles], rel=1e-5)
    assert told.front_cornering_stiffness == pytest.approx(share * measured.axles[0].lateral.slope, rel=1e-5)
    assert fg.World("oval", mu=0.7).car.mu == pytest.approx(0.7, rel=1e-5)
    assert fg.World("oval").car.mu == pytest.approx(1.0489, rel=1e-5)


def test_a_file_says_only_in_what_it_differs_from_a_set_that_it_is_like(tmp_path):
    path = tmp_path / "wet.toml"
    path.write_text('like = "forzaeth_nuc6"\nfriction = "vehicle"\nfloor = "a wet hall"\n')
    wet, dry = Tires.load(path), Tires.load("forzaeth_nuc6")
    assert (wet.front, wet.rear, wet.floor, wet.name) == (dry.front, dry.rear, "a wet hall", "wet")
    assert wet.peak is None and wet.on(dry.peak) == dry and wet.sha256 != dry.sha256
    for text, said in (
        ('like = "nuc99"', "tires 'nuc99' are not known; accepted: "),
        ("like = 3", "like is 3; accepted: the name of a bundled set"),
        ('like = "ipz"\nfriction = "mine"', "friction is 'mine'; accepted: 'vehicle', or none"),
    ):
        path.write_text(text)
        with pytest.raises(fg.SettingsError, match=re.escape(said)):
            Tires.load(path)


def test_the_peak_is_that_of_the_closed_form():
    """D where C atan(Phi) is a quarter turn: without E at B s = tan(pi / 2 C)."""
    curve = MagicFormula(B=10.0, C=1.6, D=1.1)
    assert curve.peak_slip == pytest.approx(math.tan(math.pi / 3.2) / 10.0, abs=1e-6) and curve.falls
    assert curve.peak == pytest.approx(1.1, rel=1e-9)
    # with E above 1 Phi itself turns back, where B s = sqrt(1 / (E - 1)), before the quarter turn
    nuc2 = Tires.load("forzaeth_nuc2").axles[1].lateral
    assert nuc2.peak_slip == pytest.approx(math.sqrt(1.0 / 0.2875) / 7.1036, abs=1e-6)
    assert nuc2.peak < 0.95 * nuc2.D


def test_a_curve_that_does_not_fall_has_its_peak_near_its_greatest_force():
    coulomb = MagicFormula(B=150.0, C=1.0, D=1.0489, E=-4.0)
    assert not coulomb.falls and coulomb.hold_slip == 1.0
    assert coulomb.force(coulomb.peak_slip) == pytest.approx(0.99 * coulomb.force(1.0), rel=1e-9)
    assert coulomb.peak == coulomb.force(1.0) == pytest.approx(1.0489, rel=1e-4)


def test_peaks_and_load_sensitivity():
    nuc2, slipx = Tires.load("forzaeth_nuc2"), Tires.load("slipx_reference")
    assert nuc2.peak == pytest.approx(1.2307, rel=1e-6) and nuc2.least_peak == nuc2.axles[1].lateral.peak
    assert slipx.peak == pytest.approx(1.10) and slipx.least_peak == pytest.approx(1.05)  # along the heading
    axle = slipx.axles[0]
    assert 8.58 * axle.load_factor(8.58) * slipx.peak == pytest.approx(9.44, abs=0.005)  # SlipX's worked example
    assert 17.17 * axle.load_factor(17.17) * slipx.peak == pytest.approx(17.02, abs=0.01)
    assert Tires.load("contact").is_contact and Tires.load("contact").peak is None
    assert Tires.load("f1tenth_gym").peak == 1.0489


def test_a_file_of_ones_own_is_read(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(PLAIN)
    tires = fg.Tires.load(path)
    assert tires == Tires.load(str(path)) and tires.name == "mine" and tires.peak == pytest.approx(1.0)
    assert tires.axles[0].longitudinal == tires.axles[0].lateral and tires.axles[0].load_sensitivity == 0.0
    path.write_text(PLAIN + "[rear.longitudinal]\nB = 12.0\nC = 1.5\nD = 0.8\nE = 0.0\n")
    assert fg.Tires.load(path).axles[1].longitudinal == MagicFormula(B=12.0, C=1.5, D=0.8, E=0.0)


@each(
    ("old", "new", "said"),
    [
        ("D = 1.0\n", "D = 0.0\n", r"\[front\]: D is 0.0; accepted: above 0, up to 3"),
        ("D = 1.0\n", "", r"\[front\]: has no D; accepted: B, C, D, E of 'magic_formula'"),
        ("B = 10.0\n", "B = 0.2\n", r"\[front\]: MagicFormula has no peak: B 0.2, C 1.5, E 0.5 reach 0.\d+ of D"),
        ("B = 10.0\n", "B = 10.0\nG = 1.0\n", r"\[front\]: has 'G'; accepted: B, C, D, E"),
        ("length = 0.05", "length = -0.05", r"\[front\]: relaxation_length is -0.05; accepted: 0.001 to 1 m"),
        ("relaxation_length = 0.05", "", r"\[front\]: has no relaxation_length"),
        ("[rear]", "[raer]", r"mine.toml: has 'raer'; accepted: .*did you mean 'rear'"),
        (
            "magic_formula",
            "magic",
            r"mine.toml: model is 'magic'; accepted: contact, coulomb, magic_formula, linear, brush",
        ),
        ('"magic_formula"', '"linear"', r"\[front\]: has 'B'; accepted: stiffness, D"),
        ('"magic_formula"', '"coulomb"', r"\[front\]: has 'B'; accepted: D, stiffness"),
        (
            "[rear]",
            "vertical_stiffness = 5\n[rear]",
            r"\[front\]: vertical_stiffness is 5; accepted: 100 to 1000000 N/m",
        ),
        ("[rear]", "rolling_resistance = -0.1\n[rear]", r"\[front\]: rolling_resistance is -0.1; accepted: 0 to 0.5"),
        ('"magic_formula"', '"contact"', r"mine.toml: has a table \[front\]"),
        ("[front]", "[front", r"mine.toml: is no TOML: .*; accepted"),
        ("[rear]", "load_sensitivity = 2.0\n[rear]", r"\[front\]: load_sensitivity is 2.0; accepted: 0 to 0.5"),
    ],
)
def test_a_bad_file_is_refused_in_one_line_that_names_it(tmp_path, old, new, said):
    path = tmp_path / "mine.toml"
    path.write_text(PLAIN.replace(old, new, 1))
    with pytest.raises(fg.SettingsError, match=rf"^tire file .*{said}") as error:
        Tires.load(path)
    assert "\n" not in str(error.value) and "accepted: " in str(error.value)


def test_a_step_too_long_for_the_stiffness_of_tires_is_refused_in_one_line(tmp_path):
    axle = "D = 1.0489\nstiffness = 1000.0\nrelaxation_length = 0.001\n"
    path = tmp_path / "hard.toml"
    path.write_text(f'model = "coulomb"\n[front]\n{axle}[rear]\n{axle}')
    with pytest.raises(
        fg.ModelError, match=r"^timestep is 0.005 s with tires so stiff; accepted: up to 0.00272 s, or tires with less"
    ):
        fg.Simulation(fg.World("oval", tires=path))
