"""Gap finder: the disparity extender with more filters, as the field's gap_finder_base describes it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import STOP, CarParameters, DriveCommand, LaserScan, Odometry

from . import scan_filters as filters
from .friction_guard import FrictionGuard
from .speed import braking_speed, friction_steering
from .free_path import free_arc
from .steering import pursue


@dataclass(frozen=True, kw_only=True)
class GapFinderSettings:
    lookahead: float = 10.0
    field_of_view: float = math.pi
    disparity_threshold: float = 0.3
    clearance: float = 0.1
    nearest_bubble: float = 0.2
    smoothing: float = 0.1
    pursuit: float = 2.0
    pursuit_time: float = 0.0
    speed_window: float = 0.3
    margin: float = 0.2
    corner_speed: float = 0.0
    arc_clearance: float = 0.05
    brake_plan: float = 0.8
    latency: float = 0.05


class GapFinder:
    def __init__(self, car: CarParameters, mu: float = 1.0489, max_speed: float = 8.0, settings=None):
        self.car = car
        self.s = settings or GapFinderSettings()
        self.guard = FrictionGuard(car, mu)
        self.max_speed = max_speed

    def reset(self): pass

    def __call__(self, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        s = self.s
        view = filters.field_of_view(scan.bearings, s.field_of_view)
        inc = scan.angle_increment
        r = filters.valid_ranges(scan.ranges, scan.range_max)
        r = filters.clip_to_lookahead(r, s.lookahead)
        r = filters.extend_disparities(r, inc, s.disparity_threshold, self.car.width / 2 + s.clearance)
        r = filters.mask_nearest(r, inc, s.nearest_bubble)
        r = filters.rolling_mean(r, inc, s.smoothing)
        b = scan.bearings[view]
        r = filters.prioritise_centre(r[view], b)
        if len(r) == 0 or r.max() <= 0: return STOP
        g = int(np.argmax(r))
        dist = float(r[g])
        pd = min(dist, s.pursuit + s.pursuit_time * odometry.speed)
        steer = pursue(float(b[g]), pd, self.car)
        raw = filters.valid_ranges(scan.ranges, scan.range_max)[view]
        lim = friction_steering(odometry.speed, self.guard._mu, self.car.wheelbase)
        held = max(-lim, min(lim, max(-self.car.max_steering_angle, min(self.car.max_steering_angle, steer))))
        free = free_arc(raw, b, held, self.car, s.arc_clearance)
        v = min(self.max_speed, braking_speed(free - s.margin - odometry.speed*s.latency, self.guard.max_braking * s.brake_plan, s.corner_speed))
        self.debug = (float(b[g]), dist, free)
        return self.guard(steer, v, odometry)
