"""A VESC, the motor controller of F1TENTH cars: what it tells of motor and battery, and the odometry made of that.

The odometry is that of `vesc_to_odom` (f1tenth/vesc, vesc_ackermann/src/vesc_to_odom.cpp): the speed of the motor, and
a heading that is integrated from the commanded steering. No gyro and no wheel's encoder has a part in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arguments import explain_class
from ...errors import ModelError, SettingsError
from ...messages import FloatArray, require
from ..car import car_parameters, element_id
from .sensor import SENSORS, CarState, Sensor

AMBIENT = 25.0
"""[deg C] of the controller and of the motor: their heat is not simulated."""

_FORCE = "drive_force"  # the sensor of the MJCF that reads the force of the drive's servo
_STANDS = 0.05  # [m/s] below which vesc_to_odom takes the speed for 0
_NUMERICS = {
    "motor": "turns of the field a minute for 1 m/s, turns a minute for 1 V, pairs of poles, resistance [ohm]",
    "battery": "voltage without a load [V], resistance [ohm]",
}


@dataclass(frozen=True)
class Electrics:
    """Motor and battery of a car: the numerics `motor` and `battery` of its MJCF.

    Losses are those in the two resistances; friction, iron and switching are left out.
    """

    erpm_per_speed: float  # [1/min s/m] turns of the motor's field, which the VESC counts
    turns_per_volt: float  # [1/min/V] of the motor
    pole_pairs: float
    motor_resistance: float  # [ohm]
    full_voltage: float  # [V] of the battery without a load
    battery_resistance: float  # [ohm]

    @property
    def volts_per_speed(self) -> float:
        """[V s/m] that the motor makes, and its force [N/A], 60 / (2 pi turns_per_volt) of torque at the ground."""
        return self.erpm_per_speed / self.pole_pairs / self.turns_per_volt

    @classmethod
    def of(cls, numerics: Mapping[str, Sequence[float]]) -> Electrics:
        """Return those of a car's numerics, by name; ModelError: one is missing, or has values that cannot be."""
        values: list[float] = []
        for name, said in _NUMERICS.items():
            own, least = numerics.get(name, ()), [0.0 if "ohm" in part else 1e-9 for part in said.split(", ")]
            if len(own) != len(least) or not all(a <= value < math.inf for a, value in zip(least, own, strict=True)):
                told = f"is {' '.join(f'{value:g}' for value in own)}" if name in numerics else "is missing"
                accepted = f"{said}; all above 0, a resistance from 0"
                raise ModelError(f"numeric {name!r} of a car with a VESC {told}; accepted: {accepted}")
            values += own
        return cls(*values)

    @classmethod
    @lru_cache
    def bundled(cls) -> Electrics:
        """Return those of the default car."""
        text = (files("fg_mujoco.models") / "f1tenth.xml").read_text("utf-8")
        found = {str(each.get("name")): str(each.get("data")) for each in ElementTree.fromstring(text).iter("numeric")}
        return cls.of({name: [float(value) for value in data.split()] for name, data in found.items()})

    def at(self, speed: float, force: float) -> tuple[float, float, float, float]:
        """Return battery's voltage [V], duty, motor's and input current [A] at a speed [m/s] and motor's force [N]."""
        current = force / self.volts_per_speed
        volts = self.volts_per_speed * speed + self.motor_resistance * current
        # the battery gives power = voltage x input, where voltage = full - resistance x input
        root = self.full_voltage**2 - 4.0 * self.battery_resistance * volts * current
        voltage = 0.5 * (self.full_voltage + math.sqrt(max(root, 0.0)))
        return voltage, min(max(volts / voltage, -1.0), 1.0), current, volts * current / voltage


@explain_class
@dataclass(frozen=True, kw_only=True)
class Vesc(Sensor):
    """What a VESC tells, 50 times a second, and the odometry that vesc_to_odom makes of it, from 0, 0, 0 at the start.

    Raises:
      SettingsError: a value out of its range.
    """

    columns = (
        "speed_m_s", "steering_angle_rad", "yaw_rate_rad_s", "x_m", "y_m", "heading_rad",
        "erpm", "voltage_V", "duty", "motor_current_A", "input_current_A", "temperature_degC",
    )  # fmt: skip
    rate: float | None = 50.0
    speed_noise_std: float = 0.1  # [m/s] before it is integrated: that of recorded drives, see the docs
    as_odometry: bool = False  # whether the car's odometry, too, is what it tells

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self, lambda value: 0.0 <= value < math.inf, "a number from 0", ("speed_noise_std",), SettingsError)

    def begin(self, car: CarState, rng: np.random.Generator) -> Callable[[CarState], ArrayLike]:
        """See Sensor."""
        motor, pose, before = _motor_of(car.model, car.prefix), [0.0, 0.0, 0.0], car.time
        electrics = motor.electrics

        def measure(car: CarState) -> ArrayLike:
            nonlocal before
            true = float(motor.shares @ car.qvel[motor.dofs])
            seen = (1.0 + car.odometry_drift) * true + rng.normal(0.0, self.speed_noise_std)
            erpm = float(round(electrics.erpm_per_speed * seen))  # it tells whole ones
            speed = erpm / electrics.erpm_per_speed
            speed = speed if abs(speed) >= _STANDS else 0.0
            steering = float(car.ctrl[motor.steering])
            yaw_rate = speed * math.tan(steering) / motor.wheelbase
            passed, before = car.time - before, car.time
            pose[0] += speed * math.cos(pose[2]) * passed
            pose[1] += speed * math.sin(pose[2]) * passed
            pose[2] += yaw_rate * passed
            force = float(car.sensor(_FORCE)[0])
            if force * true > motor.power:  # which limits what drives the car
                force = motor.power / true
            return (speed, steering, yaw_rate, *pose, erpm, *electrics.at(true, force), AMBIENT)

        return measure

    def tell(self, values: FloatArray, odometry: NDArray[np.void]) -> None:
        """See Sensor; all wheels are alike."""
        if self.as_odometry and not math.isnan(values[-1]):
            odometry["speed"], odometry["steering_angle"] = values[0], values[1]
            odometry["wheel_speeds"], odometry["angular_velocity"] = values[0], (0.0, 0.0, values[2])


@dataclass(frozen=True)
class _Motor:
    """What a VESC must know of a compiled car."""

    electrics: Electrics
    shares: FloatArray  # [m] of the wheels' spins in the speed that the motor drives
    dofs: NDArray[np.int32]  # of those spins
    steering: int  # where in the controls
    wheelbase: float  # [m]
    power: float  # [W]


@lru_cache(maxsize=16)
def _motor_of(model: mujoco.MjModel, prefix: str) -> _Motor:
    """Return the motor of a car; ModelError where its MJCF does not say what a VESC must know."""
    numerics, actuator = {}, mujoco.mjtObj.mjOBJ_ACTUATOR
    for name in (*_NUMERICS, "power_limit_speed"):
        number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, prefix + name)
        if number >= 0:
            first = int(model.numeric_adr[number])
            numerics[name] = model.numeric_data[first : first + int(model.numeric_size[number])].tolist()
    electrics = Electrics.of(numerics)
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, prefix + _FORCE) < 0:
        accepted = f'<actuatorfrc name="{_FORCE}" actuator="speed"/>'
        raise ModelError(f"sensor {_FORCE!r} of a car with a VESC is missing; accepted: {accepted} in its MJCF")
    drive = element_id(model, mujoco.mjtObj.mjOBJ_TENDON, f"{prefix}drive")
    wraps = slice(model.tendon_adr[drive], model.tendon_adr[drive] + model.tendon_num[drive])
    most = float(np.abs(model.actuator_forcerange[element_id(model, actuator, f"{prefix}speed")]).min())
    return _Motor(
        electrics=electrics, shares=model.wrap_prm[wraps].copy(), dofs=model.jnt_dofadr[model.wrap_objid[wraps]],
        steering=element_id(model, actuator, f"{prefix}steering"), power=most * numerics["power_limit_speed"][0],
        wheelbase=car_parameters(model, prefix).wheelbase,
    )  # fmt: skip


SENSORS["vesc"] = Vesc
