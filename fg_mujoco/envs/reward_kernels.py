"""The loops of an environment over its worlds, compiled: actions in, rewards and observations out."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled.kernels import kernel
from ..messages import FloatArray


@kernel
def read_actions(
    actions: FloatArray,
    taken: NDArray[np.bool_],
    limits: FloatArray,
    share: float,
    planned: FloatArray,
    slow: float,
    targets: FloatArray,
    held_before: FloatArray,
    commands: FloatArray,
    clipped: NDArray[np.int64],
) -> int:
    """Convert actions (n, 2) to commands (n, 2) of a tick, and count the clipped ones (n,) of the cars `taken` (n,).

    Args:
      limits: (7, 2) least and greatest action; what is asked for at 0, and more at 1; the time for which it is
        integrated [s], 0: it is the command itself; least and greatest command.
      share: by which a command comes nearer to what is asked for in a tick; 1: all of it.
      planned: (n, 2) commands of planners that the actions correct; (0, 2): they correct none.
      slow: planned speed below which corrections are smaller in proportion [m/s]; 0: nowhere.
      targets: (2, n, 2) what is asked for, and the command; of the last tick, brought up to date.
      held_before: (n, 2) written to: the actions, within their bounds.

    Returns:
      Where the first part of an action that is NaN is, counted through the rows; -1: none is, and all is written.
    """
    for i in range(len(actions)):
        for part in range(2):
            if taken[i] and math.isnan(actions[i, part]):
                return 2 * i + part
    for i in range(len(actions)):
        if not taken[i]:
            continue
        differs = False
        for part in range(2):
            held = min(max(actions[i, part], limits[0, part]), limits[1, part])
            differs = differs or held != actions[i, part]
            held_before[i, part] = held
            asked = limits[2, part] + limits[3, part] * held
            if limits[4, part] > 0.0:
                asked = targets[0, i, part] + limits[4, part] * asked
                asked = min(max(asked, limits[5, part]), limits[6, part])
            if len(planned):
                if slow > 0.0 and planned[i, 1] < slow:
                    asked *= max(planned[i, 1], 0.0) / slow
                asked = min(max(planned[i, part] + asked, limits[5, part]), limits[6, part])
            targets[0, i, part] = asked
            if share < 1.0:
                asked = targets[1, i, part] + share * (asked - targets[1, i, part])
            targets[1, i, part] = asked
            commands[i, part] = asked
        clipped[i] += differs
    return -1


@kernel
def reward_ticks(
    driven: NDArray[np.bool_],
    progress: FloatArray,
    before: FloatArray,
    crashed: NDArray[np.bool_],
    sliding: FloatArray,
    impacts: FloatArray,
    weights: FloatArray,
    share: float,
    alone: bool,
    rewards: FloatArray,
    terms: FloatArray,
) -> None:
    """Write the four default terms of a tick; and its rewards (n,), where there are no other terms.

    Args:
      driven: (n,) the worlds in which it was driven; the others' rows are left as they are.
      progress, before: (n,) [m] now, and at the start of the tick, brought up to date.
      crashed, sliding, impacts: (n,) whether it crashed, share of the tick in which a tire slid, speed of it [m/s].
      weights: (4,) of a metre, of a crash, of a tick in which a tire slides all the while, and of 1 m/s of an impact.
      share: of what a tick gains, the most that its running costs take; inf: they are not bounded.
      alone: whether there are no other terms; else `sum_terms` bounds and sums them.
      terms: (2, k, n) written to: of each term the tick's value, and the sum of the episode, which it is added to.
    """
    for i in range(len(driven)):
        if driven[i]:
            made, slid = weights[0] * (progress[i] - before[i]), weights[2] * sliding[i]
            if alone and slid > 0.0 and share < math.inf:
                slid = min(slid, share * max(made, 0.0))
            reward = made - slid
            terms[0, 0, i], terms[0, 1, i], terms[0, 2, i], terms[0, 3, i] = made, 0.0, 0.0 - slid, 0.0
            if crashed[i]:
                terms[0, 1, i], terms[0, 3, i] = -weights[1], 0.0 - weights[3] * impacts[i]
                reward = reward + terms[0, 1, i] + terms[0, 3, i]
            rewards[i] = reward
            before[i] = progress[i]
            if alone:
                for term in range(4):
                    terms[1, term, i] += terms[0, term, i]


@kernel
def sum_terms(
    driven: NDArray[np.bool_],
    running: NDArray[np.bool_],
    share: float,
    rewards: FloatArray,
    terms: FloatArray,
) -> int:
    """Bound the costs of a tick that are `running` (k,), and write the rewards (n,); arguments as of `reward_ticks`.

    Of terms that `reward_ticks` has not written, the values of worlds that were not driven become 0. Returns where the
    first value that is not finite is, counted through the rows of the terms; -1: all is written.
    """
    count = len(driven)
    for term in range(4, len(running)):
        for i in range(count):
            if not driven[i]:
                terms[0, term, i] = 0.0
            elif not math.isfinite(terms[0, term, i]):
                return term * count + i
    for i in range(count):
        if not driven[i]:
            continue
        gain, cost = 0.0, 0.0
        for term in range(len(running)):
            value = terms[0, term, i]
            if running[term]:
                cost -= min(value, 0.0)
            else:
                gain += max(value, 0.0)
        bound = share * gain if share < math.inf else cost
        for term in range(len(running)):
            if cost > bound and running[term] and terms[0, term, i] < 0.0:
                terms[0, term, i] = terms[0, term, i] / cost * bound
            terms[1, term, i] += terms[0, term, i]
        reward = terms[0, 0, i] + terms[0, 2, i] + terms[0, 1, i] + terms[0, 3, i]  # in the order of `reward_ticks`
        for term in range(4, len(running)):
            reward += terms[0, term, i]
        rewards[i] = reward
    return -1


@kernel
def read_sensors(
    stride: int,
    ranges: FloatArray,
    odometry: FloatArray,
    actions: FloatArray,
    planned: FloatArray,
    beams: NDArray[np.int64],
    range_max: float,
    columns: NDArray[np.int64],
    low: NDArray[np.float32],
    high: NDArray[np.float32],
    scan: NDArray[np.float32],
    values: NDArray[np.float32],
) -> None:
    """Write the parts of an observation that are read off sensors, within their bounds `low` and `high` (k,).

    `columns` (k,) are numbers of the odometry; from its number on, of the actions, and of planners, which are needed
    where a column is of them. In the `scan` (n, beams seen) [m] no return reads `range_max`, too close or failed 0.
    """
    width = odometry.shape[1]
    for i in range(len(scan)):
        row = i * stride
        for beam in range(scan.shape[1]):
            distance = ranges[row, beams[beam]]
            # a NaN is not above 0
            scan[i, beam] = min(distance, range_max) if distance > 0.0 else 0.0
        for k in range(len(columns)):
            column = columns[k]
            if column < width:
                value = odometry[row, column]
            else:
                value = actions[i, column - width] if column < width + 2 else planned[i, column - width - 2]
            values[i, k] = min(max(np.float32(value), low[k]), high[k])
