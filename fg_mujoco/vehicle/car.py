"""A car in a compiled model: reads its sensors, places it and drives it, under any prefix.

The MJCF is the source of every constant. Names are resolved once, when a `Car` is built; a tick then indexes arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from ..arguments import explain_class
from ..display import brief
from ..errors import ModelError
from ..messages import ODOMETRY, CarParameters, DriveCommand, Odometry
from ..native import core
from . import motion as car_motion
from .drive_line import DriveLine
from .steering_servo import response
from .tires import tires_of

WHEELS = ("front_left", "front_right", "rear_left", "rear_right")
"""Order of everything that is one per wheel."""


def element_id(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> int:
    """Return the index of a named element; ModelError: the model has none of that name."""
    index = mujoco.mj_name2id(model, kind, name)
    if index < 0:
        noun = kind.name.removeprefix("mjOBJ_").lower()
        raise ModelError(f"the model has no {noun} named {name!r}; accepted: a model with the car under this prefix")
    return int(index)


def sensor_slice(model: mujoco.MjModel, name: str) -> slice:
    """Return where in `data.sensordata` the readings of a named sensor are; ModelError: there is none of that name."""
    sensor = element_id(model, mujoco.mjtObj.mjOBJ_SENSOR, name)
    start = int(model.sensor_adr[sensor])
    return slice(start, start + int(model.sensor_dim[sensor]))


def command_delay(model: mujoco.MjModel, prefix: str = "") -> float:
    """Return the time from a command to the servos of a car [s], to the later one."""
    servos = [element_id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, f"{prefix}{name}") for name in ("steering", "speed")]
    return float(model.actuator_delay[servos].max())


def car_parameters(model: mujoco.MjModel, prefix: str = "") -> CarParameters:
    """Return the parameters of a car for planners, read off the compiled model at rest (qpos0); its tires as published.

    Raises:
      ModelError: the model does not hold the car under this prefix.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base = element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}base_link")
    origin, axes = data.xpos[base], data.xmat[base].reshape(3, 3)

    bodies = np.flatnonzero(model.body_rootid == model.body_rootid[base])
    masses = model.body_mass[bodies]
    mass = float(masses.sum())
    positions = (data.xipos[bodies] - origin) @ axes
    center_of_gravity = masses @ positions / mass
    # parallel axes: each body's own inertia about the car's z, and its mass at its distance from the CoG
    own_axes = data.ximat[bodies].reshape(-1, 3, 3)
    own_inertia = np.einsum("bi,bi->b", model.body_inertia[bodies], np.einsum("bki,k->bi", own_axes, axes[:, 2]) ** 2)
    lever = positions[:, :2] - center_of_gravity[:2]
    yaw_inertia = float(own_inertia.sum() + masses @ (lever**2).sum(axis=1))

    ground = element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}ground")
    over_ground = float((origin - data.geom_xpos[ground]) @ axes[:, 2])
    wheels = [element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}{wheel}_wheel") for wheel in WHEELS]
    front_left, front_right, rear_left, _ = (data.xpos[wheels] - origin) @ axes
    line, tires, gravity = DriveLine.of(model, prefix), tires_of(model, prefix), -float(model.opt.gravity[2])
    wheel_radius = line.wheel_radius
    chassis = element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}chassis")
    half_length, half_width = (float(half) for half in model.geom_size[chassis, :2])

    spins = [element_id(model, mujoco.mjtObj.mjOBJ_JOINT, f"{prefix}{wheel}_wheel") for wheel in WHEELS]
    dofs = model.jnt_dofadr[spins]
    effective_mass = mass + (float(model.dof_M0[dofs].sum()) + line.motor_inertia) / wheel_radius**2
    steering, joints = steering_of(model, prefix)
    steering_angle, steering_rate, steering_time_constant = response(model, steering, joints)
    drive = element_id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, f"{prefix}speed")
    speed_gain = _positive(model.actuator_gainprm[drive, 0], "gain of actuator 'speed'")
    stateless = model.actuator_dyntype[drive] == mujoco.mjtDyn.mjDYN_NONE
    filtered = 0.0 if stateless else float(model.actuator_dynprm[drive, 0])  # [s] of a command, before the servo
    power_limit = element_id(model, mujoco.mjtObj.mjOBJ_NUMERIC, f"{prefix}power_limit_speed")
    lidar_mount = element_id(model, mujoco.mjtObj.mjOBJ_SITE, f"{prefix}lidar_mount")

    # a motor that feeds no speed back holds it by this damping: it is its servo, and slows nothing
    damping = float(model.dof_damping[dofs].sum()) if model.actuator_biasprm[drive, 2] < 0.0 else 0.0
    return CarParameters(
        wheelbase=float(front_left[0] - rear_left[0]),
        track_width=float(front_left[1] - front_right[1]),
        length=2.0 * half_length,
        width=2.0 * half_width,
        rear_overhang=half_length - float(model.geom_pos[chassis, 0]),
        mass=mass,
        front_axle_distance=float(front_left[0] - center_of_gravity[0]),
        rear_axle_distance=float(center_of_gravity[0] - rear_left[0]),
        center_of_gravity_height=float(center_of_gravity[2]) + over_ground,
        yaw_inertia=yaw_inertia,
        wheel_radius=wheel_radius,
        wheel_inertia=float((model.dof_M0[dofs] - model.dof_armature[dofs]).mean()),
        max_steering_angle=steering_angle,
        max_steering_rate=steering_rate,
        min_speed=float(model.actuator_ctrlrange[drive, 0]),
        max_speed=float(model.actuator_ctrlrange[drive, 1]),
        max_acceleration=_greatest_force(model, drive) / effective_mass,
        power_limit_speed=float(model.numeric_data[model.numeric_adr[power_limit]]),
        speed_time_constant=effective_mass / speed_gain + filtered,
        lidar_offset=float(model.site_pos[lidar_mount, 0]),
        gravity=gravity,
        steering_time_constant=steering_time_constant,
        command_delay=command_delay(model, prefix),
        drives_front="front" in line.driven,
        drives_rear="rear" in line.driven,
        shaft=line.shaft,
        front_lock=line.front.lock,
        rear_lock=line.rear.lock,
        rolling_resistance=(tires.rolling_resistance * mass * gravity + line.drag_brake) / effective_mass,
        rolling_damping=damping / wheel_radius**2 / effective_mass,
        **tires.for_planners(),
    )


def steering_of(model: mujoco.MjModel, prefix: str = "") -> tuple[int, tuple[int, int, int]]:
    """Return a car's steering servo, and the joints of steering, left and right kingpin; ModelError: no such car."""
    joint, names = mujoco.mjtObj.mjOBJ_JOINT, ("steering", "front_left_kingpin", "front_right_kingpin")
    steering, left, right = (element_id(model, joint, f"{prefix}{name}") for name in names)
    return element_id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, f"{prefix}steering"), (steering, left, right)


def _greatest_force(model: mujoco.MjModel, drive: int) -> float:
    """Return the force that the drive has in both directions [N]: of the servo, its tendon, and the wheels' joints."""
    tendon = int(model.actuator_trnid[drive, 0])
    gear = abs(float(model.actuator_gear[model.actuator_outadr[drive], 0]))
    forces = [gear * float(np.abs(model.actuator_forcerange[drive]).min())]
    if model.tendon_actfrclimited[tendon]:
        forces.append(float(np.abs(model.tendon_actfrcrange[tendon]).min()))
    for wrap in range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon]):
        joint = int(model.wrap_objid[wrap])
        if model.jnt_actfrclimited[joint]:
            forces.append(float(np.abs(model.jnt_actfrcrange[joint]).min() / model.wrap_prm[wrap]))
    return min(forces)


def _positive(value: Any, what: str) -> float:
    """Return a number by which others are divided."""
    if not 0.0 < value < math.inf:
        raise ModelError(f"{what} is {value:g}; accepted: a number above 0")
    return float(value)


@explain_class
class Car:
    """One car in a compiled model: reads its sensors, places it and drives it.

    Attributes:
      mu: friction coefficient of the tires, or the greatest lateral peak of those with a curve [-].
      chassis_contact: where in sensordata the chassis' contact is.
      constants: where it is in the model and its limits, (1,) of car_motion.CAR.

    Raises:
      ModelError: the model does not hold the car under this prefix.
    """

    def __init__(self, model: mujoco.MjModel, prefix: str = "") -> None:
        self.parameters = car_parameters(model, prefix)
        self.prefix = prefix
        pairs = [element_id(model, mujoco.mjtObj.mjOBJ_PAIR, f"{prefix}{wheel}_tire") for wheel in WHEELS]
        self.mu = float(model.pair_friction[pairs, 0].max())  # [-] of the tires
        self._model = model
        joints = mujoco.mjtObj.mjOBJ_JOINT
        base = element_id(model, joints, f"{prefix}base_link")
        root = model.body_rootid[model.jnt_bodyid[base]]
        self._free_qpos = int(model.jnt_qposadr[base])
        self._free_dof = int(model.jnt_dofadr[base])
        car_joints = np.flatnonzero(model.body_rootid[model.jnt_bodyid] == root)
        self._hinges_and_slides = model.jnt_qposadr[car_joints[car_joints != base]]
        self._dofs = np.flatnonzero(model.body_rootid[model.dof_bodyid] == root)
        self._wheel_dofs = model.jnt_dofadr[[element_id(model, joints, f"{prefix}{wheel}_wheel") for wheel in WHEELS]]

        actuators = mujoco.mjtObj.mjOBJ_ACTUATOR
        self._steering_ctrl = element_id(model, actuators, f"{prefix}steering")
        self._speed_ctrl = element_id(model, actuators, f"{prefix}speed")
        self.chassis_contact = sensor_slice(model, f"{prefix}chassis_contact").start
        constants = np.zeros(1, car_motion.CAR)
        constants["free_qpos"], constants["free_dof"] = self._free_qpos, self._free_dof
        constants["steering_qpos"] = model.jnt_qposadr[element_id(model, joints, f"{prefix}steering")]
        constants["wheel_dofs"] = self._wheel_dofs
        constants["driven"] = 0 if self.parameters.drives_front else 2, 4 if self.parameters.drives_rear else 2
        constants["accelerometer"] = sensor_slice(model, f"{prefix}accelerometer").start
        constants["steering_ctrl"], constants["speed_ctrl"] = self._steering_ctrl, self._speed_ctrl
        for name in ("wheel_radius", "max_steering_angle", "min_speed", "max_speed", "rear_axle_distance"):
            constants[name] = getattr(self.parameters, name)
        constants.flags.writeable = False
        self.constants = constants
        self._row = np.zeros(1, ODOMETRY)
        self._values = self._row.view(np.float64)  # of the row, quicker to read

    def __repr__(self) -> str:
        return brief(self, f"mu {self.mu:.4g}", repr(self.parameters))

    def odometry(self, data: mujoco.MjData) -> Odometry:
        """Read the wheel encoders, the steering sensor and the gyro at the present state, and the accelerometer.

        The accelerometer, in the CoG, is that of the last physics step: of the state at its start.
        """
        car_motion.read_odometry(data.time, data.qpos, data.qvel, data.sensordata, self.constants, self._row)
        values = self._values
        return Odometry(
            stamp=values.item(0),
            speed=values.item(1),
            steering_angle=values.item(2),
            angular_velocity=values[3:6],
            linear_acceleration=values[6:9],
            wheel_speeds=values[9:13],
            pose=values[13:16],
        )

    def pose(self, data: mujoco.MjData) -> tuple[float, float, float]:
        """Return x [m], y [m] and heading [rad] of `base_link` in the world."""
        return car_motion.planar_pose(data.qpos, self.constants)

    def ground_speed(self, data: mujoco.MjData) -> float:
        """Return the true speed of `base_link` along its heading [m/s], forward positive."""
        return car_motion.ground_speed(data.qpos, data.qvel, self.constants)

    def set_pose(self, data: mujoco.MjData, x: float, y: float, heading: float, speed: float = 0.0) -> None:
        """Place the car as `write_pose` does, and update the sensors."""
        self.write_pose(data, x, y, heading, speed)
        mujoco.mj_forward(self._model, data)

    def write_pose(self, data: mujoco.MjData, x: float, y: float, heading: float, speed: float = 0.0) -> None:
        """Write the state of a car at rest on its springs, wheels straight and rolling at `speed` [m/s].

        x [m], y [m] and heading [rad] are `base_link`'s in the world. Nothing but the car is touched.
        """
        data.qpos[self._hinges_and_slides] = self._model.qpos0[self._hinges_and_slides]
        height, half = float(self._model.qpos0[self._free_qpos + 2]), 0.5 * heading
        pose: Sequence[float] = (x, y, height, math.cos(half), 0.0, 0.0, math.sin(half))
        ahead: Sequence[float] = (math.cos(heading), math.sin(heading), 0.0)
        if self._model.nhfield:
            pose, ahead = self._standing(x, y, heading, height)
        data.qpos[self._free_qpos : self._free_qpos + 7] = pose
        data.qvel[self._dofs] = 0.0
        data.qacc_warmstart[self._dofs] = 0.0
        data.qvel[self._free_dof : self._free_dof + 3] = [speed * part for part in ahead]
        data.qvel[self._wheel_dofs] = speed / self.parameters.wheel_radius
        data.ctrl[self._steering_ctrl] = 0.0
        data.ctrl[self._speed_ctrl] = speed

    def _standing(self, x: float, y: float, heading: float, height: float) -> tuple[Sequence[float], Sequence[float]]:
        """Return the pose (7,) of a car whose wheels stand on the ground as it is there, and where it heads (3,)."""
        own, cos, sin = self.parameters, math.cos(heading), math.sin(heading)
        grounds = [
            core.surface_at(self._model._address, x + cos * ahead - sin * aside, y + sin * ahead + cos * aside)[0]
            for ahead in (0.0, own.wheelbase) for aside in (0.5 * own.track_width, -0.5 * own.track_width)
        ]  # fmt: skip
        rear_left, rear_right, front_left, front_right = grounds
        rise = 0.5 * (front_left + front_right - rear_left - rear_right) / own.wheelbase
        lean = 0.5 * (front_left + rear_left - front_right - rear_right) / own.track_width
        up = np.array((-rise * cos + lean * sin, -rise * sin - lean * cos, 1.0))
        up /= np.linalg.norm(up)
        left = np.cross(up, (cos, sin, 0.0))
        left /= np.linalg.norm(left)
        ahead, turn = np.cross(left, up), np.empty(4)
        mujoco.mju_mat2Quat(turn, np.column_stack((ahead, left, up)).ravel())
        return (x, y, 0.5 * (rear_left + rear_right) + height / float(up[2]), *turn.tolist()), ahead.tolist()

    def apply(self, data: mujoco.MjData, command: DriveCommand) -> None:
        """Write a command to the actuators, held within their limits."""
        car_motion.drive(command.steering_angle, command.speed, self.constants, data.ctrl)

    def crashed(self, data: mujoco.MjData) -> bool:
        """Return whether the chassis touched a wall, an obstacle or another car, as of the last sensor update."""
        return bool(data.sensordata[self.chassis_contact] > 0.0)
