"""The skidpad against an independent one, a car on four wheels solved by scipy, and against closed forms."""

import math
from functools import cache

import mujoco
import numpy as np
import pytest
from scipy.optimize import fsolve

from cases import each
from fg_mujoco.controllers.control.speed import lifting_share
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.lab import run_lab
from fg_mujoco.lab.lab_ground import LabGround
from fg_mujoco.lab.limits import SteadyLimits
from fg_mujoco.lab.skidpad import EXPERIMENT
from fg_mujoco.lab.steady_circle import SteadyCircle, UnreachableError
from fg_mujoco.racing.entries import Entry
from fg_mujoco.vehicle.changes import CarChanges
from fg_mujoco.vehicle.tires import AxleTires, MagicFormula, Tires
from fg_mujoco.vehicle.vehicle import Vehicle
from vehicle_worlds import open_file, with_drive_line

CAR = Vehicle.load().parameters
G = 9.81
WHEELBASE = 0.36  # [m]
CURVES = {"front": (14.0, 1.45, 1.0, 0.2), "rear": (14.0, 1.45, 1.0, 0.2)}
"""B, C, D, E of the car made here."""


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A car of wheelbase .36 m and 4.6 kg on Magic Formula tires, from a copy of f1tenth.xml; its settings."""
    folder = tmp_path_factory.mktemp("own")
    spec = mujoco.MjSpec.from_string(Vehicle.load().text)
    for side in ("left", "right"):
        for body in list(spec.bodies):
            if body.name.startswith(f"front_{side}") and body.parent.name in ("base_link", "chassis"):
                body.pos[0] += WHEELBASE - CAR.wheelbase
    grid = np.linspace(-0.42, 0.42, 400)
    for side, name in ((1, "left"), (-1, "right")):  # Ackermann's angles of this wheelbase
        aim = np.arctan(np.tan(grid) / (1.0 - side * 0.5 * CAR.track_width / WHEELBASE * np.tan(grid)))
        powers = grid[:, None] ** np.arange(1, 5)
        spec.equality(f"ackermann_{name}").data[1:5] = np.linalg.lstsq(powers, aim, rcond=None)[0]
    (folder / "own.xml").write_text(spec.to_xml())
    axles = {
        name: AxleTires(**dict.fromkeys(("lateral", "longitudinal"), MagicFormula(B=b, C=c, D=d, E=e)),
                        relaxation_length=0.05)
        for name, (b, c, d, e) in CURVES.items()
    }  # fmt: skip
    tires = Tires(model="magic_formula", name="own", **axles)
    return Entry(vehicle=folder / "own.xml", tires=tires, changes=CarChanges(mass=4.6))


def curve(slip, b, c, d, e):
    x = b * slip
    return d * np.sin(c * np.arctan(x - e * (x - np.arctan(x))))


def peak_slip(b, c, d, e):
    grid = np.linspace(0.0, 1.0, 200_001)
    return grid[np.argmax(curve(grid, b, c, d, e))]


@cache
def skidpad(car, steering, mu, shaft):
    """The speed at which the first tire passes its peak: forces and moments of a rigid car with loads by moments."""
    lf, lr, b, half = car.front_axle_distance, car.rear_axle_distance, car.wheelbase, 0.5 * car.track_width
    angles = np.array([math.atan(b / (b / math.tan(steering) - side * half)) for side in (1, -1)] + [0.0, 0.0])
    x, y = np.array([lf, lf, -lr, -lr]), half * np.array([1.0, -1.0, 1.0, -1.0])
    curves = np.array([CURVES["front"]] * 2 + [CURVES["rear"]] * 2).T.copy()
    curves[2] *= mu / max(CURVES["front"][2], CURVES["rear"][2])
    peaks = np.array([peak_slip(*own) for own in curves.T])
    height = car.center_of_gravity_height

    def state(unknown, speed):
        across, yaw, *surface = unknown  # at the centre of gravity; surface speeds over the wheels' own
        vx = math.sqrt(max(speed**2 - (across - lr * yaw) ** 2, 0.0))  # `speed` is the rear axle's
        u, v = vx - yaw * y, across + yaw * x
        forward, aside = u * np.cos(angles) + v * np.sin(angles), v * np.cos(angles) - u * np.sin(angles)
        along, slip = np.array(surface), -aside / forward
        size = np.hypot(along, slip) + 1e-12
        ax, ay = -yaw * across, yaw * vx
        moved_x, gyro = ax * height, ay * (height + 4.0 * car.wheel_inertia / (car.mass * car.wheel_radius))
        axles = car.mass * np.array([G * lr - moved_x, G * lr - moved_x, G * lf + moved_x, G * lf + moved_x]) / (2 * b)
        shares = np.array([lr, lr, lf, lf]) / b
        loads = axles - car.mass * gyro * shares * y / (2.0 * half) ** 2 * 2.0
        force = loads * curve(size, *curves) / size
        fx, fy = force * along, force * slip
        return fx, fy, loads, size, forward * (1.0 + along), ax, ay

    def balance(unknown, speed):
        fx, fy, _, _, surface, ax, ay = state(unknown, speed)
        body_x, body_y = fx * np.cos(angles) - fy * np.sin(angles), fx * np.sin(angles) + fy * np.cos(angles)
        tied = surface[:2].mean() - surface[2:].mean() if shaft else fx[0] - fx[2]
        return [body_x.sum() - car.mass * ax, body_y.sum() - car.mass * ay, (x * body_y - y * body_x).sum(),
                fx[0] - fx[1], fx[2] - fx[3], tied]  # fmt: skip

    speed, guess = 0.3 * math.sqrt(mu * G * b / math.tan(steering)), np.zeros(6)
    guess[1] = speed * math.tan(steering) / b
    guess[0] = lr * guess[1]
    step = 0.2 * speed
    greatest = 1.6 / 0.3 * speed
    while step > 1e-4 * speed:
        if speed > greatest:
            return math.inf
        found, _, fine, _ = fsolve(balance, guess, args=(speed + step,), full_output=True, xtol=1e-12)
        _, _, loads, size, *_ = state(found, speed + step)
        if fine == 1 and (loads > 0.0).all() and (size < peaks).all():
            speed, guess = speed + step, found
        else:
            step *= 0.5
    return speed


@pytest.mark.slow
def test_the_onset_on_a_car_made_here_is_within_two_percent_of_an_independent_skidpad(own):
    settings = LabSettings(entry=own, mus=(0.3, 0.55, 0.8, 1.05), steerings=(0.05, 0.1, 0.2, 0.4))
    ((chapter),) = run_lab(["skidpad"], settings=settings, workers=1).chapters
    car = settings.ground(1.0).car.parameters
    assert (car.wheelbase, car.mass) == (pytest.approx(WHEELBASE, abs=1e-6), pytest.approx(4.6, rel=1e-3))
    for row in chapter.rows:
        speed = row["slides_over_law"] * row["law_speed_m_s"]
        assert speed == pytest.approx(skidpad(car, row["steering_rad"], row["mu"], car.shaft), rel=0.02), row


@cache
def measure(mu, steering, **entry):
    mus = None if mu is None else (mu,)
    settings = LabSettings(entry=Entry(**{"tires": "coulomb"} | entry), mus=mus, steerings=(steering,))
    (row,) = EXPERIMENT.measure(*EXPERIMENT.cells(settings), settings)
    return row


# In turns tighter than .05 rad a shaft makes ideal tires slide sooner; the law leaves out load transfer and 1 / cos d
@each(("mu", "steering", "off"), [(0.5, 0.05, 0.02), (1.0489, 0.05, 0.02), (1.0489, 0.2, 0.02), (1.0489, 0.4, 0.03)])
def test_ideal_tires_slide_by_the_law_and_nearer_by_the_rigid_car(mu, steering, off):
    row = measure(mu, steering, **({} if steering == 0.05 else {"vehicle": open_file()}))
    assert row["slides_over_law"] == pytest.approx(1.0, abs=off)
    assert row["slides_over_law"] == pytest.approx(row["slides_over_law_of_rigid_car"], rel=0.015)
    assert row["leaves_arc_over_law"] == pytest.approx(row["leaves_arc_over_law_of_rigid_car"], rel=0.01)
    assert row["curvature_at_law"] == pytest.approx(row["curvature_at_law_of_rigid_car"], abs=0.01)
    assert row["ends_by"] == "grip" and row["safe"] == (row["slides_over_law"] > 1.0)


def test_measured_tires_understeer_as_a_rigid_car_does_before_they_slide():
    row = measure(0.968, 0.2, tires="forzaeth_nuc6")
    assert row["ends_by"] == "understeer" and not row["safe"] and math.isinf(row["slides_over_law"])
    assert row["leaves_arc_over_law"] == pytest.approx(row["leaves_arc_over_law_of_rigid_car"], rel=0.02)
    assert row["curvature_at_law"] == pytest.approx(row["curvature_at_law_of_rigid_car"], abs=0.02)


def test_a_law_that_stands_still_is_safe_and_its_curvature_is_no_number(tmp_path):
    (tmp_path / "my.py").write_text("def law(steering_angle, odometry, car, mu): return 0.0")
    settings = LabSettings(law=f"{tmp_path}/my.py:law")
    (row,) = EXPERIMENT.measure({"mu": 0.8, "steering": 0.3}, settings)
    assert row["safe"] and math.isnan(row["curvature_at_law"])


def test_the_sliding_of_tires_without_a_peak_is_not_measured():
    row = measure(1.0489, 0.2, tires="f1tenth_gym")
    assert math.isnan(row["slides_over_law"]) and "not measured" in row["reason"]
    assert row["ends_by"] == "understeer" and row["curvature_at_law"] < 0.9


def test_a_tall_car_ends_by_load_transfer_where_the_rigid_car_lifts_a_wheel():
    row = measure(1.0489, 0.05, changes=CarChanges(center_of_gravity_height=0.12))
    assert row["ends_by"] == "load transfer" and not row["safe"]
    assert row["up_to_m_s"] / row["law_speed_m_s"] == pytest.approx(row["lifts_over_law_of_rigid_car"], rel=0.06)


@each("case", [(0.3, 0.05), (0.3, 0.4), (1.05, 0.2), (1.05, 0.4)])
def test_a_rigid_car_slides_where_the_independent_one_does(own, case):
    mu, steering = case
    ground = LabSettings(entry=own, mus=(mu,)).ground(mu)
    limits = SteadyLimits.of(ground, mu, steering)
    assert limits.slides == pytest.approx(skidpad(ground.car.parameters, steering, mu, True), rel=0.005)


@each("steering", [0.05, 0.2, 0.4])
def test_a_rigid_car_lifts_a_wheel_where_moments_say(steering):
    """Of a tall car that leans on springs of 2000 N/m and tires of 11700 N/m in series, on tires that hardly slip."""
    ground = LabGround(1.5, tires=Tires.load("coulomb"), changes=CarChanges(center_of_gravity_height=0.12))
    limits, car = SteadyLimits.of(ground, 1.5, steering), ground.car.parameters
    stiffness = 4.0 / (1.0 / 2000.0 + 1.0 / 11_700.0) * (0.5 * car.track_width) ** 2
    leans = 1.0 / (1.0 - car.mass * G * car.center_of_gravity_height / stiffness)
    curvature = limits.curvature_at(limits.lifts) * math.tan(steering) / car.wheelbase
    assert limits.lifts**2 * curvature / G * leans == pytest.approx(lifting_share(car, steering), rel=0.02)


def test_the_curve_of_a_linear_car_is_the_understeer_gradients():
    """Small angles: curvature / arc = 1 / (1 + K v^2 / b), K = (1 / S_f - 1 / S_r) / g."""
    tires = Tires.load("f1tenth_gym")
    front, rear = (axle.lateral.slope for axle in tires.axles)
    limits = SteadyLimits.of(LabGround(tires=tires, changes=CarChanges(center_of_gravity_height=0.03)), 1.0, 0.005)
    gradient = (1.0 / front - 1.0 / rear) / G
    for speed in (3.0, 6.0):
        assert limits.curvature_at(speed) == pytest.approx(1.0 / (1.0 + gradient * speed**2 / CAR.wheelbase), rel=2e-3)
    assert math.isnan(limits.slides) and math.isinf(limits.lifts)


@each(("steering", "car"), [(0.1, "autodrive"), (0.2, "autodrive"), (0.2, "f1tenth")])
def test_a_car_whose_wheels_are_tied_slides_within_two_percent_of_the_rigid_one(steering, car):
    """Long before the law, as its wheels have ways of different lengths."""
    row = measure(None, steering, vehicle=car, tires="coulomb" if car == "f1tenth" else None)
    assert row["slides_over_law"] == pytest.approx(row["slides_over_law_of_rigid_car"], rel=0.02)
    assert row["leaves_arc_over_law"] == pytest.approx(row["leaves_arc_over_law_of_rigid_car"], rel=0.02)


@each(
    ("steering", "tires", "lines", "cause"),
    [(0.05, "f1tenth", dict.fromkeys(("front_axle", "rear_axle"), "locked"), "drive line"),
     (0.4, "f1tenth", {}, "drive line"), (0.4, "coulomb", {}, "drive line"), (0.1, "f1tenth", {}, "understeer"),
     (0.4, "f1tenth", {"centre": "open"}, "understeer"), (0.1, "coulomb", {}, "grip")],
)  # fmt: skip
def test_what_ties_the_wheels_is_the_cause_where_a_car_with_open_differentials_goes_on(
    tmp_path, steering, tires, lines, cause
):
    """Beside the onset stands that of the rigid car without ties, which the same car has once they are taken out."""
    tied = tmp_path / f"{'_'.join(lines)}.xml"
    tied.write_text(with_drive_line(Vehicle.load().text, **lines), encoding="utf-8")
    cars = open_file() if lines == {"centre": "open"} else str(tied), open_file()
    row, untied = (measure(None, steering, tires=tires, vehicle=car) for car in cars)
    assert row["ends_by"] == cause
    assert row["ends_over_law_of_untied_car"] == pytest.approx(untied["up_to_m_s"] / untied["law_speed_m_s"], rel=0.02)


def test_the_summary_says_up_to_which_share_of_the_law_no_tire_slides():
    settings = LabSettings(law="limiter", steerings=(0.2, 0.4))
    rows = [row for cell in EXPERIMENT.cells(settings) for row in EXPERIMENT.measure(cell, settings)]

    def said(rows):
        return EXPERIMENT.section(rows, settings).sentences[0]

    looked_at = 1.6 * math.sqrt(G * rows[0]["law_mu"] * CAR.wheelbase / math.tan(0.2)) / rows[0]["law_speed_m_s"]
    assert f"is safe on 0 of 2 circles, and no tire slides up to {looked_at:.2f} of its speed. On" in said(rows)
    assert "no tire slides up to 0.50 of" in said([rows[0], rows[1] | {"slides_over_law": 0.5}])
    assert "slides" not in said([row | {"slides_over_law": math.nan} for row in rows])


def test_a_speed_out_of_reach_is_said_with_its_reason():
    row = measure(1.0489, 0.005)
    assert math.isnan(row["slides_over_law"]) and "above the car's greatest speed, 20 m/s" in row["reason"]


def test_a_car_that_tips_over_says_so():
    with pytest.raises(UnreachableError, match="tips over"):
        SteadyCircle(2.5, 0.2, tires=Tires.load("coulomb")).at(1.0)
