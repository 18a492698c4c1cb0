"""Opponents in the Gymnasium environments: planners and policies that drive beside the one that learns."""

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.racing.entries import Entry, grid_starts
from hand_planners import driven

pytest.importorskip("gymnasium")

from fg_mujoco.envs.gym_environment import F1TenthEnv

PARKED = np.zeros(2)


def parked(observation):
    return PARKED


def states(env, ticks, action=PARKED):
    """The complete states of the world of an environment, after each of some steps."""
    found = []
    for _ in range(ticks):
        env.step(np.asarray(action))
        found.append(env._world.state(0))
    return np.array(found)


def test_an_opponent_drives_the_bits_that_it_drives_in_a_race():
    entries = [Entry(controller=driven((0.0, 0.0))), Entry(controller="gap_finder", max_speed=5.0)]
    race = fg.race("oval", entries=entries, laps=1, time_limit=2.5)
    env = F1TenthEnv(start="line", opponents=[{"controller": "gap_finder", "max_speed": 5.0}])
    env.reset(seed=0)
    np.testing.assert_array_equal(states(env, 100), race.states[1:101])
    assert race.cars[1].max_speed_m_s > 2.0


def test_a_policy_sees_what_the_learning_car_would_see_and_its_actions_mean_the_same():
    """Two cars drive the same commands; the learning car is ahead in one environment, the policy's in the other."""
    commands = np.random.default_rng(0).uniform((-0.1, 0.5), (0.1, 3.0), (30, 2))
    seen_by_policy, clock = [], iter(range(31))

    def replayed(observation):
        seen_by_policy.append(observation)
        return commands[next(clock)]

    env = F1TenthEnv(start="line", beam_step=20, opponents=[replayed], grid_order="reversed")
    env.reset(seed=0)
    for command in commands:
        env.step(command)
    clock = iter(range(31))
    other = F1TenthEnv(start="line", beam_step=20, opponents=[lambda observation: commands[next(clock)]])
    seen, _ = other.reset(seed=0)
    for before, command in zip(seen_by_policy, commands, strict=True):
        for name, values in seen.items():
            np.testing.assert_allclose(values, before[name], atol=1e-5)
        seen, *_ = other.step(command)


@each(("order", "positions"), [("as_listed", {1}), ("reversed", {3}), ("random", {1, 2, 3})])
def test_cars_start_on_the_grid_in_their_order(order, positions):
    env = F1TenthEnv(opponents=[parked, parked], beam_step=540, grid_order=order, start={"s": 5.0})
    infos = [env.reset(seed=seed)[1] for seed in range(20)]
    assert {info["position"] for info in infos} == positions
    leads = {1: 0.8, 2: -0.8, 3: -1.6}  # on the foremost other
    assert [info["lead_m"] for info in infos] == pytest.approx([leads[info["position"]] for info in infos], abs=0.05)
    world = env._world.world
    grid = grid_starts(world.track, [car.parameters for car in world.cars])
    expected = sorted(world.track.start_pose(5.0 + place.s, place.offset)[:2] for place in grid)
    qpos = env._world.engine.qpos(0)
    standing = sorted(qpos[car.constants["free_qpos"][0] :][:2].tolist() for car in world.cars)
    np.testing.assert_allclose(standing, expected, atol=1e-12)


def test_touches_are_told_and_end_nothing():
    """The learning car starts behind a parked one, in line with it, and pushes it."""
    env = F1TenthEnv(
        start={"s": 4.0}, beam_step=540, opponents=[Entry(controller=parked, start=fg.Start(s=5.5, offset=0.15))]
    )
    _, info = env.reset(seed=0)
    assert (info["touches"], info["position"]) == (0, 2)
    for _ in range(60):
        _, _, terminated, truncated, info = env.step(np.array([0.0, 2.0]))
        assert not (terminated or truncated)
    assert info["touches"] >= 1
    assert F1TenthEnv(beam_step=540).reset(seed=0)[1].keys() == info.keys() - {"touches", "position", "lead_m"}


def test_an_opponent_has_the_speed_of_the_first_car_unless_it_is_given_its_own():
    first = Entry(max_speed=6.0, planner_mu=0.4, seed=3)
    assert [first.like("wall_follow", max_speed=speed).max_speed for speed in (None, 3.0)] == [6.0, 3.0]
    assert (first.like("wall_follow").controller, first.like("wall_follow").planner_mu) == ("wall_follow", 0.4)
