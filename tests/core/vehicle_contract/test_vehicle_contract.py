"""What holds for every vehicle: the bundled ones, by being there, and one that is made of ours."""

import copy
import dataclasses
import functools
import math
import pickle
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.contract import NEEDED, ackermann_angle
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tire_slip import TireSlipMeter, slides_above
from fg_mujoco.vehicle.tires import DEFAULT_TIRES, Tires, tire_names
from vehicle_worlds import load

every_vehicle = each("name", (*fg.vehicle_names(), "made"))


def alone(name):
    """Return (model, data, car) of a vehicle on its own ground."""
    model = load(name).compile()
    return model, mujoco.MjData(model), Car(model)


@every_vehicle
def test_it_has_every_part_once(name):
    spec = load(name).spec()
    for part in NEEDED:
        assert getattr(spec, part.kind)(part.name) is not None, part


def test_the_documentation_lists_the_parts_and_the_bundled_vehicles():
    page = Path(__file__).parents[3] / "docs" / "howto" / "own_car.md"
    if not page.exists():
        pytest.skip("not a checkout of the repository")
    rows = re.findall(r"^\| (\w+) \| (`.*?`) \|", page.read_text("utf-8"), re.MULTILINE)
    named = [(kind, name) for kind, names in rows for name in re.findall(r"`(.+?)`", names)]
    listed = {(kind, name.format(wheel=wheel)) for kind, name in named for wheel in WHEELS}
    optional = {("text", "lidar"), ("text", "look"), ("text", "tires"), ("geom", "hull")}
    numbers = ("steering_map", "acceleration_map", "drag", "drag_brake", "motor_inertia", "motor", "battery")
    optional |= {("numeric", name) for name in numbers} | {("sensor", "drive_force"), ("site", "imu")}
    optional |= {("text", name) for name in ("centre", "front_axle", "rear_axle")}
    assert listed - optional == {(part.kind, part.name) for part in NEEDED}
    bundled = re.findall(r"^\| `(\w+)` \| .* kg, ", page.read_text("utf-8"), re.MULTILINE)
    assert sorted(bundled) == sorted(fg.vehicle_names())


@every_vehicle
def test_it_rests_as_it_is_drawn(name):
    model, data, car = alone(name)
    car.set_pose(data, 1.0, 2.0, 0.7)
    drawn = data.body("base_link").xpos.copy()
    for _ in range(100):
        mujoco.mj_step(model, data)
    assert np.abs(data.body("base_link").xpos - drawn).max() < 60e-6
    height = data.subtree_com[model.body("base_link").id][2]
    assert height == pytest.approx(car.parameters.center_of_gravity_height, abs=60e-6)


@functools.cache
def standing_on(name, tires):
    return load(name).spec(tires=tires and Tires.load(tires)).compile()


@every_vehicle
@each("tires", [None, *(name for name in tire_names() if name != DEFAULT_TIRES)])
@each("speed", [-3.0, 0.0, 8.0])
def test_it_stands_and_rolls_on_four_tires_that_do_not_slide(name, speed, tires):
    """Whatever set it stands on."""
    if (name, tires) == ("autodrive", "contact"):
        pytest.skip("its drag is refused there")
    model = standing_on(name, tires)
    data, car, forces = mujoco.MjData(model), Car(model), TireForces(model)
    car.set_pose(data, 0.0, 0.0, 0.0, speed)
    meter = TireSlipMeter(model)
    for _ in range(100):
        forces.step(data)
        meter.record(data)
    slip = meter.read()
    if tires == "f1tenth_gym":  # which has no peak
        assert np.isnan(slip.sliding_speed).all() and np.isfinite(slip.normal_force).all()
    else:
        assert np.isfinite(slip.sliding_speed).all() and slip.sliding_speed.max() < 8e-3  # axles roll on two radii
    drawn = tires == "contact" or (name == "f1tenth" and tires != "autodrive")
    loads, settled = slip.normal_force.sum(axis=1), 0 if drawn else 20
    # a set's springs are those of f1tenth, or of its own car, so that another one first sinks by some .1 mm
    assert loads[settled:] == pytest.approx(car.parameters.mass * 9.81, rel=0.03)
    assert loads[-20:] == pytest.approx(car.parameters.mass * 9.81, rel=0.001)
    x, *aside = car.pose(data)
    close = 2e-3 * abs(speed) + 1e-4
    assert aside == pytest.approx((0.0, 0.0), abs=close)
    rear = Tires.load(tires).rear if tires else None
    resistance = (rear or load(name).tires.rear).rolling_resistance  # against which the drive pushes, and against drag
    spins = [model.joint(f"{wheel}_wheel").dofadr[0] for wheel in WHEELS]
    drag = model.dof_damping[spins].sum() / car.parameters.wheel_radius**2 / car.parameters.mass
    slowest = abs(speed) * 0.5 - 0.5 * (resistance * 9.81 + drag * abs(speed)) * 0.5**2
    assert slowest - close <= math.copysign(x, x * speed) <= abs(speed) * 0.5 + close


@every_vehicle
def test_its_front_wheels_are_ackermanns_to_a_ten_thousandth(name):
    model, _, car = alone(name)
    limits = car.parameters
    angles = np.linspace(-limits.max_steering_angle, limits.max_steering_angle, 1001)
    for side, track_width in (("left", limits.track_width), ("right", -limits.track_width)):
        coefficients = model.eq_data[model.equality(f"ackermann_{side}").id, :5]
        exact = ackermann_angle(angles, limits.wheelbase, track_width)
        # of those that steer further, or on a shorter wheelbase, the best quartic is off by more
        most = {"ipz": 2.1e-4, "autodrive": 3e-4}.get(name, 1.01e-4)
        assert np.abs(np.polynomial.polynomial.polyval(angles, coefficients) - exact).max() < most


@every_vehicle
def test_its_parameters_are_those_of_a_world_that_it_is_in(name):
    vehicle = load(name)
    world = fg.World("oval", name if vehicle.source == name else vehicle)
    assert vehicle.parameters == world.parameters == world.cars[0].parameters


@every_vehicle
def test_no_beam_sees_it(name):
    """Level rays from the mount meet nothing, for any suspension travel and steering angle."""
    model, data, _ = alone(name)
    rng = np.random.default_rng(0)
    for _ in range(10):
        data.qpos[:] = model.qpos0
        for wheel in WHEELS:
            data.joint(f"{wheel}_suspension").qpos = rng.uniform(*model.joint(f"{wheel}_suspension").range)
        data.joint("front_left_kingpin").qpos = data.joint("front_right_kingpin").qpos = rng.uniform(-0.5, 0.5)
        mujoco.mj_kinematics(model, data)
        for bearing in np.linspace(-math.pi, math.pi, 181):
            ray = np.array([math.cos(bearing), math.sin(bearing), 0.0])
            place = data.site("lidar_mount").xpos
            assert mujoco.mj_ray(model, data, place, ray, None, 1, -1, np.zeros(1, np.int32)) == -1.0


@every_vehicle
def test_its_chassis_covers_its_wheels(name):
    model, data, _ = alone(name)
    mujoco.mj_kinematics(model, data)
    for wheel in WHEELS:
        reach = np.abs(data.geom(f"{wheel}_tire").xpos - data.geom("chassis").xpos)[:2]
        assert (reach + model.geom(f"{wheel}_tire").size[:2] < model.geom("chassis").size[:2]).all()


@every_vehicle
def test_it_can_be_compared_hashed_copied_and_pickled_and_not_changed(name):
    vehicle = load(name)
    for other in (pickle.loads(pickle.dumps(vehicle)), copy.deepcopy(vehicle), load(name)):
        assert other == vehicle and hash(other) == hash(vehicle) and other.sha256 == vehicle.sha256
    assert len({vehicle, *(load(other) for other in fg.vehicle_names())}) == len({name, *fg.vehicle_names()})
    with pytest.raises(dataclasses.FrozenInstanceError):
        vehicle.text = ""
    model = vehicle.compile()
    model.body_mass[:] = 1.0
    model.pair_friction[:] = 0.1
    assert vehicle.compile().body_mass.sum() == pytest.approx(vehicle.parameters.mass)
    greatest = max(vehicle.compile().pair(f"{wheel}_tire").friction[0] for wheel in WHEELS)
    assert greatest == pytest.approx(vehicle.greatest_mu())


@pytest.mark.slow
@each("name", [*(name for name in fg.vehicle_names() if name != "f1tenth"), "made"])  # which test_mission.py drives
@each("track", ["chicanes", "fast", "hairpins", "l_corridor", "oval", "tight"])
def test_the_gap_finder_drives_it_two_laps_without_a_crash_or_a_slide(name, track):
    """A lap from rest, and one that begins at speed, as all later ones do."""
    car = fg.race(track, "gap_finder", vehicle=load(name), laps=2).car
    said = name == "autodrive" and track in ("chicanes", "l_corridor")  # where its page says that it does not
    assert car.end_reason == "finished" or said
    if name != "autodrive":  # whose wheels turn alike in bends, and so slip past their peak
        assert car.max_slide_m_s <= slides_above(load(name).tires.model)
        assert car.slide_time_fraction == 0.0
