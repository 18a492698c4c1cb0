"""The forces of tires with a curve in the physics: what holds a car, and what the kernel makes of a slip."""

import math

import mujoco
import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.tire_forces import (
    ACROSS,
    ALONG,
    FORCE_ACROSS,
    FORCE_ALONG,
    LOAD,
    USERDATA,
    TireForces,
    deflect,
    grip_of,
)
from fg_mujoco.vehicle.tire_slip import add_axle_sensors
from fg_mujoco.vehicle.tires import Tires, tires_of
from fg_mujoco.vehicle.vehicle import Vehicle

SETS = ("slipx_reference", "forzaeth_nuc2", "forzaeth_nuc7", "coulomb", "f1tenth_gym")


class Ground:
    """A car on tires of a set, on endless ground."""

    def __init__(self, tires, *, timestep=0.005, mu=None):
        self.model = Vehicle.load().spec(mu, tires=Tires.load(tires)).compile()
        self.model.opt.timestep = timestep
        self.data = mujoco.MjData(self.model)
        self.car, self.forces, self.meter = Car(self.model), TireForces(self.model), fg.TireSlipMeter(self.model)

    def place(self, speed=0.0, heading=0.0):
        mujoco.mj_resetData(self.model, self.data)
        self.car.set_pose(self.data, 0.0, 0.0, heading, speed)
        self.forces.begin(self.data)

    def hold(self, seconds, steering=0.0, speed=0.0, record=False):
        for _ in range(round(seconds / self.model.opt.timestep)):
            self.car.apply(self.data, DriveCommand(steering_angle=steering, speed=speed))
            self.forces.apply(self.data)
            mujoco.mj_step(self.model, self.data)
            self.forces.end(self.data)
            if record:
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


@pytest.mark.parametrize("tires", SETS)
@pytest.mark.parametrize("direction", [0.0, 0.5 * math.pi, 0.8])
def test_a_car_with_blocked_wheels_stays_on_a_slope(tires, direction):
    """20 %, any way: once it has settled it moves by less than .01 mm in 30 s; a contact would creep by 14 mm."""
    ground = Ground(tires)
    slope = math.atan(0.2)
    down = -9.81 * math.sin(slope)
    gravity = (down * math.cos(direction), down * math.sin(direction), -9.81 * math.cos(slope))
    ground.model.opt.gravity[:] = gravity
    ground.block_wheels()
    ground.place()
    ground.hold(3.0)
    before = ground.data.qpos[:3].copy()
    ground.hold(30.0)
    assert np.abs(ground.data.qpos[:3] - before).max() < 1e-5
    mass = ground.car.parameters.mass
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, ground.data.qpos[3:7])
    push = np.array([ground.tires[:, FORCE_ALONG].sum(), ground.tires[:, FORCE_ACROSS].sum()])
    np.testing.assert_allclose(push, -mass * np.array(gravity[:2]), rtol=0.01, atol=0.02)  # Newton


@pytest.mark.parametrize("tires", SETS)
def test_a_car_that_stops_stands_still_and_one_that_slides_sideways_does_not_spring_back(tires):
    ground = Ground(tires)
    ground.place(3.0)
    ground.hold(4.0)
    assert np.abs(ground.data.qvel).max() < 1e-6
    if tires == "f1tenth_gym":
        return
    ground.place()
    ground.hold(0.2)
    ground.data.qvel[1] = 3.0
    ground.hold(2.0)
    reached = ground.data.qpos[1]
    mu = ground.forces.mu.mean()
    assert 0.5 < reached * 2.0 * mu * 9.81 / 9.0 < 2.0  # v^2 / 2 mu g
    ground.hold(2.0)
    assert abs(ground.data.qpos[1] - reached) < 1e-4


@pytest.mark.parametrize(
    ("tires", "steering", "speed"),
    [("slipx_reference", 0.1, 4.0), ("slipx_reference", 0.1, 5.5), ("slipx_reference", 0.3, 4.5), ("coulomb", 0.3, 4.5),
     ("forzaeth_nuc7", 0.1, 5.5)],
)  # fmt: skip
def test_circles_are_steady_and_the_same_at_5_ms_and_at_half_a_millisecond(tires, steering, speed):
    """Holding and past the peak: no hop, and the timestep does not count."""
    found = []
    for timestep in (0.005, 0.0005):
        ground = Ground(tires, timestep=timestep)
        ground.place(speed)
        ground.hold(4.0, steering, speed)
        rows = []
        for _ in range(200):
            ground.hold(timestep, steering, speed)
            rows.append(ground.tires.copy())
        rows = np.array(rows)
        assert np.ptp(rows[:, :, LOAD], axis=0).max() < 1e-6 * rows[:, :, LOAD].mean()
        assert np.ptp(rows[:, :, ACROSS], axis=0).max() < 1e-6
        found.append((np.hypot(*ground.data.qvel[:2]), ground.data.qvel[5], *rows[-1, :, ACROSS]))
    np.testing.assert_allclose(found[0], found[1], rtol=5e-4)


def test_the_tires_forces_are_those_that_move_the_car():
    """Newton and Euler of the whole car, from the sensors: mass times acceleration in the centre of gravity."""
    ground = Ground("slipx_reference")
    ground.place(4.0)
    ground.hold(3.0, 0.1, 4.0)  # a steady circle: the centripetal force
    slip_x, slip_y = ground.tires[:, FORCE_ALONG], ground.tires[:, FORCE_ACROSS]
    turned = [float(ground.data.joint(f"front_{side}_kingpin").qpos[0]) for side in ("left", "right")] + [0.0, 0.0]
    side = sum(x * math.sin(a) + y * math.cos(a) for x, y, a in zip(slip_x, slip_y, turned, strict=True))
    assert side == pytest.approx(centripetal(ground), rel=0.003)


@pytest.mark.parametrize("tires", ["slipx_reference", "forzaeth_nuc7", "f1tenth_gym"])
@pytest.mark.parametrize("speed", [1.0, 3.0, 8.0])
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
                while rolled < 60.0 * axle.relaxation_length:
                    along, across, fx, fy = deflect(row, along, across, velocity, grip, load, 0.005)
                    rolled += 0.005 * speed
                    share = across / axle.relaxation_length
                    expected = math.tan(angle) * (1.0 - math.exp(-rolled / axle.relaxation_length))
                    assert share == pytest.approx(expected, rel=1e-3, abs=1e-12)
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


def test_a_tire_in_the_air_has_no_force_and_no_deflection():
    ground = Ground("slipx_reference")
    ground.place(3.0)
    ground.hold(1.0, 0.2, 3.0)
    assert np.abs(ground.tires[:, ACROSS]).min() > 1e-4
    ground.data.qpos[2] += 0.5
    ground.hold(0.05, 0.2, 3.0)
    assert (ground.tires[:, [ALONG, ACROSS, LOAD, FORCE_ALONG, FORCE_ACROSS]] == 0.0).all()
    assert (ground.data.xfrc_applied == 0.0).all()


def test_mu_scales_all_peaks_and_the_model_says_which_tires_it_has():
    plain, worn = Ground("forzaeth_nuc2"), Ground("forzaeth_nuc2", mu=0.8)
    front, rear = (axle.lateral.peak for axle in Tires.load("forzaeth_nuc2").axles)
    np.testing.assert_allclose(plain.forces.mu, [front, front, rear, rear], rtol=1e-5)
    np.testing.assert_allclose(worn.forces.mu, np.array([1.0, 1.0, rear / front, rear / front]) * 0.8, rtol=1e-5)
    assert worn.car.mu == 0.8
    read = tires_of(worn.model)
    for one, other in zip(read.axles, Tires.load("forzaeth_nuc2").axles, strict=True):
        assert one.lateral.peak_slip == pytest.approx(other.lateral.peak_slip, rel=1e-4)
    assert tires_of(Vehicle.load().compile()).is_contact


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


def test_the_slip_meter_reads_force_and_slip_of_contacts_in_the_wheels_frame():
    """By Newton: the sum over the tires, turned by the wheels' angles, is what the car's mass needs."""
    ground = Ground("contact")
    spec = Vehicle.load().spec()
    add_axle_sensors(spec)
    ground.model = spec.compile()
    ground.data, ground.car = mujoco.MjData(ground.model), Car(ground.model)
    ground.forces, ground.meter = TireForces(ground.model), fg.TireSlipMeter(ground.model)
    ground.place(3.0, heading=0.9)
    ground.hold(2.0, 0.2, 3.0)
    ground.hold(0.005, 0.2, 3.0, record=True)
    slip = ground.meter.read()
    turned = np.array([*(ground.data.joint(f"front_{side}_kingpin").qpos[0] for side in ("left", "right")), 0.0, 0.0])
    fx, fy = slip.longitudinal_force[0], slip.lateral_force[0]
    assert (fx * np.sin(turned) + fy * np.cos(turned)).sum() == pytest.approx(centripetal(ground), rel=0.01)
    behind = ground.car.parameters.mass * ground.data.qvel[5] ** 2 * ground.car.parameters.rear_axle_distance
    assert (fy * np.sin(turned) - fx * np.cos(turned)).sum() == pytest.approx(behind, rel=0.05)  # the circle's middle
    np.testing.assert_allclose(slip.friction_force, np.hypot(fx, fy)[np.newaxis], rtol=1e-9)
    assert (slip.slip_angle[0] > 0.0).all() and (slip.slip_angle[0] < 0.02).all()  # it creeps
