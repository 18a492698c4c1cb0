"""Sets of tires: their curves against closed forms, their files, and what is refused."""

import hashlib
import json
import math
import re
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fg_mujoco.vehicle.tires import (
    DEFAULT_TIRES,
    IDEAL_TIRES,
    LAWS,
    Brush,
    Coulomb,
    Linear,
    MagicFormula,
    Tires,
    curve_force,
    tire_names,
)
from fg_mujoco.vehicle.tires.sampled import sampled

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
    least = 5 if Tires.load(name).model == "coulomb" else 8
    assert len(numbers) >= least or any(line.startswith("like = ") for line in lines)
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


def test_a_set_of_the_vehicles_friction_is_scaled_to_it():
    bare, car = Tires.load(IDEAL_TIRES), fg.Vehicle.load()
    assert bare.peak is None and bare.least_peak is None and bare.least_share == 1.0
    worn = bare.on(0.7)
    assert worn.peak == worn.least_peak == worn.axles[1].longitudinal.D == 0.7 and worn.on(0.4) == worn
    assert car.reliable_mu(bare) == car.greatest_mu(bare) == 1.0489
    assert Tires.load("contact").on(0.7) == Tires.load("contact")
    split = bare.on(0.5, 0.7)
    assert [axle.lateral.peak for axle in split.axles] == [0.5, 0.7] and split.least_share == pytest.approx(5.0 / 7.0)


@each("tires", ["f1tenth", "forzaeth_nuc6"])
def test_a_car_that_is_written_keeps_its_friction_when_it_is_read_again(tmp_path, tires):
    path, spec = tmp_path / "car.xml", fg.Vehicle.load("f1tenth").spec(tires=fg.Tires.load(tires))
    for _ in range(3):
        path.write_text(spec.to_xml())
        spec = fg.Vehicle.load(path).spec()
        own = [spec.pair(f"{axle}_left_tire").friction[0] for axle in ("front", "rear")]
        assert own == pytest.approx([0.940927, 1.0489], rel=1e-5)


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
        ('like = "nuc99"', "wet.toml: like: tires 'nuc99' are not known; accepted: "),
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
    soft = "stiffness = 5.0\nrelaxation_length = 0.045\n"
    path.write_text(f'model = "coulomb"\n[front]\n{soft}[rear]\n{soft}')
    assert fg.Tires.load(path).peak is None and fg.Vehicle.load().greatest_mu(fg.Tires.load(path)) == 1.0489
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


# -- any law


@st.composite
def any_law(draw):
    """A law of each kind, and what the native core knows of it as one of a user's own."""
    d = draw(st.floats(0.2, 1.5))
    stiffness = draw(st.floats(3.0, 60.0))
    kind = draw(st.sampled_from((Coulomb, Brush, Linear, MagicFormula)))
    if kind is MagicFormula:
        law = MagicFormula(B=stiffness / 1.5 + 3.0, C=draw(st.floats(1.2, 1.9)), D=d, E=draw(st.floats(-2.0, 0.8)))
    else:
        law = kind(D=d, stiffness=stiffness)
    return draw(st.sampled_from((law, sampled(law, "drawn"))))


@given(any_law(), st.lists(st.floats(0.0, 1.5), min_size=2, max_size=40))
def test_a_law_is_odd_steady_bounded_by_its_peak_and_begins_with_its_slope(law, slips):
    slips, number, row = sorted(slips), LAWS.index(type(law)), law.row()
    forces = [law.force(slip) for slip in slips]
    assert [law.force(-slip) for slip in slips] == [-force for force in forces]
    assert [curve_force(number, row, slip) for slip in slips] == pytest.approx(forces, rel=1e-12, abs=1e-15)
    steepest = 1.1 * law.slope * np.diff(slips) + 1e-6
    assert (np.abs(np.diff(forces)) <= np.maximum(steepest, 1.1 * np.abs(np.diff(slips)) * law.peak * 20.0)).all()
    assert law.force(1e-8) == pytest.approx(1e-8 * law.slope, rel=1e-3)
    if law.has_peak:
        assert max(forces) <= law.peak * (1.0 + 1e-9) and law.force(law.peak_slip) >= 0.98 * law.peak
    doubled = law.scaled(0.5)
    assert [doubled.force(slip) for slip in slips] == pytest.approx([0.5 * f for f in forces], abs=1e-12)
    assert type(law).unpacked(law.packed()) == law


@each("law", [MagicFormula(B=10.0, C=1.6, D=1.1, E=0.3), Brush(D=1.0, stiffness=200.0), Linear(D=1.0, stiffness=5.0)])
def test_a_sampled_law_is_near_the_law(law):
    found = sampled(law, "mine")
    for slip in np.linspace(0.0, 1.2, 2001):
        used = min(slip, law.peak_slip) if law.holds else min(slip, 1.0)
        assert found.force(slip) == pytest.approx(law.force(used), abs=2e-4 * law.peak)
    assert (found.holds, found.has_peak) == (law.holds, law.has_peak)


OWN_LAW = """
import math
from dataclasses import dataclass
from fg_mujoco.vehicle.tires import Law
@dataclass(frozen=True, kw_only=True)
class Mine(Law):
    D: float
    peak_slip = 0.2
    slope = property(lambda self: self.D * math.pi / 0.4)
    peak = property(lambda self: self.D)
    def force(self, slip):
        return math.copysign(self.D * math.sin(math.pi / 0.4 * min(abs(slip), 0.3)), slip)
"""


def own_set(folder, law=OWN_LAW, model="mine.py:Mine"):
    axle = "D = 0.9\nrelaxation_length = 0.02\n"
    (folder / "mine.py").write_text(law)
    (folder / "mine.toml").write_text(f'model = "{model}"\n[front]\n{axle}[rear]\n{axle}')
    return folder / "mine.toml"


def test_a_law_in_a_file_drives_races_rollouts_and_replays_which_run_none_of_its_code(tmp_path):
    path = own_set(tmp_path)
    tires = Tires.load(path)
    assert tires.law == f"mine.py:Mine, sha256 {hashlib.sha256(OWN_LAW.encode()).hexdigest()}"
    assert tires == Tires.load(own_set(tmp_path, model="mine.py")) and tires.peak == 0.9 and tires.slides
    short = {"tires": tires, "laps": 1, "time_limit": 1.5}
    race = fg.race("oval", **short)
    folder = fg.write_run(race, tmp_path / "run")
    (tmp_path / "mine.py").write_text("raise SystemExit")
    assert fg.replay(folder).identical
    settings = json.loads((folder / "summary.json").read_text())["settings"]
    assert settings["tires"]["law"] == tires.law
    again = fg.race(fg.Setup.read(settings))
    assert again.trajectory_sha256 == race.trajectory_sha256
    for workers in (1, 2):
        assert fg.rollout("oval", n=2, seed=0, workers=workers, **short).setup(1).first.tire_set == tires


@each(
    ("old", "new", "said"),
    [
        ("math.copysign(", "abs(", r"force\(.*\) fails: TypeError"),
        ("def force(self, slip)", "def force(self)", r"force\(0\) fails: TypeError: .*; accepted: force\(self, sl"),
        ("self.D * math.sin", "math.nan * math.sin", r"force\(0\) is nan and force\(-0\) is nan; accepted: finite"),
        ("math.copysign(self.D", "(lambda a, b: a)(self.D", r"force\(.*\) is .*; accepted: finite numbers, the"),
        ("peak_slip = 0.2", "peak_slip = 0.1", r"the peak is 0.9 at a slip of 0.1, but the force is 0.636"),
        ("lambda self: self.D)", "lambda self: 0.8)", r"the peak is 0.8 .* and greatest, 0.9, at 0.199; acc"),
        ("lambda self: self.D)", "lambda self: [1])", r"peak fails: TypeError"),
        ("peak_slip = 0.2", "peak_slip = math.inf", r"it has no peak, but its force falls past a slip of 0.199"),
        ("lambda self: self.D)", "lambda self: 4.5)", r"peak, the friction that planners assume, is 4.5; .* 0.9, the"),
        ("/ 0.4)", "/ 0.3)", r"slope is 9.42478, but the force has 7.069 per rad"),
        ("self.D * math.sin", "(slip > 0.25 and 0.2) + self.D * math.sin", r"force\(0.25.*\) is .*; accepted: finite"),
        ("self.D * math.sin(", "(abs(slip) < 0.25) * self.D * math.sin(", r"the force jumps at a slip of 0.2"),
        ("return", "exit(); return", r"force\(0\) fails: SystemExit"),
        ("import math", "raise SystemExit(0)", r"tire law mine.py does not import: SystemExit: 0"),
        ("import math", "import nothing_such", r"tire law mine.py does not import: ModuleNotFoundError"),
        ("class Mine", "class Other", r"tire law mine.py has no Mine; accepted: Other"),
        ("(Law)", "", r"tire law mine.py has no Mine; accepted: a subclass of Law there"),
    ],
)
def test_a_law_that_is_not_what_it_says_is_refused_in_one_line(tmp_path, old, new, said):
    assert OWN_LAW.count(old) >= 1
    with pytest.raises(fg.SettingsError, match=said) as error:
        Tires.load(own_set(tmp_path, OWN_LAW.replace(old, new, 1)))
    assert "\n" not in str(error.value) and "accepted: " in str(error.value) and "mine" in str(error.value)


def test_a_law_is_found_by_the_name_that_a_package_registers(tmp_path, monkeypatch):
    (tmp_path / "some_laws.py").write_text(OWN_LAW)
    info = tmp_path / "some_laws-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-laws\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[fg_mujoco.tire_laws]\nmine = some_laws:Mine\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert Tires.load(own_set(tmp_path, model="mine")).law == "mine"
    with pytest.raises(fg.SettingsError, match=r"model is 'min'; accepted: .* or path/to/law.py:Class"):
        Tires.load(own_set(tmp_path, model="min"))
