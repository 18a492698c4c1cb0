"""Monte Carlo localisation: particles that move by odometry and are weighed by the scan.

1. Each particle is a pose and the relative errors of odometry's speed and yaw rate, which are found that way, too. It
   moves by odometry with an error drawn for it.
2. Its weight is the likelihood of the scan there: how far the ends of the beams lie from the walls, by the distance
   field with interpolation between its nodes. An end far from all walls counts as any reading.
3. Where the weights are uneven, particles are drawn anew by them. How many follows from the number of bins that they
   occupy (KLD sampling): some hundreds while they are together, thousands while they are all over the map.
4. Where scans fit less than they did, or the car was put somewhere unknown, some particles are replaced: candidates are
   drawn over the free ground, and the best of them are laid on the walls by least squares (sensor resetting).

Sources: S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics, 2005, tables 6.3 (likelihood field) and 8.3 (augmented
MCL); D. Fox, Adapting the Sample Size in Particle Filters Through KLD-Sampling, IJRR 22(12), 2003, with the bins
counted before the drawing; S. Lenser and M. Veloso, Sensor Resetting Localization, ICRA 2000; J. Carpenter et al.,
Improved Particle Filter for Nonlinear Problems, IEE Proceedings 146, 1999, for the drawing.

Limits: places that look the same from all over a lap, as on an oval, cannot be told apart without a start.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.messages import FloatArray

from .distance_field import DistanceField, Distances
from .field_matching import match
from .odometry import SCALE_ERROR, SCALE_WALK, STATES, step_errors

BEAMS = 60
"""Of a scan that particles are weighed with, evenly spread."""
LEAST, LOST = 500, 10_000
"""Particles, at least, and at most while the car is lost."""

_ERROR = 0.06  # [m] of a distance; beams of a scan err together, so that it is more than a beam's
_OUTLIER = 4.0  # greatest cost of a beam, in natural logarithms of the likelihood
_LOST_ERROR, _LOST_SHARE = 0.15, 0.3  # [m] while the car is lost, and by how much scans count less then
_BIN, _BIN_TURN = 0.05, math.radians(2.5)  # of KLD sampling, in x and y, and in the heading
_KLD_ERROR, _KLD_QUANTILE = 0.03, 2.33  # greatest divergence with a probability of 99 %
_SCALE_SPREAD = 0.02  # least standard deviation of the errors of odometry: those that are drawn away may be right later
_DRAWN_BELOW = 0.5  # share of the particles that count, below which they are drawn anew
_SLOW, _FAST = 0.02, 0.2  # shares of the newest scan in the long and the short mean of how scans fit
_CANDIDATES, _BEST, _LAID = 3000, 24, 12  # of a scan: drawn, laid on the walls, in so many steps
_RESET_SHARE = 0.1  # of the particles that are replaced while the car is lost
_NEAR, _NEAR_TURN = 1.0, 0.4  # [m] and [rad] round the likeliest particle: those of one place
_SURE, _SURE_SCANS = 0.7, 6  # share of the weights in one place, in so many scans in a row: the car is found
_LOST_SPREAD = 3.0  # [m] above which it is lost again; a straight without end walls spreads particles along it
_FITS, _LOST_FITS = 0.6, 0.4  # mean likelihood of a beam, over the greatest one: the same
_WORSE = 0.85  # share of the long mean of how scans fit, below which particles are replaced


@kernel
def move_all(
    particles: FloatArray,
    way: float,
    turn: float,
    way_error: float,
    turn_error: float,
    side_error: float,
    scale_walk: float,
    drawn: NDArray[np.float32],
) -> None:
    """Move particles (n, 5) by a step of odometry, with errors by normal numbers (n, 5)."""
    for k in range(len(particles)):
        one = particles[k]
        moved = way * (1.0 + one[3]) + way_error * drawn[k, 0]
        turned = turn * (1.0 + one[4]) + turn_error * drawn[k, 1]
        aside = side_error * drawn[k, 2]
        heading = one[2] + 0.5 * turned
        cos, sin = math.cos(heading), math.sin(heading)
        one[0] += moved * cos - aside * sin
        one[1] += moved * sin + aside * cos
        one[2] += turned
        one[3] += scale_walk * drawn[k, 3]
        one[4] += scale_walk * drawn[k, 4]


@kernel
def costs_of(
    particles: FloatArray,
    distances: Distances,
    origin: FloatArray,
    resolution: float,
    ends: NDArray[np.float32],
    error: float,
    outlier: float,
    costs: FloatArray,
) -> None:
    """Write the cost of each particle (n,): minus the logarithm of the likelihood that its beams end where they do.

    Args:
      particles: (n, 3 or more), the pose first.
      distances, origin, resolution: of the field.
      ends: of beams in the frame of the rear axle (b, 2) [m].
      error: standard deviation of a distance [m].
      outlier: greatest cost of a beam.
      costs: written to.
    """
    rows, columns = distances.shape
    zero, one = np.float32(0.0), np.uint32(1)
    right, top = np.float32(columns - 1.01), np.float32(rows - 1.01)
    scale, spread = np.float32(1.0 / resolution), np.float32(2.0 * error * error)
    share = np.float32(1.0 / outlier)
    for k in range(len(particles)):
        cos, sin = np.float32(math.cos(particles[k, 2])) * scale, np.float32(math.sin(particles[k, 2])) * scale
        from_x = np.float32((particles[k, 0] - origin[0]) / resolution)
        from_y = np.float32((particles[k, 1] - origin[1]) / resolution)
        total = zero
        for beam in range(len(ends)):
            x = from_x + cos * ends[beam, 0] - sin * ends[beam, 1]
            y = from_y + sin * ends[beam, 0] + cos * ends[beam, 1]
            x, y = min(max(x, zero), right), min(max(y, zero), top)
            j, i = np.uint32(x), np.uint32(y)
            u, v = x - np.float32(j), y - np.float32(i)
            below = distances[i, j] + u * (distances[i, j + one] - distances[i, j])
            above = distances[i + one, j] + u * (distances[i + one, j + one] - distances[i + one, j])
            distance = below + v * (above - below)
            squared = distance * distance
            total += squared / (spread + share * squared)
        costs[k] = total


@kernel
def drawn_anew(particles: FloatArray, weights: FloatArray, count: int, first: float, chosen: FloatArray) -> None:
    """Write `count` particles drawn by their weights (n,) to `chosen`, evenly from `first`, a share of one draw."""
    k, total, step = 0, weights[0], 1.0 / count
    for draw in range(count):
        at = (draw + first) * step
        while total < at and k < len(weights) - 1:
            k += 1
            total += weights[k]
        chosen[draw] = particles[k]


@kernel
def occupied_bins(
    particles: FloatArray, weights: FloatArray, least: float, side: float, turn: float, table: NDArray[np.int64]
) -> int:
    """Return how many bins hold particles of at least a weight.

    `table` is room for a hash table, of a power of 2 that is more than twice the particles.
    """
    table[:] = -1
    mask, count = len(table) - 1, 0
    for k in range(len(particles)):
        if weights[k] < least:
            continue
        x, y = math.floor(particles[k, 0] / side), math.floor(particles[k, 1] / side)
        heading = math.floor((particles[k, 2] % (2.0 * math.pi)) / turn)
        key = ((x & 0xFFFFF) << 32) | ((y & 0xFFFFF) << 12) | (heading & 0xFFF)
        at = (key * 0x9E3779B1 >> 7) & mask
        while table[at] != key and table[at] != -1:
            at = (at + 1) & mask
        if table[at] == -1:
            table[at] = key
            count += 1
    return count


def kld_count(bins: int) -> int:
    """Return how many particles approximate a density over so many bins (Fox 2003, equation 7)."""
    if bins < 2:
        return LEAST
    share = 2.0 / (9.0 * (bins - 1))
    return math.ceil((bins - 1) / (2.0 * _KLD_ERROR) * (1.0 - share + math.sqrt(share) * _KLD_QUANTILE) ** 3)


@kernel
def moments(particles: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the weighted mean (5,) and the covariance (5, 5) of particles; headings are averaged on the circle."""
    count = particles.shape[1]
    mean, covariance = np.zeros(count), np.zeros((count, count))
    cos, sin = 0.0, 0.0
    for k in range(len(particles)):
        for i in range(count):
            mean[i] += weights[k] * particles[k, i]
        cos += weights[k] * math.cos(particles[k, 2])
        sin += weights[k] * math.sin(particles[k, 2])
    mean[2] = math.atan2(sin, cos)
    off = np.empty(count)
    for k in range(len(particles)):
        for i in range(count):
            off[i] = particles[k, i] - mean[i]
        off[2] -= 2.0 * math.pi * round(off[2] / (2.0 * math.pi))
        for i in range(count):
            for j in range(i + 1):
                covariance[i, j] += weights[k] * off[i] * off[j]
    for i in range(count):
        for j in range(i):
            covariance[j, i] = covariance[i, j]
    return mean, covariance


class ParticleFilter:
    """Particles on a map.

    Args:
      field: of the map.
      rng: of all that is drawn.
      most: particles, at most, while the car is not lost.

    Attributes:
      found: whether the particles are together.
      state: their mean: x [m], y [m], heading [rad], and relative errors of odometry's speed and yaw rate.
      covariance: of them, (5, 5).
    """

    beams = BEAMS

    def __init__(self, field: DistanceField, rng: np.random.Generator, most: int = 2000) -> None:
        self._field, self._rng, self._most = field, rng, most
        self._particles, self._weights = np.empty((0, STATES)), np.empty(0)
        room = max(most, LOST)
        self._table = np.empty(1 << (2 * room).bit_length(), np.int64)
        self.found, self.state, self.covariance = False, np.zeros(STATES), np.eye(STATES)
        self._slow = self._fast = 0.0
        self._sure = 0  # scans in a row in which nearly all weights were in one place

    @property
    def particles(self) -> FloatArray:
        """The particles: x [m], y [m], heading [rad], errors of the speed and of the yaw rate. Shape (n, 5)."""
        return self._particles

    def start(self, pose: FloatArray | None, deviations: tuple[float, float]) -> None:
        """Begin anew with particles round a pose (3,), so many m and rad apart; None: anywhere on free ground."""
        count = LOST if pose is None else self._most
        self.found, self._sure, self._slow, self._fast = pose is not None, 0, 0.0, 0.0
        self._particles = np.empty((count, STATES))
        if pose is None:
            self._particles[:] = self._anywhere(count)
        else:
            place, heading = deviations
            spread = (place, place, heading, SCALE_ERROR, SCALE_ERROR)
            self._particles[:] = self._rng.normal((*pose, 0.0, 0.0), spread, (count, STATES))
        self._weights = np.full(count, 1.0 / count)
        self.state, self.covariance = moments(self._particles, self._weights)

    def _anywhere(self, count: int) -> FloatArray:
        """Return particles drawn over the free ground, with any heading (count, 5)."""
        rng, free = self._rng, self._field.free
        drawn = np.empty((count, STATES))
        half = 0.5 * self._field.resolution
        drawn[:, :2] = free[rng.integers(0, len(free), count)] + rng.uniform(-half, half, (count, 2))
        drawn[:, 2] = rng.uniform(-math.pi, math.pi, count)
        drawn[:, 3:] = rng.normal(0.0, SCALE_ERROR, (count, 2))
        return drawn

    def move(self, way: float, turn: float) -> None:
        """Move the particles by a step of odometry: the way ahead [m] and the turn [rad]."""
        drawn = self._rng.standard_normal(self._particles.shape, np.float32)
        move_all(self._particles, way, turn, *step_errors(way, turn), SCALE_WALK, drawn)

    def see(self, ends: FloatArray) -> None:
        """Weigh the particles by the ends of beams in the frame of the rear axle (b, 2) [m]; draw them anew."""
        if len(ends) < 2:
            return
        field, rng, few = self._field, self._rng, np.asarray(ends, np.float32)
        error, share = (_ERROR, 1.0) if self.found else (_LOST_ERROR, _LOST_SHARE)
        costs = np.empty(len(self._particles))
        costs_of(self._particles, field.distances, field.origin, field.resolution, few, error, _OUTLIER, costs)
        weights = self._weights * np.exp(share * (costs.min() - costs))
        weights /= weights.sum()
        fit = float(weights @ np.exp(-costs / len(ends)))
        if self._slow == 0.0:
            self._slow = self._fast = fit
        self._slow += _SLOW * (fit - self._slow)
        self._fast += _FAST * (fit - self._fast)
        self.state, self.covariance = moments(self._particles, weights)
        self._weights = weights
        if self.found:
            spread = math.sqrt(self.covariance[0, 0] + self.covariance[1, 1])
            self.found, self._sure = spread < _LOST_SPREAD and self._fast > _LOST_FITS, 0
        else:
            self._find(int(costs.argmin()), fit)
        weights = self._weights
        replaced = max(0.0, 1.0 - self._fast / (_WORSE * self._slow)) if self.found else _RESET_SHARE
        count = len(weights)
        if replaced < 1e-3 and 1.0 / float(weights @ weights) > _DRAWN_BELOW * count:
            return
        bins = occupied_bins(self._particles, weights, 1e-3 / count, _BIN, _BIN_TURN, self._table)
        wanted = min(max(kld_count(bins), LEAST), self._most if self.found else LOST)
        chosen = np.empty((wanted, STATES))
        drawn_anew(self._particles, weights, wanted, rng.random(), chosen)
        lacking = np.sqrt(np.maximum(_SCALE_SPREAD**2 - np.diag(self.covariance)[3:], 0.0))
        chosen[:, 3:] += lacking * rng.standard_normal((wanted, 2))
        some = round(replaced * wanted)
        if some:
            chosen[rng.choice(wanted, some, replace=False)] = self._likely(ends, few, some)
        self._particles, self._weights = chosen, np.full(wanted, 1.0 / wanted)

    def _find(self, likeliest: int, fit: float) -> None:
        """Take the car for found where nearly all weights have been in one place for some scans."""
        off = np.abs(self._particles[:, :3] - self._particles[likeliest, :3])
        off[:, 2] = np.abs(np.remainder(off[:, 2] + math.pi, 2.0 * math.pi) - math.pi)
        near = (off[:, 0] < _NEAR) & (off[:, 1] < _NEAR) & (off[:, 2] < _NEAR_TURN)
        mass = float(self._weights[near].sum())
        self._sure = self._sure + 1 if mass > _SURE and fit > _FITS else 0
        if self._sure >= _SURE_SCANS:
            self.found = True
            self._weights = np.where(near, self._weights, 0.0) / mass
            self._slow = self._fast = fit
            self.state, self.covariance = moments(self._particles, self._weights)

    def _likely(self, ends: FloatArray, few: NDArray[np.float32], count: int) -> FloatArray:
        """Return particles at places where a scan fits (count, 5): the best of many candidates, laid on the walls."""
        field, rng = self._field, self._rng
        candidates, costs = self._anywhere(_CANDIDATES), np.empty(_CANDIDATES)
        costs_of(candidates, field.distances, field.origin, field.resolution, few, 0.3, _OUTLIER, costs)
        best = candidates[np.argsort(costs, kind="stable")[:_BEST]]
        prior = np.diag((1e-2, 1e-2, 1e-2))
        for one in best:
            pose, _, _ = match(
                field.distances, field.origin, field.resolution, ends, one[:3].copy(), prior, 0.1, 0.5, _LAID
            )  # fmt: skip
            one[:3] = pose
        costs = np.empty(_BEST)
        costs_of(best, field.distances, field.origin, field.resolution, few, _LOST_ERROR, _OUTLIER, costs)
        weights = np.exp(_LOST_SHARE * (costs.min() - costs))
        chosen = best[rng.choice(_BEST, count, p=weights / weights.sum())]
        chosen[:, :3] += rng.normal(0.0, (0.05, 0.05, 0.02), (count, 3))
        chosen[:, 3:] = rng.normal(0.0, SCALE_ERROR, (count, 2))
        return chosen
