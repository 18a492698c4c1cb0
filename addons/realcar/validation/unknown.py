"""Which part of a model a drive says is not known: the servo's map, the floor, or which way a slide goes.

A drive whose yaw rate is off by more than AGREES over windows of 1 s is looked at row by row. The part with most of the
squared error is named, with what it is off by:

    fork         windows in which the car slides out and the model does not, or the other way round: near the limit a
                 small difference decides, and no model is right by more than chance
    floor        all other rows near the limit of the tires: friction, or the curves of the tires
    servo map    the rest: by how much, and how late, the wheels turn that are sent an angle
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fg_mujoco.messages import FloatArray

from .agreement import rms, signals_of
from .windows import PERIOD, DriveMotion, Window

AGREES = 0.12
"""[-] Of the recorded yaw rate's rms, within which a drive agrees."""

_FORK = 0.3  # [rad] by which the slip angles of a window differ once: one car slides out
_LIMIT = 0.65  # [-] of friction times gravity, from where on the tires and the floor decide
_LATEST = 12  # periods by which the wheels may turn earlier or later
_FEWEST = 50  # rows that tell a gain


def unknown_parts(
    motions: Sequence[DriveMotion], windows: Sequence[Window], simulated: FloatArray, *, rear: float, grip: float
) -> tuple[str, ...]:
    """Return a sentence for each drive whose yaw rate is off by more than AGREES.

    Windows are of 1 s, driven by the recorded commands or at the recorded speed; `simulated` (n, k, 6) are the model's
    motions in them. `rear` [m] is from the centre of gravity to the rear axle, `grip` [m/s^2] the tires' greatest
    lateral acceleration.
    """
    said, slips = [], signals_of(simulated, rear)["slip angle"]
    for number, motion in enumerate(motions):
        rows = [place for place, window in enumerate(windows) if window.drive == number]
        if not rows:
            continue
        model = np.array([simulated[place, 1 : windows[place].count + 1] for place in rows])
        parts = [slice(windows[place].first + 1, windows[place].first + windows[place].count + 1) for place in rows]
        gyro, speed = (np.array([column[part] for part in parts]) for column in (motion.gyro, motion.forward_speed))
        slip = np.array([motion.slip_angle[part] for part in parts])
        errors = model[..., 5] - gyro
        share = rms(errors.ravel()) / max(rms(gyro.ravel()), 1e-12)
        if not share > AGREES:
            continue
        apart = np.abs(slips[rows, 1 : slip.shape[1] + 1] - slip)
        forks = (np.nan_to_num(apart) > _FORK).any(axis=1)
        recorded, made = np.abs(speed * gyro), np.abs(model[..., 3] * model[..., 5])
        hard = (np.fmax(recorded, made) > _LIMIT * grip) & ~forks[:, None]
        rest = ~hard & ~forks[:, None]
        squares = {
            "fork": float(np.nansum(errors[forks] ** 2)), "floor": float(np.nansum(errors[hard] ** 2)),
            "servo map": float(np.nansum(errors[rest] ** 2)),
        }  # fmt: skip
        part = max(squares, key=lambda name: squares[name])
        of_all = squares[part] / sum(squares.values())
        how = {
            "fork": f"in {forks.sum()} of {len(rows)} windows one of car and model slides out and the other does not",
            "floor": f"near the limit the car corners at {np.mean(recorded[hard]):.2f} m/s^2, the model at "
                     f"{np.nanmean(made[hard]):.2f}" if hard.any() else "",
            "servo map": _steering(model[..., 5], gyro, rest),
        }[part]  # fmt: skip
        said.append(
            f"{motion.drive.name}: yaw rate off by {share:.1%} in 1 s; not known is the {part}, with {of_all:.0%} of "
            f"the squared error: {how}"
        )
    return tuple(said)


def _steering(model: FloatArray, gyro: FloatArray, used: FloatArray) -> str:
    """Say by how much, and how late, the car turns of what the model turns; all (n, k)."""
    best, found, whole = math.inf, (math.nan, 0), 1.0
    count = model.shape[1]
    for late in range(-_LATEST, _LATEST + 1):
        first, last = max(late, 0), count + min(late, 0)
        own, real = model[:, first - late : last - late], gyro[:, first:last]
        kept = used[:, first:last] & np.isfinite(own)
        if np.count_nonzero(kept) < _FEWEST:
            continue
        x, y = own[kept], real[kept]
        gain = float(x @ y) / max(float(x @ x), 1e-12)
        left = float(np.mean((y - gain * x) ** 2))
        if left < best:
            best, found, whole = left, (gain, late), float(np.mean(y**2))
    if not math.isfinite(found[0]):
        return "too few rows below the limit tell more"
    when = "later" if found[1] > 0 else "earlier"
    said = f"below the limit the car turns {found[0]:.2f} times as fast, {abs(found[1]) * PERIOD:.2f} s {when}"
    return f"{said}, which leaves {math.sqrt(best / max(whole, 1e-12)):.1%} there"
