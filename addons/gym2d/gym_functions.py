"""Functions of f1tenth_gym that planners call themselves: its car models, its servo, its footprints.

Model predictive planners roll the gym's single-track model out from here. The cars of this package do not drive by it.

Sources: M. Althoff, G. Wuersching, CommonRoad: Vehicle Models, 2020, for the kinematic and the single-track model; the
gains of the servo are f1tenth_gym's.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fg_mujoco.addons.realcar.single_track import linear_rates
from fg_mujoco.messages import FloatArray
from fg_mujoco.native import core

_GRAVITY = 9.81
_KINEMATIC_BELOW = 0.5  # [m/s] the single-track model divides by the speed


def accl_constraints(vel: float, accl: float, v_switch: float, a_max: float, v_min: float, v_max: float) -> float:
    """Return an acceleration within the motor's limits [m/s^2]."""
    if (vel <= v_min and accl <= 0.0) or (vel >= v_max and accl >= 0.0):
        return 0.0
    limit = a_max * v_switch / vel if vel > v_switch else a_max
    return min(max(accl, -a_max), limit)


def steering_constraint(
    steering_angle: float, steering_velocity: float, s_min: float, s_max: float, sv_min: float, sv_max: float
) -> float:
    """Return a steering rate within the servo's limits [rad/s]."""
    ends = (steering_angle <= s_min and steering_velocity <= 0.0) or (
        steering_angle >= s_max and steering_velocity >= 0.0
    )
    return 0.0 if ends else min(max(steering_velocity, sv_min), sv_max)


def vehicle_dynamics_ks(
    x: FloatArray, u_init: FloatArray, mu: float, C_Sf: float, C_Sr: float, lf: float, lr: float, h: float, m: float,
    I: float, s_min: float, s_max: float, sv_min: float, sv_max: float, v_switch: float, a_max: float, v_min: float,
    v_max: float,
) -> FloatArray:  # fmt: skip
    """Return a kinematic car's rate of change of x, y, steering, speed, heading (5,), by `u_init` [rad/s, m/s^2]."""
    steering, speed, heading = map(float, x[2:5])
    if not math.isfinite(steering + heading):  # of a rollout that diverges
        return np.full(5, math.nan)
    rate, acceleration = map(float, u_init[:2])
    rate = steering_constraint(steering, rate, s_min, s_max, sv_min, sv_max)
    acceleration = accl_constraints(speed, acceleration, v_switch, a_max, v_min, v_max)
    turning = speed / (lf + lr) * math.tan(steering)
    return np.array((speed * math.cos(heading), speed * math.sin(heading), rate, acceleration, turning))


def vehicle_dynamics_st(
    x: FloatArray, u_init: FloatArray, mu: float, C_Sf: float, C_Sr: float, lf: float, lr: float, h: float, m: float,
    I: float, s_min: float, s_max: float, sv_min: float, sv_max: float, v_switch: float, a_max: float, v_min: float,
    v_max: float,
) -> FloatArray:  # fmt: skip
    """Return the rate of change of a single-track car: as of the kinematic one, yaw rate, slip angle. (7,)."""
    steering, speed, heading, yaw_rate, slip_angle = map(float, x[2:7])
    if not math.isfinite(steering + heading + slip_angle):
        return np.full(7, math.nan)
    rate, acceleration = map(float, u_init[:2])
    rate = steering_constraint(steering, rate, s_min, s_max, sv_min, sv_max)
    acceleration = accl_constraints(speed, acceleration, v_switch, a_max, v_min, v_max)
    if abs(speed) < _KINEMATIC_BELOW:
        wheelbase, cos, tan = lf + lr, math.cos(steering), math.tan(steering)
        course, turning, slipping = heading, speed / wheelbase * tan, 0.0
        turning_faster = acceleration / wheelbase * tan + speed / (wheelbase * (cos * cos)) * rate
    else:
        course, turning = slip_angle + heading, yaw_rate
        turning_faster, slipping = linear_rates(
            yaw_rate, slip_angle, steering, speed, acceleration, mu, C_Sf, C_Sr, lf, lr, h, m, I, _GRAVITY,
        )  # fmt: skip
    along_x, along_y = speed * math.cos(course), speed * math.sin(course)
    return np.array((along_x, along_y, rate, acceleration, turning, turning_faster, slipping))


def pid_steer(steer: float, current_steer: float, max_sv: float) -> float:
    """Return the steering rate that the gym's servo takes towards an angle [rad/s]."""
    difference = steer - current_steer
    return math.copysign(max_sv, difference) if abs(difference) > 1e-4 else 0.0


def pid_accl(speed: float, current_speed: float, max_a: float, max_v: float, min_v: float) -> float:
    """Return the acceleration that the gym's motor takes towards a speed [m/s^2]."""
    difference = speed - current_speed
    gain = 10.0 if current_speed > 0.0 else 2.0
    return gain * max_a / (max_v if difference > 0.0 else -min_v) * difference


def pid(
    speed: float, steer: float, current_speed: float, current_steer: float, max_sv: float, max_a: float, max_v: float,
    min_v: float,
) -> tuple[float, float]:  # fmt: skip
    """Return acceleration [m/s^2] and steering rate [rad/s] of the gym's servo."""
    return pid_accl(speed, current_speed, max_a, max_v, min_v), pid_steer(steer, current_steer, max_sv)


def get_trmtx(pose: FloatArray) -> FloatArray:
    """Return the homogeneous transform of a pose x, y, heading. Shape (4, 4)."""
    x, y, heading = map(float, pose[:3])
    cos, sin = math.cos(heading), math.sin(heading)
    return np.array(((cos, -sin, 0.0, x), (sin, cos, 0.0, y), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)))


def get_vertices(pose: FloatArray, length: float, width: float) -> FloatArray:
    """Return the corners of a car about a pose: rear left, rear right, front right, front left. Shape (4, 2) [m]."""
    x, y, heading = map(float, pose[:3])
    cos, sin = math.cos(heading), math.sin(heading)
    front, left = 0.5 * length, 0.5 * width
    corners = (-front, left), (-front, -left), (front, -left), (front, left)
    return np.array([(x + ahead * cos - aside * sin, y + ahead * sin + aside * cos) for ahead, aside in corners])


def check_ttc_jit(
    scan: FloatArray, vel: float, scan_angles: FloatArray, cosines: FloatArray, side_distances: FloatArray,
    ttc_thresh: float,
) -> bool:  # fmt: skip
    """Return whether a car would touch what a beam sees sooner than a time [s], going on at its speed [m/s]."""
    if vel == 0.0:
        return False
    closing = vel * np.asarray(cosines)
    with np.errstate(divide="ignore", invalid="ignore"):
        time = (np.asarray(scan) - side_distances) / closing
    return bool(((closing != 0.0) & (time >= 0.0) & (time < ttc_thresh)).any())


def ray_cast(pose: FloatArray, scan: FloatArray, scan_angles: FloatArray, vertices: FloatArray) -> FloatArray:
    """Return a scan from a pose with a convex shape of corners (4, 2) in it."""
    x, y, heading = map(float, pose[:3])
    seen, angles, corners = (np.ascontiguousarray(given, np.float64) for given in (scan, scan_angles, vertices))
    core.ray_cast((x, y, heading), seen, angles, corners)
    scan[:] = seen
    return scan


def xy_2_rc(
    x: float, y: float, orig_x: float, orig_y: float, orig_c: float, orig_s: float, height: int, width: int,
    resolution: float,
) -> tuple[int, int]:  # fmt: skip
    """Return row and column of the pixel at a place of a map, -1 and -1 outside of it."""
    along = (x - orig_x) * orig_c + (y - orig_y) * orig_s
    across = (y - orig_y) * orig_c - (x - orig_x) * orig_s
    if along < 0.0 or across < 0.0 or along >= width * resolution or across >= height * resolution:
        return -1, -1
    return int(across / resolution), int(along / resolution)


def get_dt(bitmap: FloatArray, resolution: float) -> FloatArray:
    """Return the distance from each pixel to the nearest that is 0 [m]."""
    from scipy.ndimage import distance_transform_edt

    return np.asarray(resolution * distance_transform_edt(bitmap), np.float64)


def collision(vertices1: FloatArray, vertices2: FloatArray) -> bool:
    """Return whether two convex shapes, corners (n, 2) and (m, 2), overlap."""
    for shape in (vertices1, vertices2):
        along = np.roll(shape, -1, axis=0) - shape
        across = np.column_stack((-along[:, 1], along[:, 0]))
        first, second = vertices1 @ across.T, vertices2 @ across.T
        if ((first.max(axis=0) < second.min(axis=0)) | (second.max(axis=0) < first.min(axis=0))).any():
            return False
    return True


def collision_multiple(vertices: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return whether each car overlaps another, 1 or 0, and the index of the other, else -1. Shape (n,) each."""
    count = len(vertices)
    collisions, others = np.zeros(count), np.full(count, -1.0)
    for first in range(count):
        for second in range(first + 1, count):
            if collision(vertices[first], vertices[second]):
                collisions[[first, second]] = 1.0
                others[first], others[second] = second, first
    return collisions, others


def deep_update(mapping: dict[Any, Any], *updates: dict[Any, Any]) -> dict[Any, Any]:
    """Return a dictionary with others put over it, level by level."""
    merged = dict(mapping)
    for update in updates:
        for key, value in update.items():
            known = merged.get(key)
            merged[key] = deep_update(known, value) if isinstance(known, dict) and isinstance(value, dict) else value
    return merged
