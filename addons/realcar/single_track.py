"""The single-track model of a car, with two kinds of axles, and its forward simulation.

Both kinds carry the loads by longitudinal transfer, F_zf = m (g l_r - a_x h) / L and F_zr = m (g l_f + a_x h) / L.
Linear axles, as the 2D gyms drive them: F_y = mu C_S F_z alpha. Angles are small: they stand where their tangents
would, and nothing turns a force. Source of `linear_rates`: M. Althoff, M. Koschi and S. Manzinger, "CommonRoad:
Composable benchmarks for motion planning on roads", IV 2017, and its vehicle models, the single-track model with load
transfer by acceleration.
Magic Formula axles, which identification fits: F_y = F_z D sin(C atan(B a - E (B a - atan(B a)))), with the slip angles
a_f = delta - atan((v_y + l_f r) / v_x), a_r = -atan((v_y - l_r r) / v_x), at the forward speed and acceleration that
were measured. Of the force that drives the car, the share of the front axle acts along the steered wheels. With a share
of 0 this is CommonRoad's model with the tires of ForzaETH's On-Track-SysID (arXiv 2411.17508). A shaft makes both axles
turn alike: on the longer way of the front wheels they brake, and the rear ones drive.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.native import core

FRONT_STIFFNESS, REAR_STIFFNESS = 4.718, 5.4562
"""[1/rad] C_Sf and C_Sr: side force over (mu times load times slip angle), of each axle; f1tenth_gym's."""

TIRE = ("stiffness", "C", "D", "E")
"""Parameters of an axle in the fit: the stiffness B C D takes the place of B, because a drive determines it better."""

STATES = 5
"""v_y [m/s], r [rad/s], x [m], y [m], heading [rad] of the centre of gravity."""


class SimulatedDrive(NamedTuple):
    """What a drive is simulated by."""

    tires: FloatArray  # (8,) TIRE, front and rear
    car: FloatArray  # (9,) of `car_array`
    relaxation_length: float  # [m] over which slip angles follow; 0: at once
    gain: float  # reading of an accelerometer over the lateral acceleration in a steady turn
    steering: FloatArray  # (n,) [rad] of the front wheels
    forward_speed: FloatArray  # (n,) [m/s] measured
    forward_acceleration: FloatArray  # (n,) [m/s^2]
    step: float  # [s] of the grid


friction_curve = core.friction_curve
simulate = core.simulate_segments


def axle_loads(
    acceleration: float, front: float, rear: float, height: float, mass: float, gravity: float
) -> tuple[float, float]:
    """Return the loads of the front and the rear axle [N]; a forward acceleration [m/s^2] moves load between them.

    `front` and `rear` [m] are from the centre of gravity, at a height [m], to the axles; mass [kg], gravity [m/s^2].
    """
    moved, length = acceleration * height, front + rear
    return mass * (gravity * rear - moved) / length, mass * (gravity * front + moved) / length


def linear_rates(
    yaw_rate: float, slip_angle: float, steering: float, speed: float, acceleration: float, mu: float,
    front_stiffness: float, rear_stiffness: float, front: float, rear: float, height: float, mass: float,
    yaw_inertia: float, gravity: float,
) -> tuple[float, float]:  # fmt: skip
    """Return how fast yaw rate [rad/s^2] and slip angle [rad/s] of a car on linear axles change.

    The slip angle [rad] is from the heading to the velocity of the centre of gravity, left positive; speed [m/s] and
    acceleration [m/s^2] are along that velocity. Stiffnesses are the side force over mu times load times slip angle
    [1/rad]. `front` and `rear` [m] are from the centre of gravity, at a height [m], to the axles. Yaw rate [rad/s],
    steering [rad], mass [kg], yaw inertia [kg m^2], gravity [m/s^2].
    """
    front_load, rear_load = axle_loads(acceleration, front, rear, height, mass, gravity)
    front_force = mu * front_stiffness * front_load * (steering - slip_angle - front * yaw_rate / speed)
    rear_force = mu * rear_stiffness * rear_load * (rear * yaw_rate / speed - slip_angle)
    turning = (front * front_force - rear * rear_force) / yaw_inertia
    return turning, (front_force + rear_force) / (mass * speed) - yaw_rate


def car_array(car: CarParameters, *, single_track: bool = False) -> FloatArray:
    """Return the constants of a car, with the front axle's share of the drive, and its shaft, as simulations take them.

    With `single_track` half of the track width is 0, which turns off all that the tires of an axle differ in. Otherwise
    the yaw inertia contains the wheels' spin: in a turn the outer wheels roll faster, and have to be sped up for it.
    """
    half = 0.0 if single_track else 0.5 * car.track_width
    inertia = car.yaw_inertia + 4.0 * car.wheel_inertia * (half / car.wheel_radius) ** 2
    return np.array(
        (
            car.mass, inertia, car.front_axle_distance, car.rear_axle_distance, car.center_of_gravity_height,
            car.gravity, car.drives_front / (car.drives_front + car.drives_rear), half, car.shaft,
        )
    )  # fmt: skip
