"""The car of AutoDRIVE's league: each row of what is public of it, beside what is measured here."""

import math

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.errors import ModelError, SettingsError
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.skidpad import SETS
from fg_mujoco.lidar.body_poses import mounted_pose
from fg_mujoco.racing.planners import usual_vehicle
from fg_mujoco.racing.rules import find_rules
from fg_mujoco.vehicle.car import Car
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tires import Tires, curve_force, tire_names
from fg_mujoco.vehicle.tires.friction_curve import FrictionCurve
from refusals import refused

DRAG, LOCKED, GRAVITY = 0.273, 0.464 * 9.81, 9.81
POINTS = {"longitudinal": (0.15, 0.72, 0.25, 0.464), "lateral": (0.01, 1.0, 0.1, 0.5)}


def hermite(x, values, slopes):
    """Return the cubic through two values with two slopes, at x from 0 to 1."""
    (a, b), (u, v) = values, slopes
    return a * (1 + 2 * x) * (1 - x) ** 2 + b * x**2 * (3 - 2 * x) + u * x * (1 - x) ** 2 - v * x**2 * (1 - x)


@each("direction", POINTS)
def test_its_tires_have_unitys_curve_of_two_cubics(direction):
    curve = getattr(Tires.load("autodrive").front, direction)
    slip, top, end, asymptote = POINTS[direction]
    assert (curve.peak_slip, curve.peak, curve.slope) == (slip, top, pytest.approx(top / slip))
    assert [curve.force(at) for at in (0.0, slip, end, 1.0)] == pytest.approx([0.0, top, asymptote, asymptote])
    for x in np.linspace(0.0, 1.0, 41).tolist():
        rising, falling = hermite(x, (0.0, top), (top, 0.0)), hermite(x, (top, asymptote), (0.0, 0.0))
        for at, force in ((x * slip, rising), (slip + x * (end - slip), falling)):
            assert curve.force(at) == -curve.force(-at) == pytest.approx(force)
            assert curve_force(4, curve.row(), at) == pytest.approx(force)
    assert curve.scaled(0.5).force(end) == pytest.approx(0.5 * asymptote)


@each("changed, said", [({"extremum_slip": 0.0}, "extremum_slip is 0.0; accepted: 0.001 to 1"),
                        ({"asymptote_slip": 0.1}, "asymptote_slip is 0.1; accepted: above extremum_slip, 0.15"),
                        ({"asymptote_value": 0.8}, "asymptote_value is 0.8; accepted: 0 to extremum_value, 0.72"),
                        ({"extremum_value": math.nan}, "extremum_value is nan; accepted: above 0")])  # fmt: skip
def test_a_curve_that_is_none_is_refused_in_a_line(changed, said):
    names = ("extremum_slip", "extremum_value", "asymptote_slip", "asymptote_value")
    with pytest.raises(SettingsError) as refused:
        FrictionCurve(**dict(zip(names, POINTS["longitudinal"], strict=True)) | changed)
    assert said in str(refused.value)


class Drive:
    """The car alone on its ground."""

    def __init__(self, speed=0.0):
        self.model = fg.Vehicle.load("autodrive").compile()
        self.data, self.car, self.forces = mujoco.MjData(self.model), Car(self.model), TireForces(self.model)
        self.forces.begin(self.data)
        self.car.set_pose(self.data, 0.0, 0.0, 0.0, speed)

    def run(self, seconds, throttle):
        self.data.ctrl[:] = 0.0, 25.25 * throttle
        for _ in range(round(seconds / self.model.opt.timestep)):
            self.forces.step(self.data)
        return self.car.odometry(self.data).wheel_speeds, self.car.ground_speed(self.data)


@each("throttle, wheels", [(0.1, 2.525), (0.2, 5.05), (-0.1, -2.525)])
def test_a_throttle_is_a_speed_of_the_wheels_at_once(throttle, wheels):
    """In the first step of the physics, 5 ms, to 2 %. The car goes on at the slip that overcomes its drag."""
    drive = Drive()
    assert drive.run(0.005, throttle)[0] == pytest.approx(wheels, rel=0.02)
    turning, speed = drive.run(3.0, throttle)
    assert turning == pytest.approx(wheels, rel=0.002)
    pull = Tires.load("autodrive").front.longitudinal.force(turning.mean() / speed - 1.0) * GRAVITY
    assert pull == pytest.approx(DRAG * abs(speed), rel=0.1)
    assert speed == pytest.approx(2.50 * throttle / 0.1, rel=0.02)  # 2.50 was measured by the team at .1


def test_throttle_0_locks_the_wheels_and_the_car_slows_by_its_friction_and_its_drag():
    """4.55 + .273 v, and from 8 m/s in ln(1 + .273 v / 4.55) / .273 seconds."""
    drive, seconds = Drive(8.0), math.log1p(DRAG * 8.0 / LOCKED) / DRAG
    _, speed = drive.run(0.2, 0.0)
    while speed > 0.5:
        slower = drive.run(0.05, 0.0)
        assert np.abs(slower[0]).max() < 0.01
        mean = 0.5 * (speed + slower[1])
        assert (speed - slower[1]) / 0.05 == pytest.approx(LOCKED + DRAG * mean, rel=0.02)
        speed = slower[1]
    drive.run(speed / LOCKED, 0.0)
    assert drive.data.time == pytest.approx(seconds, abs=0.03) and abs(drive.run(0.5, 0.0)[1]) < 0.02


def test_across_its_tires_hold_the_load_and_half_of_it_beyond():
    """A car that slides to its side is slowed by .5 g and its drag; the peak, 1.0, is at .01 rad."""
    drive = Drive()
    drive.data.qvel[1] = 6.0
    drive.run(0.1, 0.0)
    before = drive.data.qvel[1]
    drive.run(0.1, 0.0)
    lost = (before - drive.data.qvel[1]) / 0.1
    assert lost == pytest.approx(0.5 * GRAVITY + DRAG * 0.5 * (before + drive.data.qvel[1]), rel=0.02)
    row = drive.forces.rows[0]
    assert curve_force(row["law"], row["curve"][1], 0.01) * GRAVITY == pytest.approx(9.81)


def test_its_steering_and_its_lidar_are_the_leagues():
    world = fg.World("fast", "autodrive")
    assert world.parameters.max_steering_angle == 0.5236 and find_rules("autodrive_2026").checkpoints == 21
    simulation = fg.Simulation(world)
    scan, _ = simulation.reset()
    ranges = scan.ranges
    assert len(ranges) == 1081 and (scan.range_min, scan.range_max) == (0.06, 10.0)
    assert math.isinf(ranges[540]) and ranges[np.isfinite(ranges)].max() < 10.0 < fg.Simulation(
        fg.World("fast", "f1tenth")).reset()[0].ranges[540]  # fmt: skip


def test_its_lidar_stays_level_and_rangefinders_are_refused():
    position, rotation, mount = np.empty(3), np.empty((3, 3)), np.array((0.3, 0.0, 0.1))
    half = 0.5 * 0.2
    pitched = np.array((0.0, 0.0, 0.1, math.cos(half), 0.0, math.sin(half), 0.0))
    mounted_pose(pitched, True, mount, np.eye(3), position, rotation)
    assert position.tolist() == [0.3, 0.0, 0.2] and rotation.tolist() == np.eye(3).tolist()
    mounted_pose(pitched, False, mount, np.eye(3), position, rotation)
    assert rotation[2, 0] == pytest.approx(-math.sin(0.2))
    with pytest.raises(ModelError, match=r"autodrive_lidar\.xml stays level, which rangefinders do not; accepted: ray"):
        fg.race("oval", vehicle="autodrive", lidar="rangefinder", time_limit=0.1)


def test_a_drag_that_is_none_is_refused(tmp_path):
    text = fg.Vehicle.load("autodrive").text.replace('name="drag" data="0.273"', 'name="drag" data="-1"')
    (tmp_path / "car.xml").write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=r"numeric 'drag' is -1; accepted: a number from 0 \[1/s\]"):
        fg.Vehicle.load(str(tmp_path / "car.xml"))


def test_mujocos_contacts_are_refused_on_a_car_with_drag(tmp_path, capsys):
    said = "numeric 'drag' is 0.273 on MuJoCo's own tires; accepted: 0 there, or another set of tires"
    for command in (("race", "--laps", "1"), ("friction", "skidpad")):
        assert said in refused(tmp_path, capsys, *command, "--vehicle", "autodrive", "--tires", "contact")
    cells = SETS.cells(LabSettings(entry=fg.Entry(vehicle="autodrive"), steerings=(0.2,)))
    assert {cell["tires"] for cell in cells} == set(tire_names()) - {"contact"}


def test_nodes_that_command_autodrives_throttle_drive_it_unless_another_car_is_given(tmp_path):
    node = tmp_path / "node.py"
    node.write_text("import rclpy  # publishes on /autodrive/roboracer_1/throttle_command\n", encoding="utf-8")
    assert usual_vehicle(f"ros:{node}") == "autodrive"
    assert fg.Entry(controller=f"ros:{node}").car.name == "autodrive"
    assert fg.Entry(controller=f"ros:{node}", vehicle="nuc2").car.name == "nuc2"
    assert [usual_vehicle(name) for name in ("gap_finder", f"ros:{tmp_path / 'none.py'}")] == [None, None]
