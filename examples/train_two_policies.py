"""Trains two small policies against each other, and measures both against gap_finder, which they never meet.

    pip install -e '.[gym]' cma
    python examples/train_two_policies.py --out two
    fg-mujoco race --controller 'examples/train_policy.py:LearnedPolicy[weights=two_0]' --laps 3

The policies are those of train_policy.py, 15 numbers each. In each generation CMA-ES draws some policies for the first
car and drives each in a few worlds against the second policy as it is; then the other way round. A policy is worth what
the environment rewards in a fixed time, and one more for each second in front, less one for each touch.
"""

import argparse
import time

import numpy as np
from train_policy import BEAM_STEP, PARAMETERS, SPEED_RANGE, act  # the file beside this one

PERIOD = 0.025  # [s] of a step
JUDGED = 20.0  # [s] that a policy is measured for


class Rival:
    """The policy of the other car, as the environment calls it; its parameters are set between generations."""

    parameters = np.zeros(PARAMETERS)

    def __call__(self, seen):
        """Return the action for what is seen."""
        return act(self.parameters[np.newaxis], *(seen[name][np.newaxis] for name in ("scan", "speed", "yaw_rate")))[0]


def make(opponent, worlds, track, sliding=5.0):
    """Return so many worlds of two cars, which start on the grid in either order; sliding costs so much a second."""
    import gymnasium

    return gymnasium.make_vec(
        "fg_mujoco.envs.gym_environment:fg_mujoco/F1Tenth-v0", num_envs=worlds, track=track, laps=100,
        beam_step=BEAM_STEP, speed_range=SPEED_RANGE, normalised_actions=True,
        rewards={"sliding": sliding, "impact": 0.0, "bounded": False},  # no crash ends a cost: the time is fixed
        opponents=[opponent], grid_order="random", autoreset_mode="SameStep",
    )  # fmt: skip


def drive(envs, policies, seconds, seeds):
    """Yield rewards, ends and infos of each step in which policies (k, PARAMETERS) drive, each in its own world."""
    seen, _ = envs.reset(seed=seeds)
    for _ in range(round(seconds / PERIOD)):
        actions = act(policies, seen["scan"], seen["speed"], seen["yaw_rate"])
        seen, rewards, terminated, truncated, infos = envs.step(actions)
        yield rewards, terminated | truncated, infos


def worth(envs, policies, seconds, seeds):
    """Return what each policy (k, PARAMETERS) is worth, the mean of its worlds, one for each seed. Shape (k,)."""
    total, touches = np.zeros(envs.num_envs), 0
    for rewards, _, infos in drive(envs, np.repeat(policies, len(seeds), axis=0), seconds, seeds * len(policies)):
        total += rewards + PERIOD * (infos["position"] == 1) - np.maximum(infos["touches"] - touches, 0)
        touches = infos["touches"]
    return total.reshape(len(policies), -1).mean(axis=1)


def judge(envs, policy):
    """Return what a policy does from as many starts as there are worlds.

    Returns:
      Metres driven in JUDGED seconds or until it crashes, the mean; the share of worlds without a crash; and in these
      the mean lead on the opponent at the end [m], NaN where there is none.
    """
    runs, metres, leads = np.ones(envs.num_envs, np.bool_), np.zeros(envs.num_envs), np.zeros(envs.num_envs)
    for _, over, infos in drive(envs, np.tile(policy, (envs.num_envs, 1)), JUDGED, 1000):
        runs &= ~over
        metres[runs], leads[runs] = infos["progress_m"][runs], infos["lead_m"][runs]
    return metres.mean(), runs.mean(), leads[runs].mean() if runs.any() else np.nan


def train(track="oval", generations=40, population=10, starts=3, seconds=6.0, seed=1, watch=lambda *_: None):
    """Return the two policies (2, PARAMETERS); with the same arguments the same, bit for bit.

    Args:
      track: as `load_track` takes it.
      generations: of each policy.
      population: policies that are drawn in a generation.
      starts: worlds that each of them is driven in, the same for all of a generation.
      seconds: of simulated time in each.
      seed: of all that is random.
      watch: told of each generation and the policies so far.
    """
    import cma

    rival, rng, policies = Rival(), np.random.default_rng(seed), np.zeros((2, PARAMETERS))
    envs = make(rival, population * starts, track)
    options = [{"seed": seed + k, "popsize": population, "verbose": -9} for k in (0, 1)]
    searches = [cma.CMAEvolutionStrategy(np.zeros(PARAMETERS), 0.5, each) for each in options]
    for generation in range(1, generations + 1):
        for k, search in enumerate(searches):
            rival.parameters = policies[1 - k].copy()
            drawn, seeds = search.ask(), rng.integers(2**31, size=starts).tolist()
            search.tell(drawn, (-worth(envs, np.array(drawn), seconds, seeds)).tolist())
            policies[k] = search.mean
        watch(generation, policies)
    envs.close()
    return policies


def main():
    """Train, judge and write the policies."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--track", default="oval")
    parser.add_argument("--generations", type=int, default=40, help="of each policy")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", default="two", help="beginning of the names of the two files that are written")
    options = parser.parse_args()
    judges, began = make("gap_finder", 12, options.track), time.process_time()

    def watch(generation, policies):
        if generation in (1, 5) or generation % 10 == 0:
            told = ["{:5.1f} {:4.0%} {:+6.1f}".format(*judge(judges, policy)) for policy in policies]
            print(f"{generation:10d}  {told[0]}   {told[1]}   {time.process_time() - began:6.0f}", flush=True)

    print(f"generation  of each, in {JUDGED:g} s: metres, without a crash, lead on gap_finder [m];  CPU [s]")
    for k, policy in enumerate(train(options.track, options.generations, seed=options.seed, watch=watch)):
        np.savez(f"{options.out}_{k}.npz", parameters=policy)


if __name__ == "__main__":
    main()
