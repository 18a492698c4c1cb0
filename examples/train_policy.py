"""Trains a small policy on the vector environment: 15 numbers, by CMA-ES, in a minute.

    pip install -e '.[gym]' cma
    python examples/train_policy.py --out policy.npz
    fg-mujoco race --controller 'examples/train_policy.py:LearnedPolicy[weights=policy]' --laps 3

The policy is linear in what it sees: the scan, averaged over eleven sectors, speed and yaw rate. It treats left and
right alike: what is seen on the left steers as much to the left as the same on the right to the right. So seven
numbers steer and eight choose the speed. In each generation CMA-ES draws some policies and drives each in a few
worlds; a policy is worth what the environment rewards in a fixed time, in which its car begins anew after each crash.

Source: Hansen, "The CMA Evolution Strategy: A Tutorial", 2016, as in the package `cma`.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fg_mujoco.errors import FgMujocoError
from fg_mujoco.messages import DriveCommand, FloatArray

BEAM_STEP = 20  # 55 of the beams: eleven sectors of five
SECTORS = 11
STEERING, SPEED = 2 + SECTORS // 2, 3 + SECTORS // 2
PARAMETERS = STEERING + SPEED
MAX_STEERING = 0.4189  # [rad] what a normalised action of 1 means; the environment reads it off the car
SPEED_RANGE = (0.5, 8.0)  # [m/s]
FAR = 10.0  # [m] what lies beyond is as good


def act(parameters: FloatArray, scan: FloatArray, speed: FloatArray, yaw_rate: FloatArray) -> FloatArray:
    """Return the normalised actions (n, 2) of n policies, each in its own world.

    Args:
      parameters: (n, PARAMETERS).
      scan: (n, 55) [m].
      speed: (n, 1) [m/s].
      yaw_rate: (n, 1) [rad/s].
    """
    sectors = np.minimum(scan, FAR).reshape(len(scan), SECTORS, -1).mean(axis=2) / FAR
    half = SECTORS // 2
    right, ahead, left = sectors[:, :half], sectors[:, half : half + 1], sectors[:, :half:-1]
    ones = np.ones_like(speed)
    odd = np.concatenate((left - right, yaw_rate / 5.0, (left - right)[:, -1:] * ahead), axis=1)
    even = np.concatenate((left + right, ahead, speed / 5.0, ones), axis=1)
    steering = np.sum(parameters[:, :STEERING] * odd, axis=1)
    faster = np.sum(parameters[:, STEERING:] * even, axis=1)
    return np.tanh(np.stack((steering, faster), axis=1))


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the planner."""

    weights: str = "policy"  # the file that `--out` wrote, without its ending


class LearnedPolicy:
    """The trained policy as a planner: for `fg-mujoco race`, and for the car."""

    Settings = Settings

    def __init__(self, settings: Settings) -> None:
        file = Path(settings.weights).with_suffix(".npz")
        self.files = [file]  # a comparison or a rollout that is gone on with asks whether it is the same file
        with np.load(file) as stored:
            self.parameters = stored["parameters"][np.newaxis]

    def reset(self) -> None:
        """Nothing to forget."""

    def __call__(self, scan, odometry) -> DriveCommand:
        """Return the command for what is seen."""
        middle = len(scan.ranges) // 2
        ranges = np.nan_to_num(scan.ranges[middle % BEAM_STEP :: BEAM_STEP], posinf=scan.range_max, neginf=0.0)
        speed, yaw_rate = np.array([[odometry.speed]]), np.array([[odometry.yaw_rate]])
        steering, faster = act(self.parameters, ranges[np.newaxis], speed, yaw_rate)[0].tolist()
        slowest, fastest = SPEED_RANGE
        return DriveCommand(
            steering_angle=MAX_STEERING * steering,
            speed=0.5 * (slowest + fastest) + 0.5 * (fastest - slowest) * faster,
        )


def returns(envs, parameters: FloatArray, starts: int, ticks: int, seeds: list[int]) -> FloatArray:
    """Return what each policy (k, PARAMETERS) is rewarded in so many ticks, the mean of its worlds. Shape (k,)."""
    each = np.repeat(parameters, starts, axis=0)
    seen, _ = envs.reset(seed=seeds * len(parameters))
    total = np.zeros(envs.num_envs)
    for _ in range(ticks):
        seen, rewards, *_ = envs.step(act(each, seen["scan"], seen["speed"], seen["yaw_rate"]))
        total += rewards
    return total.reshape(len(parameters), starts).mean(axis=1)


def train(
    track: str = "oval",
    *,
    generations: int | None = None,
    seconds: float = 60.0,
    population: int = 12,
    starts: int = 3,
    duration: float = 6.0,
    sliding: float = 1.0,
    seed: int = 1,
    watch=lambda generation, rewards: None,
) -> tuple[FloatArray, FloatArray]:
    """Return the policy (PARAMETERS,) and the learning curve (generations, population) [reward per second].

    Args:
      track: as `load_track` takes it.
      generations: how many; None: as many as begin within `seconds` of wall time.
      seconds: see there.
      population: policies in a generation.
      starts: worlds that each is driven in, the same for all of a generation.
      duration: of simulated time in each [s].
      sliding: what a second in which a tire slides costs.
      seed: of all that is random; with `generations` the result is the same, bit for bit.
      watch: told of each generation and its rewards (population,).
    """
    import cma
    import gymnasium

    envs = gymnasium.make_vec(
        "fg_mujoco.envs.gym_environment:fg_mujoco/F1Tenth-v0", num_envs=population * starts, track=track, laps=100,
        beam_step=BEAM_STEP, speed_range=SPEED_RANGE, normalised_actions=True,
        rewards={"sliding": sliding, "impact": 0.0, "bounded": False},  # no crash ends a cost: the time is fixed
    )  # fmt: skip
    ticks = round(duration / 0.025)
    rng = np.random.default_rng(seed)
    options = {"seed": seed, "popsize": population, "verbose": -9}
    search = cma.CMAEvolutionStrategy(np.zeros(PARAMETERS), 0.5, options)
    curve: list[FloatArray] = []
    began = time.monotonic()
    try:
        while len(curve) < generations if generations else time.monotonic() - began < seconds:
            drawn = search.ask()
            seeds = rng.integers(2**31, size=starts).tolist()
            rewards = returns(envs, np.array(drawn), starts, ticks, seeds) / duration
            search.tell(drawn, (-rewards).tolist())
            curve.append(rewards)
            watch(len(curve), rewards)
    except KeyboardInterrupt:  # what was learned is kept
        if not curve:
            raise
    envs.close()
    return np.asarray(search.mean), np.array(curve)


def plot(curve: FloatArray, path: Path) -> None:
    """Write a picture of a learning curve (generations, population); it needs matplotlib."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 2.8), layout="constrained")
    axes = figure.add_subplot()
    generations = np.arange(1, len(curve) + 1)
    axes.fill_between(generations, *np.percentile(curve, (10, 90), axis=1), color="#56b4e9", alpha=0.35, linewidth=0)
    axes.plot(generations, curve.max(axis=1), color="#0072b2", linewidth=1.0, label="best of the generation")
    axes.plot(generations, np.median(curve, axis=1), color="#d55e00", label="median; band: 10 to 90 %")
    axes.set(xlabel="generation", ylabel="reward per second", xlim=(1, len(curve)))
    axes.grid(linewidth=0.3)
    axes.legend(frameon=False, loc="lower right")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Train, and write the policy."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--track", default="oval")
    parser.add_argument("--seconds", type=float, default=60.0, help="of training")
    parser.add_argument("--generations", type=int, help="instead of seconds: the same result each time")
    parser.add_argument("--sliding", type=float, default=1.0, help="what a second in which a tire slides costs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("policy.npz"))
    parser.add_argument("--plot", type=Path, help="picture of the learning curve")
    options = parser.parse_args()
    if not options.out.absolute().parent.is_dir():
        parser.error(f"--out {options.out}: no such folder; accepted: a file in a folder that exists")
    print("generation  reward per second: mean, best")
    try:
        policy, curve = train(
            options.track, generations=options.generations, seconds=options.seconds, sliding=options.sliding,
            seed=options.seed,
            watch=lambda generation, rewards: print(f"{generation:10d}  {rewards.mean():+8.2f} {rewards.max():+8.2f}"),
        )  # fmt: skip
    except FgMujocoError as error:
        parser.error(str(error))
    np.savez(options.out, parameters=policy, curve=curve)
    if options.plot is not None:
        plot(curve, options.plot)
    print(f"written: {options.out}")


if __name__ == "__main__":
    main()
