"""Ratings of players from who beat whom: the Bradley-Terry model, with intervals.

    found = ratings(np.array([[0, 7], [3, 0]]))
    found.value, found.low, found.high

Player i beats player j with probability 1 / (1 + 10^((R_j - R_i) / 400)), the scale of chess: 100 points more are 64 %
of the wins. The mean of all players is 1500.

Source of the model: R. Bradley and M. Terry, Rank analysis of incomplete block designs, Biometrika 39, 1952. It is a
logistic regression. Plain maximum likelihood has no finite answer where a player won all or none of his heats, which
happens in small leagues. So the likelihood is multiplied by the square root of the determinant of its information
(Jeffreys' prior): D. Firth, Bias reduction of maximum likelihood estimates, Biometrika 80, 1993. Of two players who met
n times, of which the one won w, the odds are then (w + 1/2) / (n - w + 1/2). The answer is always finite, and differs
little from plain maximum likelihood where both are.

Intervals at 95 % come from the curvature of the likelihood there: 1.96 standard deviations of the inverse information,
each of the player's distance from the mean. They count heats as independent of each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fg_mujoco.messages import FloatArray

MEAN = 1500.0
POINTS = 400.0 / math.log(10.0)
"""Points of a unit of log odds."""

_Z = 1.959963984540054  # of 95 %
_CONVERGED = 1e-10  # of log odds
_ROUNDING = 1e-12  # of the likelihood
_MOST_STEPS = 500


@dataclass(frozen=True, kw_only=True, eq=False)
class Ratings:
    """The ratings of some players [points], each shape (n,); NaN of players whom no heats connect with most others."""

    value: FloatArray
    low: FloatArray  # lower end of the interval at 95 %
    high: FloatArray


def ratings(wins: FloatArray) -> Ratings:
    """Return the ratings of players.

    Args:
      wins: how often player i beat player j, (n, n).
    """
    found = np.full((3, len(wins)), np.nan)
    connected = _largest_group(wins)
    if len(connected) > 1:
        strength, deviation = _fit(np.asarray(wins, np.float64)[np.ix_(connected, connected)])
        half = _Z * deviation
        found[:, connected] = MEAN + POINTS * np.stack((strength, strength - half, strength + half))
    value, low, high = found
    return Ratings(value=value, low=low, high=high)


def _largest_group(wins: FloatArray) -> list[int]:
    """Return the largest group of players whom heats with a winner connect."""
    met = (np.asarray(wins) + np.asarray(wins).T) > 0
    groups: list[list[int]] = []
    for player in range(len(met)):
        if any(player in group for group in groups):
            continue
        group, at = [player], 0
        while at < len(group):
            group += [other for other in np.flatnonzero(met[group[at]]).tolist() if other not in group]
            at += 1
        groups.append(sorted(group))
    return max(groups, key=len, default=[])


def _fit(wins: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return log strengths, of mean 0, and their standard deviations, (n,) each, of players who are connected.

    Fisher scoring with Firth's adjusted score, with the first player's strength fixed at 0.
    """
    count = len(wins)
    first, second = np.triu_indices(count, 1)
    won, lost = wins[first, second], wins[second, first]
    played = won + lost
    design = np.zeros((len(first), count))
    design[np.arange(len(first)), first] = 1.0
    design[np.arange(len(first)), second] = -1.0
    design = design[:, 1:]
    strength = np.zeros(count - 1)
    for _ in range(_MOST_STEPS):
        share = 1.0 / (1.0 + np.exp(-(design @ strength)))
        weight = played * share * (1.0 - share)
        covariance = np.linalg.inv(design.T @ (weight[:, np.newaxis] * design))
        leverage = weight * np.einsum("ij,jk,ik->i", design, covariance, design)
        step = covariance @ (design.T @ (won - played * share + leverage * (0.5 - share)))
        now = _likelihood(design, strength, won, lost)
        while _likelihood(design, strength + step, won, lost) < now - _ROUNDING * abs(now):
            step = 0.5 * step
        strength = strength + step
        if float(np.abs(step).max()) <= _CONVERGED:
            break
    centred = np.eye(count)[:, 1:] - np.full((count, count - 1), 1.0 / count)  # of all, from those of all but the first
    variance = np.einsum("ij,jk,ik->i", centred, covariance, centred)
    return centred @ strength, np.sqrt(variance)


def _likelihood(design: FloatArray, strength: FloatArray, won: FloatArray, lost: FloatArray) -> float:
    """Return the logarithm of the likelihood times Jeffreys' prior."""
    margin = design @ strength
    share = 1.0 / (1.0 + np.exp(-margin))
    weight = (won + lost) * share * (1.0 - share)
    _, information = np.linalg.slogdet(design.T @ (weight[:, np.newaxis] * design))
    of_heats = won @ np.logaddexp(0.0, -margin) + lost @ np.logaddexp(0.0, margin)
    return float(0.5 * information - of_heats)
