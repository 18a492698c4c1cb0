"""What a crash, standing, crawling and driving are worth in each preset of rewards: a table of returns.

    python benchmarks/reward_returns.py --tracks oval hairpins random:0 --seconds 20

Each behaviour drives on each track, from a standing start. The terms of each tick are recorded, so that all presets
judge the same drives. `drive` is gap_finder, which knows the friction. `drive noisily` adds to each of its commands
normal numbers of .25 rad and 1.65 m/s, new in each tick, as a policy that explores does. A return is the sum of the
rewards until the episode or the time ends, discounted by gamma a tick, and is the mean of the tracks.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from common import report
from common import table as markdown
from numpy.typing import NDArray

from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.envs.episodes import Episodes
from fg_mujoco.envs.reward_kernels import sum_terms
from fg_mujoco.envs.rewards import PRESETS, Rewards
from fg_mujoco.envs.worlds import Worlds
from fg_mujoco.messages import Controller
from fg_mujoco.racing.entries import Entry
from fg_mujoco.racing.planners import build_controller, find_controller
from fg_mujoco.simulation.planner_adapter import odometry_message

Drive = Mapping[str, NDArray[np.float64]]
"""Values of the terms with weight 1 in each tick, by name."""

NOISE = (0.25, 1.65)
"""[rad, m/s] standard deviations of the noise with which PPO explores at first."""

GAMMAS = (0.99, 0.995, 1.0)

_ONE = np.ones(1, np.bool_)


def driven(track: str, behaviour: str, seconds: float, seed: int, terms: Sequence[str]) -> Drive:
    """Return the terms of a drive, of one of BEHAVIOURS."""
    weights: dict[str, Any] = dict.fromkeys(terms, 1.0)
    settings = EnvironmentSettings.of(
        {"track": track, "laps": 1000, "start": "line", "rewards": weights | {"bounded": False}}
    )
    worlds = Worlds(settings)
    episodes, command = Episodes(settings, worlds), BEHAVIOURS[behaviour]
    episodes.begin(_ONE, [np.random.default_rng(seed)])
    noise = np.random.default_rng(seed)
    planner = _gap_finder(worlds, command.max_speed)
    rows: list[dict[str, Any]] = []
    while episodes.running[0] and len(rows) < round(seconds / worlds.period):
        episodes.observe(_ONE)
        beams, row = worlds.world.vehicle.lidar.beams, worlds.odometry[0]
        answer = planner(beams.to_scan(worlds.ranges[0], float(row["stamp"])), odometry_message(row))
        episodes.step([command(np.array((answer.steering_angle, answer.speed)), noise)])
        rows.append(episodes.facts_of(0))
    worlds.close()
    return {name: np.array([row[f"reward_{name}"] for row in rows]) for name in terms}


class Behaviour:
    """A way to drive, which answers the action of a tick.

    Args:
      action: of gap_finder's command (2,) and a generator.
      max_speed: of gap_finder [m/s]; None: its own.
    """

    def __init__(self, action: Callable[[Any, np.random.Generator], Any], max_speed: float | None = None) -> None:
        self._action, self.max_speed = action, max_speed

    def __call__(self, command: Any, rng: np.random.Generator) -> Any:
        """Return the action."""
        return self._action(command, rng)


BEHAVIOURS: Mapping[str, Behaviour] = {
    "crash at once": Behaviour(lambda command, rng: (0.4, 5.0)),
    "sprint into a wall": Behaviour(lambda command, rng: (0.0, 20.0)),
    "stand": Behaviour(lambda command, rng: (0.0, 0.0)),
    "crawl": Behaviour(lambda command, rng: command, max_speed=1.0),
    "drive noisily": Behaviour(lambda command, rng: command + rng.normal(0.0, NOISE)),
    "drive": Behaviour(lambda command, rng: command),
}


def tick_rewards(rewards: Rewards, drive: Drive) -> NDArray[np.float64]:
    """Return the rewards of the ticks of a drive. Shape (ticks,)."""
    ticks = len(next(iter(drive.values())))
    terms, found = np.zeros((2, len(rewards.terms), ticks)), np.zeros(ticks)
    for row, term in enumerate(rewards.terms):
        terms[0, row] = term.weight * drive[term.name]
    costs = np.array([term.running_cost for term in rewards.terms])
    sum_terms(np.ones(ticks, np.bool_), costs, rewards.share, found, terms)
    return found


def returns(rewards: Rewards, drive: Drive, gamma: float) -> float:
    """Return what a drive is worth."""
    found = tick_rewards(rewards, drive)
    return float(found @ gamma ** np.arange(len(found)))


def table(designs: Mapping[str, Rewards], tracks: Sequence[str], seconds: float, seeds: int) -> dict[str, Any]:
    """Return of each behaviour and design the return by gamma, the mean of the tracks and seeds."""
    terms = sorted({term.name for rewards in designs.values() for term in rewards.terms} | {"survival"})
    found: dict[str, Any] = {}
    for behaviour in BEHAVIOURS:
        drives = [driven(track, behaviour, seconds, seed, terms) for track in tracks for seed in range(seeds)]
        found[behaviour] = {
            name: {gamma: float(np.mean([returns(rewards, drive, gamma) for drive in drives])) for gamma in GAMMAS}
            for name, rewards in designs.items()
        }
        found[behaviour]["seconds"] = float(np.mean([drive["survival"].sum() for drive in drives]))
        found[behaviour]["metres"] = float(np.mean([drive["progress"].sum() for drive in drives]))
        slid = [-drive["sliding"].sum() / drive["survival"].sum() for drive in drives]
        found[behaviour]["sliding"] = float(np.mean(slid))
    return found


def _gap_finder(worlds: Worlds, max_speed: float | None) -> Controller:
    entry = Entry(controller="gap_finder", **({} if max_speed is None else {"max_speed": max_speed}))
    context = entry.context(worlds.world.parameters, worlds.world.track.map_line)
    planner = build_controller(find_controller("gap_finder"), "gap_finder", context, {})
    planner.reset()
    return planner


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tracks", nargs="+", default=["oval", "hairpins", "random:0"])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--seeds", type=int, default=3, help="of the noise")
    parser.add_argument("--rewards", type=json.loads, help='weights of your own as JSON, {"sliding": 20.0}')
    parser.add_argument("--json", type=Path, help="file that the figures are written to")
    options = parser.parse_args()
    designs = {"default": Rewards(), **{name: Rewards(preset=name) for name in PRESETS}}
    if options.rewards is not None:
        designs = {"own": Rewards.of(options.rewards)}
    found = table(designs, options.tracks, options.seconds, options.seeds)
    rows = []
    for behaviour, row in found.items():
        worth = [", ".join(f"{row[name][gamma]:.1f}" for gamma in GAMMAS) for name in designs]
        rows.append((behaviour, f"{row['seconds']:.1f} s, {row['metres']:.0f} m", f"{abs(row['sliding']):.0%}", *worth))
    report({"returns": found}, markdown(("", "driven", "sliding", *designs), rows), options.json)


if __name__ == "__main__":
    main()
