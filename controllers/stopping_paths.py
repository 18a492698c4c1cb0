"""How fast the car may go so that it can still stop within what the scan shows.

For a grid of speeds and shares of the tires' grip, the path of a car that turns with that share and brakes with
what the friction circle leaves is worked out once. A scan then only has to be looked up: a path is free when each
of its points lies nearer than the (widened) reading in its direction. The fastest speed with a free path is safe.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import CarParameters, FloatArray

_SPEEDS = 24
_SHARES = np.array([0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8])
_START_SHARES = np.array([-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0])
_POINTS = 24
_DT = 0.01


class StoppingPaths:
    def __init__(self, car, lateral, max_braking, yaw_lag, max_speed, bearings0, increment, count, reaction=0.045, margin=0.3):
        self.speeds = np.linspace(0.5, max_speed, _SPEEDS)
        self.shares = _SHARES
        S, F, G = np.meshgrid(self.speeds, _SHARES, _START_SHARES, indexing="ij")
        shape = S.shape
        v = S.ravel().copy(); f = F.ravel(); g = G.ravel()
        v0 = v.copy()
        kmax = math.tan(car.max_steering_angle) / car.wheelbase
        k = np.clip(g * lateral / v**2, -kmax, kmax)
        x = np.zeros_like(v); y = np.zeros_like(v); th = np.zeros_like(v); s = np.zeros_like(v)
        tot = [np.stack([x, y, th, s])]
        t = 0.0
        while (v > 0).any() and t < 5:
            active = v > 0
            target = np.clip(f * lateral / np.maximum(v, .3) ** 2, -kmax, kmax)
            if t < reaction: target = k
            k = k + (target - k) * (1 - np.exp(-v * _DT / yaw_lag)) if t >= reaction else k
            used = np.minimum(np.abs(k) * v * v / lateral, 1)
            a = max_braking * (1 - used * 0.999) ** 0.7 if t >= reaction else 0
            ds = v * _DT
            th = th + k * ds; x = x + ds * np.cos(th); y = y + ds * np.sin(th); s = s + ds
            v = np.maximum(v - a * _DT, 0) ; t += _DT
            tot.append(np.stack([x, y, th, s]))
        T = np.stack(tot)  # (n,4,K)
        K = T.shape[2]
        # resample by arc length, with the margin appended straight
        idx = np.empty((K, _POINTS), int); rho = np.empty((K, _POINTS))
        L = car.lidar_offset
        for q in range(K):
            X, Y, TH, SS = T[:, :, q].T
            u = np.linspace(0, 1, _POINTS) ** 1 * (SS[-1] + margin)
            xi = np.interp(u, SS, X); yi = np.interp(u, SS, Y); ti = np.interp(u, SS, TH)
            over = np.maximum(u - SS[-1], 0)
            xi += over * np.cos(ti); yi += over * np.sin(ti)
            px = xi + L * np.cos(ti) - L; py = yi + L * np.sin(ti)
            r = np.hypot(px, py); b = np.arctan2(py, px)
            idx[q] = np.clip(np.round((b - bearings0) / increment), 0, count - 1)
            bad = (b < bearings0) | (b > bearings0 + increment * (count - 1))
            rho[q] = np.where(bad, 1e9 * 0 + r, r)
        self.index = idx.reshape(*shape, _POINTS)
        self.rho = rho.reshape(*shape, _POINTS)
        mirrored = count - 1 - self.index
        self.count = count
        self.mirror = mirrored

    def __call__(self, widened, share, speed):
        """share: present signed lateral use; returns (safe speed, best signed share at the present speed, ok)"""
        best = 0.0; choice = None
        j = int(np.searchsorted(self.speeds, speed - 1e-9)); j = min(j, _SPEEDS - 1)
        top = -1
        cand = []
        for sign in (1, -1):
            g = int(np.argmin(np.abs(_START_SHARES - sign * share)))
            ix = (self.index if sign > 0 else self.mirror)[:, :, g]; rho = self.rho[:, :, g]
            free = widened[ix] > rho
            ok = free.all(axis=2)
            first = np.where(ok, 1.0, np.argmin(free, axis=2) / _POINTS)
            any_ = ok.any(axis=1)
            # the fastest speed below which every speed has a way out
            n = int(np.argmin(any_)) if not any_.all() else _SPEEDS
            n = np.flatnonzero(any_)[-1] + 1 if any_.any() else 0
            top = max(top, n)
            for i, sh in enumerate(_SHARES):
                cand.append((first[j, i], sign * sh))
        vs = self.speeds[top - 1] if top > 0 else 0.0
        return vs, cand
