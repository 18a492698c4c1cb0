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
from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

_GRAVITY = 9.81
_KINEMATIC_BELOW = 0.5  # [m/s] the single-track model divides by the speed


@kernel
def accl_constraints(vel: float, accl: float, v_switch: float, a_max: float, v_min: float, v_max: float) -> float:
    """Return an acceleration within the motor's limits [m/s^2]."""
    if (vel <= v_min and accl <= 0.0) or (vel >= v_max and accl >= 0.0):
        return 0.0
    limit = a_max * v_switch / vel if vel > v_switch else a_max
    return min(max(accl, -a_max), limit)


@kernel
def steering_constraint(
    steering_angle: float, steering_velocity: float, s_min: float, s_max: float, sv_min: float, sv_max: float
) -> float:
    """Return a steering rate within the servo's limits [rad/s]."""
    ends = (steering_angle <= s_min and steering_velocity <= 0.0) or (
        steering_angle >= s_max and steering_velocity >= 0.0
    )
    return 0.0 if ends else min(max(steering_velocity, sv_min), sv_max)


@kernel
def vehicle_dynamics_ks(
    x: FloatArray, u_init: FloatArray, mu: float, C_Sf: float, C_Sr: float, lf: float, lr: float, h: float, m: float,
    I: float, s_min: float, s_max: float, sv_min: float, sv_max: float, v_switch: float, a_max: float, v_min: float,
    v_max: float,
) -> FloatArray:  # fmt: skip
    """Return a kinematic car's rate of change of x, y, steering, speed, heading (5,), by `u_init` [rad/s, m/s^2]."""
    rate = steering_constraint(x[2], u_init[0], s_min, s_max, sv_min, sv_max)
    acceleration = accl_constraints(x[3], u_init[1], v_switch, a_max, v_min, v_max)
    f = np.empty(5)
    f[0], f[1] = x[3] * math.cos(x[4]), x[3] * math.sin(x[4])
    f[2], f[3] = rate, acceleration
    f[4] = x[3] / (lf + lr) * math.tan(x[2])
    return f


@kernel
def vehicle_dynamics_st(
    x: FloatArray, u_init: FloatArray, mu: float, C_Sf: float, C_Sr: float, lf: float, lr: float, h: float, m: float,
    I: float, s_min: float, s_max: float, sv_min: float, sv_max: float, v_switch: float, a_max: float, v_min: float,
    v_max: float,
) -> FloatArray:  # fmt: skip
    """Return the rate of change of a single-track car: as of the kinematic one, yaw rate, slip angle. (7,)."""
    rate = steering_constraint(x[2], u_init[0], s_min, s_max, sv_min, sv_max)
    acceleration = accl_constraints(x[3], u_init[1], v_switch, a_max, v_min, v_max)
    wheelbase, speed = lf + lr, x[3]
    f = np.zeros(7)
    f[2], f[3] = rate, acceleration
    if abs(speed) < _KINEMATIC_BELOW:
        f[0], f[1] = speed * math.cos(x[4]), speed * math.sin(x[4])
        f[4] = speed / wheelbase * math.tan(x[2])
        f[5] = acceleration / wheelbase * math.tan(x[2]) + speed / (wheelbase * math.cos(x[2]) ** 2) * rate
        return f
    f[0], f[1] = speed * math.cos(x[6] + x[4]), speed * math.sin(x[6] + x[4])
    f[4] = x[5]
    f[5], f[6] = linear_rates(
        x[5], x[6], x[2], speed, acceleration, mu, C_Sf, C_Sr, lf, lr, h, m, I, _GRAVITY,
    )  # fmt: skip
    return f


@kernel
def pid_steer(steer: float, current_steer: float, max_sv: float) -> float:
    """Return the steering rate that the gym's servo takes towards an angle [rad/s]."""
    difference = steer - current_steer
    return math.copysign(max_sv, difference) if abs(difference) > 1e-4 else 0.0


@kernel
def pid_accl(speed: float, current_speed: float, max_a: float, max_v: float, min_v: float) -> float:
    """Return the acceleration that the gym's motor takes towards a speed [m/s^2]."""
    difference = speed - current_speed
    gain = 10.0 if current_speed > 0.0 else 2.0
    return gain * max_a / (max_v if difference > 0.0 else -min_v) * difference


@kernel
def pid(
    speed: float, steer: float, current_speed: float, current_steer: float, max_sv: float, max_a: float, max_v: float,
    min_v: float,
) -> tuple[float, float]:  # fmt: skip
    """Return acceleration [m/s^2] and steering rate [rad/s] of the gym's servo."""
    return pid_accl(speed, current_speed, max_a, max_v, min_v), pid_steer(steer, current_steer, max_sv)


@kernel
def get_trmtx(pose: FloatArray) -> FloatArray:
    """Return the homogeneous transform of a pose x, y, heading. Shape (4, 4)."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    matrix = np.eye(4)
    matrix[0, 0], matrix[0, 1], matrix[0, 3] = cos, -sin, pose[0]
    matrix[1, 0], matrix[1, 1], matrix[1, 3] = sin, cos, pose[1]
    return matrix


@kernel
def get_vertices(pose: FloatArray, length: float, width: float) -> FloatArray:
    """Return the corners of a car about a pose: rear left, rear right, front right, front left. Shape (4, 2) [m]."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    corners = np.empty((4, 2))
    for corner in range(4):
        ahead = -0.5 * length if corner < 2 else 0.5 * length
        left = 0.5 * width if corner in (0, 3) else -0.5 * width
        corners[corner, 0] = pose[0] + ahead * cos - left * sin
        corners[corner, 1] = pose[1] + ahead * sin + left * cos
    return corners


@kernel
def check_ttc_jit(
    scan: FloatArray, vel: float, scan_angles: FloatArray, cosines: FloatArray, side_distances: FloatArray,
    ttc_thresh: float,
) -> bool:  # fmt: skip
    """Return whether a car would touch what a beam sees sooner than a time [s], going on at its speed [m/s]."""
    if vel == 0.0:
        return False
    for beam in range(len(scan)):
        closing = vel * cosines[beam]
        if closing != 0.0:
            time = (scan[beam] - side_distances[beam]) / closing
            if 0.0 <= time < ttc_thresh:
                return True
    return False


@kernel
def ray_cast(pose: FloatArray, scan: FloatArray, scan_angles: FloatArray, vertices: FloatArray) -> FloatArray:
    """Return a scan from a pose with a convex shape of corners (4, 2) in it."""
    for beam in range(len(scan)):
        dx, dy = math.cos(pose[2] + scan_angles[beam]), math.sin(pose[2] + scan_angles[beam])
        for corner in range(4):
            a, b = vertices[corner], vertices[(corner + 1) % 4]
            across = dx * (b[1] - a[1]) - dy * (b[0] - a[0])
            if across != 0.0:
                distance = ((a[0] - pose[0]) * (b[1] - a[1]) - (a[1] - pose[1]) * (b[0] - a[0])) / across
                share = ((a[0] - pose[0]) * dy - (a[1] - pose[1]) * dx) / across
                if distance >= 0.0 and 0.0 <= share <= 1.0:
                    scan[beam] = min(scan[beam], distance)
    return scan


@kernel
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
