"""The forces of tires with a law of ours in the physics: what holds a car, and what the native core makes of a slip."""

import math
from copy import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.messages import DriveCommand
from fg_mujoco.native import core
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.physics import STATE
from fg_mujoco.simulation.settings import Start
from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.drive_line import DriveLine
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tire_patch import deflect, grip_of
from fg_mujoco.vehicle.tire_rows import ACROSS, ALONG, FORCE_ACROSS, FORCE_ALONG, GEAR, LOAD, TIRE, USERDATA
from fg_mujoco.vehicle.tire_slip import TireSlipMeter
from fg_mujoco.vehicle.tires import DEFAULT_TIRES, AxleTires, Brush, Tires, tires_of
from fg_mujoco.vehicle.vehicle import Vehicle
from vehicle_worlds import with_drive_line

BRUSH = Tires(
    model="brush",
    **dict.fromkeys(
        ("front", "rear"),
        AxleTires(
            lateral=Brush(D=1.0, stiffness=20.0), longitudinal=Brush(D=1.0, stiffness=20.0), relaxation_length=0.045
        ),
    ),
    name="brush",
)
SETS = ("slipx_reference", "forzaeth_nuc2", "forzaeth_nuc7", "coulomb", "f1tenth_gym", BRUSH)
LAWS_OF_OURS = ("coulomb", "slipx_reference", "f1tenth_gym", BRUSH)  # one set of each law


class Ground:
    """A car on tires of a set, on endless ground; `lines`: see `with_drive_line`."""

    def __init__(self, tires, *, timestep=0.005, mu=None, lines=None):
        self.tire_set, vehicle = Tires.load(tires), Vehicle.load()
        vehicle = replace(vehicle, text=with_drive_line(vehicle.text, **lines or {}))
        self.model = vehicle.spec(mu, tires=self.tire_set).compile()
        self.model.opt.timestep = timestep
        self.data = mujoco.MjData(self.model)
        self.line = DriveLine.of(self.model)
        self.car, self.forces, self.meter = Car(self.model), TireForces(self.model), TireSlipMeter(self.model)

    def place(self, speed=0.0, heading=0.0):
        mujoco.mj_resetData(self.model, self.data)
        self.car.set_pose(self.data, 0.0, 0.0, heading, speed)
        self.forces.begin(self.data)

    def hold(self, seconds, steering=0.0, speed=0.0, record=False):
        self.car.apply(self.data, DriveCommand(steering_angle=steering, speed=speed))
        steps = round(seconds / self.model.opt.timestep)
        if not record:
            self.forces.run(self.data, *np.empty((2, steps, 0)))
            return
        for _ in range(steps):
            self.forces.step(self.data)
            self.meter.record(self.data)

    @property
    def tires(self):
        """(4, USERDATA)."""
        return self.data.userdata.reshape(4, USERDATA)

    def block_wheels(self):
        for wheel in WHEELS:
            self.model.dof_damping[self.model.joint(f"{wheel}_wheel").dofadr[0]] = 1e6


def centripetal(ground):
    """What the whole car takes on a steady circle [N]: mass times the speed of its centre of gravity and yaw rate."""
    mujoco.mj_subtreeVel(ground.model, ground.data)
    speed = np.hypot(*ground.data.subtree_linvel[ground.model.body("base_link").id, :2])
    return ground.car.parameters.mass * speed * ground.data.qvel[5]


@each("tires", SETS)
@each("direction", [0.0, 0.5 * math.pi, 0.8])
@pytest.mark.slow
def test_a_car_with_blocked_wheels_stays_on_a_slope(tires, direction):
    """20 %, any way: once it has settled it moves by less than .003 mm in 20 s; a contact would creep by 9 mm."""
    ground = Ground(tires)
    slope = math.atan(0.2)
    down = -9.81 * math.sin(slope)
    gravity = (down * math.cos(direction), down * math.sin(direction), -9.81 * math.cos(slope))
    ground.model.opt.gravity[:] = gravity
    ground.block_wheels()
    ground.place()
    ground.hold(3.0)
    before = ground.data.qpos[:3].copy()
    ground.hold(20.0)
    assert np.abs(ground.data.qpos[:3] - before).max() < 3e-6
    mass = ground.car.parameters.mass
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, ground.data.qpos[3:7])
    push = np.array([ground.tires[:, FORCE_ALONG].sum(), ground.tires[:, FORCE_ACROSS].sum()])
    np.testing.assert_allclose(push, -mass * np.array(gravity[:2]), rtol=0.01, atol=0.02)  # Newton


@each("tires", ["slipx_reference", "forzaeth_nuc7", "f1tenth_gym"])
@each("speed", [1.0, 3.0, 8.0])
@pytest.mark.slow
def test_a_tire_at_a_set_slip_has_the_force_of_its_curve_after_its_relaxation_length(tires, speed):
    """Across, along, and both by similarity; and 63 % of the slip after one relaxation length."""
    rows = TireForces(Vehicle.load().spec(tires=Tires.load(tires)).compile()).rows
    for row, axle in ((rows[0], Tires.load(tires).axles[0]), (rows[3], Tires.load(tires).axles[1])):
        for load in (2.0, 9.0, 20.0):
            for ratio, angle in ((0.0, 0.02), (0.05, 0.0), (0.1, 0.2), (-0.3, 0.4), (0.0, -0.5)):
                grip = grip_of(row, load, axle.lateral.peak)
                along = across = 0.0
                velocity = (speed * ratio, speed * math.tan(angle), speed)
                rolled = 0.0
                while rolled < 20.0 * axle.relaxation_length:
                    along, across, fx, fy, *_ = deflect(row, along, across, *velocity, grip, 0.0005)
                    rolled += 0.0005 * speed
                    share = across / axle.relaxation_length
                    expected = math.tan(angle) * (1.0 - math.exp(-rolled / axle.relaxation_length))
                    assert share == pytest.approx(expected, abs=0.05 * abs(math.tan(angle)) + 1e-12)
                assert share == pytest.approx(math.tan(angle), rel=1e-6, abs=1e-12)
                peaks = [min(curve.peak_slip, 1e9) for curve in (axle.longitudinal, axle.lateral)]
                if math.isinf(axle.lateral.peak_slip):
                    peaks = [1.0, 1.0]
                size = math.hypot(ratio / peaks[0], angle / peaks[1])
                factor = load * axle.load_factor(load)
                right = (
                    -factor * axle.longitudinal.force(size * peaks[0]) * ratio / peaks[0] / size,
                    -factor * axle.lateral.force(size * peaks[1]) * angle / peaks[1] / size,
                )
                # MJCF text has six digits of each number
                np.testing.assert_allclose((fx, fy), right, atol=1e-3 * factor * axle.lateral.peak)


def test_mu_scales_all_peaks_and_the_model_says_which_tires_it_has():
    plain, worn = Ground("forzaeth_nuc2"), Ground("forzaeth_nuc2", mu=0.8)
    front, rear = (axle.lateral.peak for axle in Tires.load("forzaeth_nuc2").axles)
    np.testing.assert_allclose(plain.forces.mu, [front, front, rear, rear], rtol=1e-5)
    np.testing.assert_allclose(worn.forces.mu, np.array([1.0, 1.0, rear / front, rear / front]) * 0.8, rtol=1e-5)
    assert worn.car.mu == 0.8
    read = tires_of(worn.model)
    for one, other in zip(read.axles, Tires.load("forzaeth_nuc2").axles, strict=True):
        assert one.lateral.peak_slip == pytest.approx(other.lateral.peak_slip, rel=1e-4)
    assert tires_of(Vehicle.load().spec(tires=Tires()).compile()).is_contact
    assert tires_of(Vehicle.load().compile()).model == Tires.load(DEFAULT_TIRES).model


def test_the_slip_meter_reads_the_tires_forces_and_where_they_are_past_the_peak():
    ground = Ground("slipx_reference")
    ground.place(4.5)
    ground.hold(3.0, 0.3, 4.5)
    ground.hold(0.05, 0.3, 4.5, record=True)
    slip = ground.meter.read()
    axle = Tires.load("slipx_reference").axles[0]
    past = np.abs(slip.slip_angle) > axle.lateral.peak_slip
    assert (slip.slides == past).all() and past[:, :2].all() and not past[:, 2:].any()
    assert (slip.sliding_speed[:, 2:] == 0.0).all() and (slip.sliding_speed[:, :2] > 0.1).all()
    load = slip.normal_force
    most = load * (load / 8.58) ** -0.15 * 1.1
    ellipse = np.hypot(slip.lateral_force / most, slip.longitudinal_force * 1.1 / 1.05 / most)
    np.testing.assert_allclose(slip.friction_utilisation, ellipse, rtol=1e-4)
    assert (slip.friction_utilisation < 1.0 + 1e-9).all()
    np.testing.assert_allclose(slip.friction_force, np.hypot(slip.lateral_force, slip.longitudinal_force), rtol=1e-12)


def put(ground, x=0.0, y=0.0, yaw=0.0, spin=0.0, seconds=0.3):
    """Let the car stand, then give it velocities [m/s, rad/s], of its wheels too."""
    ground.place()
    ground.hold(seconds)
    ground.data.qvel[0], ground.data.qvel[1], ground.data.qvel[5] = x, y, yaw
    for wheel in WHEELS:
        ground.data.joint(f"{wheel}_wheel").qvel = spin


MOTIONS = {
    "sideways": {"y": 3.0}, "locked": {"x": 4.0}, "spins its wheels": {"spin": 60.0},
    "spins": {"x": 1.0, "yaw": 15.0, "spin": 20.0}, "drifts": {"x": 4.0, "y": -2.0, "yaw": 3.0, "spin": 80.0},
}  # fmt: skip


def slow_means(ground, command, count):
    """The mean forces of the tires in the next physics step, along, across and up, by tiny steps in numpy. (4, 3) [N].

    M and J are MuJoCo's at the state; the laws are those of vehicle/tires in Python; all is seen from the car. What is
    tied rigidly is solved with the multipliers of Lagrange, in the coordinates of the joints.
    """
    model, h = ground.model, ground.model.opt.timestep
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state_of(ground), STATE)
    ground.car.apply(data, command)
    mujoco.mj_forward(model, data)  # the contacts of the tires are off
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    inertia += h * np.diag(model.dof_damping)
    for name in ("steering", "front_left_kingpin", "front_right_kingpin"):  # they are put where the servo has them
        dof = model.joint(name).dofadr[0]
        inertia[dof, dof] += 1e3
    jacobian, points, headings, turns, spins = np.zeros((15, model.nv)), [], [], [], []
    car = model.joint("base_link")
    for k, wheel in enumerate(WHEELS):
        body, tire = data.body(f"{wheel}_wheel"), data.geom(f"{wheel}_tire")
        squares = tire.xmat.reshape(3, 3) @ np.diag(model.geom(f"{wheel}_tire").size ** 2) @ tire.xmat.reshape(3, 3).T
        lowest = tire.xpos - squares[:, 2] / math.sqrt(squares[2, 2])
        depth = -lowest[2]
        points.append(depth)
        mujoco.mj_jac(
            model, data, jacobian[3 * k : 3 * k + 3], None, lowest * (1, 1, 0.5), model.body(f"{wheel}_wheel").id
        )
        turning = np.zeros((3, model.nv))
        mujoco.mj_jacBody(model, data, None, turning, model.body(f"{wheel}_wheel").id)
        turning[:, model.joint(f"{wheel}_wheel").dofadr[0]] = 0.0
        turning[:, car.dofadr[0] : car.dofadr[0] + 6] = 0.0  # seen from the car, whose velocity then turns backwards
        axle = body.xmat.reshape(3, 3) @ model.jnt_axis[model.joint(f"{wheel}_wheel").id]
        headings.append(math.atan2(-axle[0], axle[1]))
        turns.append((turning @ data.qvel)[2])
        spin = model.joint(f"{wheel}_wheel").dofadr[0]
        spins.append(spin)
        jacobian[12, spin] = 0.01225  # a quarter of the wheels' radius
        jacobian[13 + k // 2, spin] = -0.5 if k % 2 else 0.5
    motor = model.actuator("speed").id
    gain, bias = model.actuator_gainprm[motor, 0] * data.ctrl[motor], model.actuator_biasprm[motor]
    least, most = model.actuator_forcerange[motor]
    before, length = data.actuator_force[motor], data.actuator_length[motor]
    solved = tied(inertia, jacobian, spins, ground.line)
    free = jacobian @ solved @ data.qfrc_smooth
    for k in range(4):
        vx, vy, yaw_rate = data.qvel[[car.dofadr[0], car.dofadr[0] + 1, car.dofadr[0] + 5]]
        free[3 * k : 3 * k + 2] += yaw_rate * np.array((vy, -vx))
    mobility = jacobian @ solved @ jacobian.T
    w, depth, dt, sums = jacobian @ data.qvel, np.array(points), h / count, np.zeros((4, 3))
    deflection = ground.tires[:, [ALONG, ACROSS]].copy()
    headings, turns, axles = np.array(headings), np.array(turns), ground.tire_set.on(1.0489).axles
    own_torques = inertia @ solved  # of a wheel's own inertia, by forces of the joints
    spin_dofs = [model.joint(f"{wheel}_wheel").dofadr[0] for wheel in WHEELS]
    rolling = (jacobian[:12] @ data.qvel).reshape(4, 3)[:, :2]
    rolling -= data.qvel[spin_dofs, None] * jacobian[:12].reshape(4, 3, -1)[range(4), :2, spin_dofs]
    stiffness, damping, sigma, peak_slip, peak = np.repeat(
        [(axle.vertical_stiffness, axle.vertical_damping, axle.relaxation_length, axle.lateral.peak_slip,
          axle.lateral.peak) for axle in axles], 2, axis=0
    ).T  # fmt: skip
    rubber = ground.forces.rows["damping"]
    for i in range(count):
        angle, force = headings + turns * dt * (i + 0.5), np.zeros(15)
        contacts = w[:12].reshape(4, 3)
        load = stiffness * depth - damping * contacts[:, 2]
        load[(depth <= 0.0) | (load <= 0.0)] = 0.0
        cos, sin = np.cos(angle), np.sin(angle)
        axes = np.array([[cos, sin], [-sin, cos]])  # ahead and left, their x and y, of each tire
        slide = np.einsum("axk,kx->ka", axes, contacts[:, :2])
        forward = np.abs(np.einsum("xk,kx->k", axes[0], rolling))[:, None]
        rate = slide - forward * deflection / sigma[:, None]
        fresh = deflection + dt * rate
        size = np.hypot(*fresh.T) / sigma / peak_slip
        fresh /= np.maximum(size, 1.0)[:, None]
        rate, deflection = (fresh - deflection) / dt, np.where(load[:, None] > 0.0, fresh, 0.0)
        slip = np.hypot(*fresh.T) / sigma
        grip = load * [axles[k // 2].lateral.force(each) for k, each in enumerate(slip.tolist())]
        pull = -(grip / sigma / np.maximum(slip, 1e-300))[:, None] * fresh
        pull -= rubber[:, None] * rate * np.column_stack((np.ones(4), np.maximum(1.0 - forward / 0.5, 0.0)))
        pull *= np.minimum(1.0, load * peak / np.maximum(np.hypot(*pull.T), 1e-12))[:, None]
        force[:12] = np.column_stack((np.einsum("axk,ka->kx", axes, pull), load)).ravel()
        sums += np.column_stack((pull, load))
        force[12] = np.clip(gain + bias[0] + bias[1] * length + bias[2] * w[12], least, most) - before
        length += dt * w[12]
        w = w + dt * (free + mobility @ force)
        for k, clutch in ((13, ground.line.front), (14, ground.line.rear)):
            if not clutch.locked and not clutch.is_open:
                outer = data.qfrc_smooth + force[:12] @ jacobian[:12]
                through = own_torques @ (outer + force[12] * jacobian[12]) - outer + before * jacobian[12]
                axle_torque = np.abs(through[spins[2 * k - 26 : 2 * k - 24]].sum())
                most = dt * (clutch.preload + clutch.ramp * axle_torque)
                w = w + mobility[k] * np.clip(-w[k] / mobility[k, k], -most, most)
        depth -= dt * w[2:12:3]
    return sums / count


def tied(inertia, jacobian, spins, line):
    """The accelerations of the joints by unit forces, of wheels that are tied and turn a motor. (nv, nv)."""
    turns = jacobian[12] / 0.049
    whole, rows = inertia + line.motor_inertia * np.outer(turns, turns), []
    if line.shaft:
        rows.append(np.zeros(len(inertia)))
        rows[0][spins] = 1.0, 1.0, -1.0, -1.0
    rows += [row for row, axle in zip(jacobian[13:], (line.front, line.rear), strict=True) if axle.locked]
    ties = np.array(rows).reshape(len(rows), len(inertia))
    both = np.block([[whole, ties.T], [ties, np.zeros((len(rows), len(rows)))]])
    return np.linalg.inv(both)[: len(inertia), : len(inertia)]


def state_of(ground):
    state = np.empty(mujoco.mj_stateSize(ground.model, STATE))
    mujoco.mj_getState(ground.model, ground.data, state, STATE)
    return state


LINES = {
    "open": {"centre": "open"}, "shaft": {}, "locked": {"rear_axle": "locked"}, "all locked": {"front_axle": "locked",
    "rear_axle": "locked"}, "limited": {"front_axle": "limited 0.02 0.1", "rear_axle": "limited 0.05 0.3"},
}  # fmt: skip


ALL_MOTIONS = (*MOTIONS, "corners", "brakes")


@each(
    ("tires", "timestep", "motion", "lines"),
    [
        (*tires, motion, "shaft")
        for tires in (("coulomb", 0.005), ("coulomb", 0.0001), (BRUSH, 0.0001))
        for motion in ALL_MOTIONS
    ]
    + [("coulomb", 0.005, motion, lines) for motion in ALL_MOTIONS for lines in LINES if lines != "shaft"],
)
@pytest.mark.slow
def test_mean_forces_are_those_of_tiny_steps_by_numpy(tires, timestep, motion, lines):
    """Of bristles, whose means decide whether a car that slides is right; in steps soon after the motion begins."""
    ground = Ground(tires, timestep=timestep, lines=LINES[lines])
    command = DriveCommand(steering_angle=0.0, speed=0.0)
    if motion in MOTIONS:
        put(ground, **MOTIONS[motion])
    else:
        ground.place(4.0)
        command = DriveCommand(steering_angle=0.15, speed=4.0) if motion == "corners" else command
        ground.hold(0.5, command.steering_angle, 4.0)
    ground.hold(0.02, command.steering_angle, command.speed)
    for _ in range(2):
        expected = slow_means(ground, command, 250 if timestep == 0.005 else 100)  # 1000 differ by .0007
        ground.hold(timestep, command.steering_angle, command.speed)
        found = ground.tires[:, [FORCE_ALONG, FORCE_ACROSS, LOAD]]
        share = 0.04 if lines == "all locked" else 0.03  # .006 with 32 short steps in place of 7
        assert np.abs(found - expected).max() < share * expected[:, 2].max()


def held_by(axle):
    """What bristles hold for 1 N of load [m], by slip: (2, 2001), by the trapezoidal rule up to the law's peak."""
    grid = np.linspace(0.0, axle.lateral.peak_slip, 2001)
    force = np.array([axle.lateral.force(each) for each in grid.tolist()])
    sums = np.concatenate(([0.0], np.cumsum(0.5 * (force[1:] + force[:-1])))) * grid[1]
    return grid, sums * axle.relaxation_length


def stored(ground, data, held):
    """What the tires hold [J]: their springs, and the bristles, as far as the peak of their law; see `held_by`."""
    total = 0.0
    for k, wheel in enumerate(WHEELS):
        axle, tire = ground.tire_set.axles[k // 2], data.geom(f"{wheel}_tire")
        turn, size = tire.xmat.reshape(3, 3), ground.model.geom(f"{wheel}_tire").size
        depth = math.sqrt((turn @ np.diag(size**2) @ turn.T)[2, 2]) - tire.xpos[2]
        if depth > 0.0:
            slip = np.hypot(*ground.tires[k, [ALONG, ACROSS]]) / axle.relaxation_length
            total += axle.vertical_stiffness * depth * (0.5 * depth + np.interp(slip, *held[k // 2]))
    return total


@each(
    ("tires", "lines"),
    [(tires, "shaft") for tires in LAWS_OF_OURS if tires != "f1tenth_gym"]
    + [("coulomb", lines) for lines in LINES if lines != "shaft"],
)
@each("motion", MOTIONS)
@pytest.mark.slow
def test_with_the_motor_off_energy_never_rises(tires, lines, motion):
    """Kinetic, of height and springs, and what the tires hold; by steps of the first order by .02 J of 4 to 33.

    Linear tires have no energy that they hold: their force at a deflection grows with the load, without bound.
    """
    ground = Ground(tires, lines=LINES[lines])
    ground.model.actuator_gainprm[ground.model.actuator("speed").id] = 0.0
    ground.model.actuator_biasprm[ground.model.actuator("speed").id] = 0.0
    ground.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    put(ground, **MOTIONS[motion])
    alongside, energies = mujoco.MjData(ground.model), []
    held = [held_by(axle) for axle in ground.tire_set.on(1.0489).axles]
    for _ in range(300):
        mujoco.mj_setState(ground.model, alongside, state_of(ground), STATE)
        mujoco.mj_forward(ground.model, alongside)
        turning = ground.line.motor_inertia * (alongside.ten_velocity[0] / 0.049) ** 2
        energies.append(alongside.energy.sum() + 0.5 * turning + stored(ground, alongside, held))
        ground.hold(0.005)
    energies = np.array(energies)
    assert energies[0] - energies[-1] > 1.0
    assert (energies - np.minimum.accumulate(energies)).max() < 0.02


@each("motion", [motion for motion in MOTIONS if motion != "spins"])
def test_the_sum_of_the_forces_is_mass_times_acceleration(motion):
    """Newton in each step of a car that slides: the mean forces, at the heading in the middle of the step."""
    ground = Ground("coulomb")
    put(ground, **MOTIONS[motion])
    ground.hold(0.02)
    base, mass = ground.model.body("base_link").id, ground.car.parameters.mass
    for _ in range(60):
        mujoco.mj_forward(ground.model, ground.data)
        mujoco.mj_subtreeVel(ground.model, ground.data)
        before = ground.data.subtree_linvel[base].copy()
        heading = ground.car.pose(ground.data)[2]
        ground.hold(0.005)
        mujoco.mj_forward(ground.model, ground.data)
        mujoco.mj_subtreeVel(ground.model, ground.data)
        gained = mass * (ground.data.subtree_linvel[base] - before) / 0.005
        turned = math.remainder(ground.car.pose(ground.data)[2] - heading, math.tau)
        middle = heading + 0.5 * turned
        along, across = ground.tires[:, FORCE_ALONG].sum(), ground.tires[:, FORCE_ACROSS].sum()
        expected = (
            math.cos(middle) * along - math.sin(middle) * across, math.sin(middle) * along + math.cos(middle) * across,
            ground.tires[:, LOAD].sum() - mass * 9.81,
        )  # fmt: skip
        # MuJoCo's step has the centripetal force of the centre of gravity, .17 m off base_link, at the step's beginning
        behind = mass * ground.car.parameters.rear_axle_distance * (turned / 0.005) ** 2 * abs(0.5 * turned)
        np.testing.assert_allclose(gained, expected, atol=0.02 * mass * 9.81 + 1.5 * behind)


def test_ackermanns_angles_are_exact_while_the_servo_turns_and_the_car_slides():
    """To 1e-4 rad of cot(outer) - cot(inner) = track width / wheelbase, by the fit of models/f1tenth.xml."""
    ground, rng, worst = Ground("coulomb"), np.random.default_rng(0), 0.0
    car, data = ground.car.parameters, ground.data
    ground.place(5.0)
    for _ in range(100):
        steering, speed = rng.uniform((-0.5, -5.0), (0.5, 12.0))
        for _ in range(5):
            ground.hold(0.005, steering, speed)
            tangent = math.tan(data.joint("steering").qpos[0])
            for side, name in ((1, "left"), (-1, "right")):
                exact = math.atan(tangent / (1.0 - side * 0.5 * car.track_width / car.wheelbase * tangent))
                worst = max(worst, abs(data.joint(f"front_{name}_kingpin").qpos[0] - exact))
    assert worst < 2e-4  # of which 1.6e-4 are the polynomial's
    fit = [
        ground.model.eq_data[equality, :5]
        for equality in range(ground.model.neq)
        if ground.model.eq_type[equality] == 2
    ]
    angle = data.joint("steering").qpos[0]
    knuckles = [data.joint(f"front_{name}_kingpin").qpos[0] for name in ("left", "right")]
    assert knuckles == pytest.approx([np.polynomial.Polynomial(c)(angle) for c in fit], abs=1e-12)


def test_rolling_resistance_slows_a_car_that_coasts_as_asked():
    """c g of the car's mass; its wheels and its motor turn, too: theirs is (4 I + J) / r^2 more."""
    ends = []
    for asked in (0.0, 0.02):
        axle = replace(Tires.load("coulomb").axles[0], rolling_resistance=asked)
        ground = Ground(Tires(model="coulomb", front=axle, rear=axle, name="rolls"))
        ground.model.actuator_gainprm[ground.model.actuator("speed").id] = 0.0
        ground.model.actuator_biasprm[ground.model.actuator("speed").id] = 0.0
        ground.place(4.0)
        ground.hold(0.5)
        start = ground.car.ground_speed(ground.data)
        ground.hold(2.0)
        ends.append((start - ground.car.ground_speed(ground.data)) / 2.0)
    mass = ground.car.parameters.mass
    whole = mass + (4.0 * 1.7e-4 + 3e-4) / ground.car.parameters.wheel_radius**2
    assert ends[1] - ends[0] == pytest.approx(0.02 * 9.81 * mass / whole, rel=0.01)
    assert ends[0] == pytest.approx(0.0, abs=0.005)


MIXED = fg.World("oval", tires="contact", others=(WorldCar(tires="coulomb"), WorldCar(tires="slipx_reference")))


def drive_mixed(engine, ticks, commands=((0.1, 2.0), (0.3, 4.0), (-0.2, 3.0))):
    for _ in range(ticks):
        engine.sense()
        engine.commands[:] = np.tile(commands, (engine.count, 1))
        engine.drive()
        engine.judge()
    return [engine.state(i).copy() for i in range(engine.count)]


def placed(engine):
    engine.place([Start(s=2.0 * car + 0.5 * i) for i in range(engine.count) for car in range(engine.cars_per_world)])
    return engine


def test_worlds_of_cars_on_different_tires_have_the_bits_of_steps_by_hand():
    """Car 0 on contacts, the others on laws of ours; each slip meter reads its own car's tires."""
    engine = placed(Engine(MIXED))
    model = copy(MIXED.model)
    data, forces = mujoco.MjData(model), TireForces(model, [car.prefix for car in MIXED.cars])
    mujoco.mj_setState(model, data, engine.state(0), STATE)
    meters = [TireSlipMeter(model, car.prefix) for car in MIXED.cars]
    for _ in range(20):
        for car, (steering, speed) in zip(MIXED.cars, ((0.1, 2.0), (0.3, 4.0), (-0.2, 3.0)), strict=True):
            car.apply(data, DriveCommand(steering_angle=steering, speed=speed))
        for _ in range(engine.substeps):
            forces.step(data)
            for meter in meters:
                meter.record(data)
    (driven,) = drive_mixed(engine, 20)
    state = np.empty_like(driven)
    mujoco.mj_getState(model, data, state, STATE)
    assert state.tobytes() == driven.tobytes()
    loads = [np.nan_to_num(meter.read().normal_force).sum(axis=1).mean() for meter in meters]
    assert loads == pytest.approx([MIXED.parameters.mass * 9.81] * 3, rel=0.02)


@each("threads", [2, 3])
def test_a_world_has_its_bits_in_any_batch_order_and_number_of_threads(threads):
    alone = []
    for i in range(5):
        engine = Engine(MIXED)
        engine.place([Start(s=2.0 * car + 0.5 * i) for car in range(3)])
        alone.append(drive_mixed(engine, 8)[0].tobytes())
    together = drive_mixed(placed(Engine(MIXED, 5, threads=threads)), 8)
    assert [state.tobytes() for state in together] == alone
    backwards = Engine(MIXED, 5, threads=threads)
    backwards.place([Start(s=2.0 * car + 0.5 * i) for i in reversed(range(5)) for car in range(3)])
    assert [state.tobytes() for state in reversed(drive_mixed(backwards, 8))] == alone


@each("stop", [1, 3, 4, 7])
def test_a_state_holds_all_that_the_next_step_depends_on(stop):
    """Stopped in the middle of a slide, at any physics step, and gone on with in another engine: the same bits."""
    world = fg.World("oval", tires="coulomb", patches=(fg.Patch(x=1.0, y=0.0, length=1.0, width=3.0, mu=0.3),))
    engine, states = Engine(world), []
    engine.place([Start(speed=5.0)])
    engine.after_substep.append(lambda engine, _: states.append(engine.state(0).copy()))
    drive_mixed(engine, 4, ((0.4, 0.0),))
    assert np.nanmax(engine.slip()[0]) > 0.05
    again, seen = Engine(world, period=0.005), []
    again.load(states[stop - 1])
    again.after_substep.append(lambda engine, _: seen.append(engine.state(0).copy()))
    for state in states[stop:]:
        first, end = again._batches[0].layout.ctrl
        again.drive(controls=state[np.newaxis, first:end])
    assert [state.tobytes() for state in seen] == [state.tobytes() for state in states[stop:]]


def test_mujocos_stages_called_in_turn_are_its_step():
    """Bit for bit, sensors too: two cars on contacts, one of which drives into a wall and one into the other."""
    world = fg.World("oval", tires="contact", others=(WorldCar(tires="contact"),))
    world.model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER  # that of the stages
    world.model.dof_damping[:] = 0.0  # which Euler's step takes implicitly in the end, and ours from the beginning on
    engine = Engine(world)
    engine.place([Start(s=1.0, speed=2.0), Start(s=0.2, speed=5.0)])
    datas = [mujoco.MjData(world.model) for _ in range(2)]
    for data in datas:
        mujoco.mj_setState(world.model, data, engine.state(0), STATE)
        world.cars[0].apply(data, DriveCommand(steering_angle=0.4, speed=4.0))
        world.cars[1].apply(data, DriveCommand(steering_angle=0.0, speed=6.0))
    touched, addresses = set(), (world.model._address, datas[1]._address)
    for _ in range(250):
        mujoco.mj_step(world.model, datas[0])
        core.step_on_tires(*addresses, np.zeros(0, GEAR), np.zeros(0, TIRE), np.zeros((0, 4)), True)
        found = [np.empty(len(engine.state(0))) for _ in datas]
        for data, state in zip(datas, found, strict=True):
            mujoco.mj_getState(world.model, data, state, STATE)
        assert found[0].tobytes() == found[1].tobytes()
        assert datas[0].sensordata.tobytes() == datas[1].sensordata.tobytes()
        touched |= {world.model.geom(int(geom)).name for pair in datas[0].contact.geom for geom in pair}
    assert any(name.startswith("wall") for name in touched) and {"car/chassis", "car_1/chassis"} <= touched
