"""The speed controller of f1tenth_gym, on the motor of a car here.

The 2D gym makes an acceleration k (v* - v) of a commanded speed v* and the speed v. While the car goes forward, k is
10 a_max / v_max where it is to go faster and 10 a_max / |v_min| where slower, which is four times as much for the
gym's car; while it stands or goes back, a fifth of that. The motor of a car here accelerates it by (set point - wheel
speed) / speed_time_constant, and so less from physics step to physics step while a set point is held. So the set point
is the wheel speed, and what makes the mean over the time that it is held the acceleration.

In the gym's single-track model wheels do not slip along their heading, and tires that slide sideways do not slow the
car down, nor does its rolling, which is made up for as the car's parameters tell it. Linear tires do both. For them the
controller reads the speed over the ground, as the gym's does, and adds what was missing from the acceleration that it
asked for before.

Source: CommonRoad's vehicle models (Althoff and Wuersching), and the controller of f1tenth_gym written anew from its
documented gains.
"""

from __future__ import annotations

import math

from fg_mujoco.messages import CarParameters

_FORWARD, _BACK = 10.0, 2.0  # [-] f1tenth_gym: times a_max over the greatest speed is the gain
_LEARNED = 0.0144  # [s] ours: time constant with which what was missing is added, half of it in a step of 10 ms
_MOST_ADDED = 0.5  # [-] ours: of a_max; the tires' drag is less
_LEAST_SPEED = 0.5  # [m/s] f1tenth_gym: below, its model is the kinematic one, without slip
_LEAST_OF_GAIN = 0.1  # [m/s] ours: the gym divides by |v_min|, which is 0 where a car is not to reverse


class SpeedController:
    """Turns commanded speeds of a car into set points of its motor, `over_ground` less the drag of the tires."""

    def __init__(self, car: CarParameters, *, over_ground: bool, timestep: float) -> None:
        self._car, self._over_ground, self._timestep = car, over_ground, timestep
        self._learned = -math.expm1(-timestep / _LEARNED)
        self._reach = timestep / -math.expm1(-timestep / car.speed_time_constant)  # [s]
        self.reset()

    def reset(self) -> None:
        """Forget what was driven."""
        self._asked, self._added, self._before = 0.0, 0.0, math.nan

    def set_point(self, wanted: float, wheel_speed: float, ground_speed: float) -> float:
        """Return the motor's set point [m/s] of a commanded, a mean wheel's and a ground speed, negative back [m/s]."""
        if not self._over_ground:
            car, asked = self._car, self._acceleration(wanted, wheel_speed)
            if wheel_speed >= (0.0 if asked > 0.0 else _LEAST_SPEED):
                asked += car.rolling_resistance + car.rolling_damping * wheel_speed
            return wheel_speed + self._reach * asked
        if abs(ground_speed) < _LEAST_SPEED or math.isnan(self._before):
            self._added = 0.0
        else:
            missing = self._asked - (ground_speed - self._before) / self._timestep
            most = _MOST_ADDED * self._car.max_acceleration
            self._added = min(max(self._added + self._learned * missing, -most), most)
        self._before, self._asked = ground_speed, self._acceleration(wanted, ground_speed)
        return wheel_speed + self._reach * (self._asked + self._added)

    def speed_for(self, acceleration: float, wheel_speed: float, ground_speed: float) -> float:
        """Return the speed [m/s] that asks for an acceleration [m/s^2], arguments as of `set_point`."""
        speed = ground_speed if self._over_ground else wheel_speed
        return speed + acceleration / self._gain(acceleration > 0.0, speed)

    def _acceleration(self, wanted: float, speed: float) -> float:
        """Return the acceleration that the gym's controller asks for, within the motor's [m/s^2]."""
        car = self._car
        wanted = min(max(wanted, car.min_speed), car.max_speed)
        gain = self._gain(wanted > speed, speed)
        power = min(1.0, car.power_limit_speed / max(speed, car.power_limit_speed))
        return min(max(gain * (wanted - speed), -car.max_acceleration), power * car.max_acceleration)

    def _gain(self, faster: bool, speed: float) -> float:
        """Return the acceleration for each metre per second that is wanted beyond a speed [1/s]."""
        most = max(self._car.max_speed if faster else -self._car.min_speed, _LEAST_OF_GAIN)
        return (_FORWARD if speed > 0.0 else _BACK) * self._car.max_acceleration / most
