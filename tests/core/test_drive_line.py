"""Drive lines against closed forms, and tires with a law of ours against MuJoCo's contacts."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.vehicle.car import WHEELS, Car, car_parameters
from fg_mujoco.vehicle.drive_line import DriveLine
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tires import Tires
from vehicle_worlds import F1TENTH, with_drive_line

BUNDLED = ("f1tenth", "ipz", "nuc2")
SPEEDS = (3.0, 5.0, 8.0)
REAR_DRIVE = {"front_left": 0.0, "front_right": 0.0, "rear_left": 0.0245, "rear_right": 0.0245}


def model_of(vehicle="f1tenth", tires="coulomb", mu=None, shares=None, **lines):
    """Return the compiled model of a vehicle with another drive line; `shares`: of the wheels in its tendon."""
    car = fg.Vehicle.load(vehicle)
    spec = replace(car, text=with_drive_line(car.text, **lines)).spec(mu, tires=Tires.load(tires))
    if shares is not None:
        spec.delete(spec.tendon("drive"))
        tendon = spec.add_tendon(name="drive")
        for wheel, share in shares.items():
            if share:
                tendon.wrap_joint(f"{wheel}_wheel", share)
    return spec.compile()


def driven(model, speed, to, seconds, settling=0.2):
    """Drive straight on, then at another command. Columns: time, speed, four wheels' [m/s], way, y [m], yaw [rad]."""
    forces, data, car = TireForces(model), mujoco.MjData(model), Car(model)
    forces.begin(data)
    car.write_pose(data, 0.0, 0.0, 0.0, speed)
    forces.forward(data)
    for _ in range(round(settling / model.opt.timestep)):
        forces.step(data)
    data.ctrl[1], place, rows = to, data.qpos[0], []
    for step in range(round(seconds / model.opt.timestep) + 1):
        if step > 0:
            forces.step(data)
        wheels = car.odometry(data).wheel_speeds
        rows.append((data.time, car.ground_speed(data), *wheels, data.qpos[0] - place, *car.pose(data)[1:]))
    return np.array(rows)


def way_of_a_stop(model, speed, mu):
    """Return the way [m] of a point that the speed servo stops, with the wheels' drag, as far as the tires hold."""
    car, dt, way = car_parameters(model), 1e-4, 0.0
    mass = car.mass + (4.0 * car.wheel_inertia + DriveLine.of(model).motor_inertia) / car.wheel_radius**2
    drag = model.dof_damping[model.joint("rear_left_wheel").dofadr[0]] * 4.0 / car.wheel_radius**2 / mass  # [1/s]
    while speed > 1e-3:
        braking = min(speed / car.speed_time_constant, car.max_acceleration) + drag * speed
        speed -= dt * min(braking, mu * car.gravity)
        way += dt * speed
    return way


@each("vehicle", BUNDLED)
@each("speed", SPEEDS)
def test_a_stop_is_that_of_its_servo_and_no_wheel_turns_backwards(vehicle, speed):
    model = model_of(vehicle)
    rows = driven(model, speed, 0.0, 2.0)
    assert rows[-1, 6] == pytest.approx(way_of_a_stop(model, rows[0, 1], 1.0489), rel=0.01)
    assert rows[:, 2:6].min() > -1e-3
    slip = np.abs(rows[4:, 2:6] - rows[4:, 1:2])
    held = slip < 0.02 * rows[4:, 1:2] + 0.03
    assert vehicle == "ipz" or held.all()  # the odometry is right from .02 s on; drag and motor of ipz brake harder


def way_on_curves(model, tires, speed):
    """Return the way [m] of a car whose shaft ties two axles, each with its curve, relaxation and share of the load."""
    car, dt, way, slowing = car_parameters(model), 1e-4, 0.0, 0.0
    inertia = 4.0 * car.wheel_inertia + DriveLine.of(model).motor_inertia
    damping = 4.0 * model.dof_damping[model.joint("rear_left_wheel").dofadr[0]] / car.wheel_radius**2
    motor = model.actuator("speed").id
    gain, most = model.actuator_gainprm[motor, 0], model.actuator_forcerange[motor, 1]
    levers, bent, wheels = (car.rear_axle_distance, car.front_axle_distance), [0.0, 0.0], speed
    while speed > 2e-3:
        pull = 0.0
        for at, (axle, lever, side) in enumerate(zip(tires.axles, levers, (1.0, -1.0), strict=True)):
            load = car.mass * (car.gravity * lever + side * slowing * car.center_of_gravity_height) / car.wheelbase
            bent[at] += dt * (wheels - speed - wheels * bent[at] / axle.relaxation_length)
            pull += load * axle.longitudinal.force(bent[at] / axle.relaxation_length)
        braking = min(gain * wheels, most) + damping * wheels
        wheels = max(wheels - dt * (braking + pull) * car.wheel_radius**2 / inertia, 0.0)
        slowing = -pull / car.mass
        speed -= dt * slowing
        way += dt * speed
    return way


@each("vehicle", fg.vehicle_names())
@each("speed", SPEEDS)
def test_a_stop_on_a_cars_own_tires_is_that_of_two_axles_on_their_curves(vehicle, speed):
    """Those of the league's car, which has no shaft, are in `test_league_car`."""
    model, tires = fg.Vehicle.load(vehicle).compile(), fg.Vehicle.load(vehicle).tires
    rows = driven(model, speed, 0.0, 3.0)
    assert rows[:, 2:6].min() > (-0.01 if vehicle == "autodrive" else -1e-3)  # as it comes to stand
    if vehicle != "autodrive":
        assert rows[-1, 6] == pytest.approx(way_on_curves(model, tires.on(1.0489), rows[0, 1]), rel=0.025)


@each("vehicle", BUNDLED)
@each("speed", SPEEDS)
def test_wheels_that_lock_on_a_slippery_floor_stop_the_car_by_its_friction(vehicle, speed):
    """The motor could brake harder than the tires hold: v^2 / (2 mu g), and what its servo takes to let go."""
    model = model_of(vehicle, mu=0.6)
    rows = driven(model, speed, 0.0, 2.5)
    assert rows[-1, 6] == pytest.approx(way_of_a_stop(model, rows[0, 1], 0.6), rel=0.02)
    assert rows[:, 2:6].min() > -0.01 and np.ptp(rows[:, 2:6], axis=1).max() < 0.01
    assert (rows[:, 2:6].max(axis=1) < 0.5 * rows[:, 1]).any()  # locked, or nearly so


@each("lines", [{}, {"rear_axle": "locked"}, {"front_axle": "locked", "rear_axle": "locked"}])
@each("speed", SPEEDS)
def test_mujocos_contacts_stop_alike(lines, speed):
    """Equalities of tendons and joints beside what is eliminated, from .02 s on, as tires build up their force."""
    ours, theirs = (driven(model_of(tires=tires, **lines), speed, 0.0, 2.0) for tires in ("coulomb", "contact"))
    assert np.abs(ours[4:, 1:6] - theirs[4:, 1:6]).max() < 0.01 * speed
    assert ours[-1, 6] == pytest.approx(theirs[-1, 6], rel=0.02)


@each(
    "lines",
    [{}, {"centre": "open"}, {"rear_axle": "locked"}, dict.fromkeys(("front_axle", "rear_axle"), "limited 0.05 0.3")],
)
def test_split_friction_turns_the_car_as_its_mirror_image(lines):
    found = []
    for low in ("left", "right"):
        model = model_of(**lines)
        for wheel in WHEELS:
            model.pair(f"{wheel}_tire").friction[:2] = 0.5 if wheel.endswith(low) else 1.0
        found.append(driven(model, 5.0, 0.0, 1.2))
    left, right = found
    assert np.abs(left[-1, 8]) > 0.3  # [rad] towards the side that holds
    mirrored = right[:, [0, 1, 3, 2, 5, 4, 6, 7, 8]] * (1, 1, 1, 1, 1, 1, 1, -1, -1)
    np.testing.assert_allclose(left, mirrored, rtol=0.0, atol=1e-12)


@each("tires", ["coulomb", "contact"])
@each("lines", [{}, {"centre": "open"}])
def test_a_drag_brake_slows_a_car_that_coasts_and_then_holds_it(tires, lines):
    """A motor that does nothing, and F over the mass with what turns."""
    model = model_of(tires=tires, drag_brake=4, **lines)
    motor = model.actuator("speed").id
    model.actuator_gainprm[motor, 0], model.actuator_biasprm[motor, 2] = 1e-9, -1e-9
    rows = driven(model, 1.0, 0.0, 2.0)
    slowed = rows[0, 1] - rows[100, 1]
    assert slowed == pytest.approx(0.5 * 4.0 / 4.14816, rel=0.01) and np.abs(rows[-1, 1:6]).max() < 1e-3


def in_the_air(model, spins, force=0.0, steps=40):
    """Return the spins (steps, 4) [rad/s] of a heavy car that touches nothing, whose motor pushes by a force [N]."""
    model.opt.gravity[:], model.body("base_link").inertia[:] = 0.0, 1e3  # else its pitch counts in the spins
    motor = model.actuator("speed").id
    model.actuator_gainprm[motor], model.actuator_biasprm[motor], model.actuator_biasprm[motor, 0] = 0.0, 0.0, force
    forces, data = TireForces(model), mujoco.MjData(model)
    forces.begin(data)
    data.qpos[2] = 1.0
    dofs = [model.joint(f"{wheel}_wheel").dofadr[0] for wheel in WHEELS]
    data.qvel[dofs], found = spins, []
    for _ in range(steps):
        forces.step(data)
        found.append(data.qvel[dofs].copy())
    return np.array(found)


def test_a_clutch_holds_its_preload_and_its_ramp():
    """In the air, per axle: I d(w_left - w_right)/dt = -(preload + ramp T), T = 2 I dw/dt of both wheels."""
    preload, ramp, inertia, radius, force = 0.02, 0.4, 1.7e-4, 0.049, 3.0
    model = model_of(front_axle=f"limited {preload} {ramp}")
    spins = in_the_air(model, (60.0, 20.0, 40.0, 40.0), force)
    gain = force * radius / (4 * inertia + 3e-4)  # [rad/s^2] of all
    times = 0.005 * np.arange(1, len(spins) + 1)
    np.testing.assert_allclose(spins.mean(axis=1), 40.0 + gain * times, rtol=1e-3)
    expected = np.maximum(40.0 - (preload + ramp * 2.0 * inertia * gain) / inertia * times, 0.0)
    np.testing.assert_allclose(spins[:, 0] - spins[:, 1], expected, atol=0.3)
    assert expected[-1] == 0.0 and np.abs(spins[-1] - spins[-1].mean()).max() < 1e-6


@each(
    ("lines", "expected"),
    [
        ({"centre": "open"}, (70.0, 30.0, 60.0, 20.0)),
        ({}, (65.0, 25.0, 65.0, 25.0)),
        ({"centre": "open", "rear_axle": "locked"}, (70.0, 30.0, 40.0, 40.0)),
        ({"front_axle": "locked", "rear_axle": "locked"}, (45.0, 45.0, 45.0, 45.0)),
    ],
)
def test_what_is_tied_turns_alike_after_one_step(lines, expected):
    """Momentum stays: wheels of one inertia meet in the mean; the motor, which turned with them all, keeps its own."""
    spins = in_the_air(model_of(motor_inertia=0, **lines), (70.0, 30.0, 60.0, 20.0), steps=20)
    np.testing.assert_allclose(spins, np.tile(expected, (20, 1)), rtol=1e-4)


def test_a_rear_drive_accelerates_by_the_load_of_its_rear_axle():
    """mu g lf / (b - mu h): its load grows by m a h / b; the wheels' inertias count in both."""
    model = model_of(mu=0.6, shares=REAR_DRIVE, centre="open")
    car = car_parameters(model)
    assert (car.drives_front, car.drives_rear, car.shaft) == (False, True, False)
    rows = driven(model, 0.0, 6.0, 1.0)
    front = 2.0 * car.wheel_inertia / car.wheel_radius**2  # [kg] of the wheels that the ground turns
    height = car.center_of_gravity_height + 4.0 * car.wheel_inertia / (car.mass * car.wheel_radius)
    most = 0.6 * car.gravity * car.front_axle_distance
    most /= car.wheelbase * (1.0 + front / car.mass) - 0.6 * height
    gain = np.polyfit(rows[60:160, 0], rows[60:160, 1], 1)[0]
    assert gain == pytest.approx(most, rel=0.03)
    assert rows[-1, 4:6].min() > 1.2 * rows[-1, 2:4].max()  # they spin


@each("track", ["hairpins", "l_corridor"])
@each("assist", ["full", "safe"])
def test_a_rear_drive_stops_where_its_planner_plans_to(track, assist, tmp_path):
    """Its driven wheels roll slower than the ground when they brake, and the others do not."""
    path, text = tmp_path / "rear.xml", with_drive_line(F1TENTH, centre="open")
    for wheel in WHEELS:
        joint, share = f'<joint joint="{wheel}_wheel" coef="0.01225"/>', REAR_DRIVE[wheel]
        text = text.replace(joint, joint.replace("0.01225", str(share)) if share else "")
    path.write_text(text)
    car = fg.race(track, laps=2, vehicle=path, assist=assist).car
    assert car.laps_completed == 2 and car.collisions_wall == 0


@each("tires", ["coulomb", "contact"])
@each("lines", [{}, {"centre": "open"}, {"front_axle": "locked", "rear_axle": "limited 0.05 0"}])
def test_a_drive_line_is_the_same_on_all_tires(tires, lines):
    """The planner's parameters, and greatest acceleration and time constant with the inertia of the motor in them."""
    model, plain = model_of(tires=tires, **lines), car_parameters(model_of(**lines))
    assert car_parameters(model) == plain
    assert plain.max_acceleration == pytest.approx(9.51, rel=1e-5)
    assert DriveLine.of(model).shaft == ("centre" not in lines)


def test_what_is_tied_on_contacts_is_not_tied_twice():
    vehicle = fg.Vehicle.load()
    again = replace(vehicle, text=vehicle.spec(tires=Tires.load("contact")).to_xml())
    models = [car.spec(tires=Tires.load("contact")).compile() for car in (again, vehicle)]
    assert models[0].neq == models[1].neq == 3 and models[0].ntendon == models[1].ntendon == 2
    np.testing.assert_allclose(*(model.dof_M0 for model in models), rtol=1e-5)
