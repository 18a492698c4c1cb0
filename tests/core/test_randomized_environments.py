"""Environments that draw their worlds anew for each episode: what they draw, and that nothing is left of the last."""

import gc
import weakref
from collections import Counter

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.envs.builds import BuildPlan
from fg_mujoco.envs.environment_settings import EnvironmentSettings
from fg_mujoco.racing.randomization import PARAMETERS

gym_environment = pytest.importorskip("fg_mujoco.envs.gym_environment", exc_type=ImportError)
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv  # noqa: E402

F1TenthEnv = gym_environment.F1TenthEnv

CAR = {
    "mu": (0.5, 1.1), "mass": (3.3, 4.2), "cog_height": (0.06, 0.09), "steering_gain": (0.8, 1.2),
    "speed_gain": (0.8, 1.2), "command_delay": (0.0, 0.04),
}  # fmt: skip


@each("made_with", ["settings", "options"])
def test_an_episode_is_that_of_the_environment_with_what_was_drawn(made_with):
    """After two other episodes: nothing of them is left. Oracle: the values compiled, or given, from the beginning."""
    drawn = F1TenthEnv(track=["oval", "hairpins"], randomize={**CAR, "start_s": (0.0, 20.0)}, start="line", builds=2)
    for seed in range(3):
        _, info = drawn.reset(seed=seed)
    values = {name.removeprefix("drawn_"): value for name, value in info.items() if name.startswith("drawn_")}
    if made_with == "options":
        plain = F1TenthEnv(track=["oval", "hairpins"], randomize={**CAR, "start_s": (0.0, 20.0)}, start="line")
        plain.reset(seed=7, options=values)
    else:
        changes = {field: values[name] for name, (owner, field) in PARAMETERS.items() if owner is fg.CarChanges}
        plain = F1TenthEnv(track=values["track"], start={"s": values["start_s"]}, changes=changes)
        plain.reset(seed=7)
    for action in np.random.default_rng(0).uniform([-0.3, 0.0], [0.3, 4.0], (20, 2)).astype(np.float32):
        drawn.step(action), plain.step(action)
        np.testing.assert_allclose(drawn._world.state(0), plain._world.state(0), rtol=1e-9, atol=1e-12)


def test_courses_are_as_often_among_the_builds_as_each_other():
    settings = EnvironmentSettings.of({"track": ["oval", "fast", "random:7:9"], "builds": 16})
    plan = BuildPlan(settings, settings.randomization, 1)
    names = ["oval", "fast", "random:7", "random:8"]
    assert Counter(plan.values(k)["track"] for k in range(16)) == dict.fromkeys(names, 4)
    other = EnvironmentSettings.of({"track": ["oval", "fast", "random:7:9"], "builds": 16, "build_seed": 1})
    plan_of_other = BuildPlan(other, other.randomization, 1)
    assert [plan.values(k) for k in range(16)] != [plan_of_other.values(k) for k in range(16)]


def test_ranges_can_be_changed_between_episodes():
    env = F1TenthEnv(beam_step=90, randomize={"mu": (0.9, 1.0)})
    _, info = env.reset(seed=1)
    assert 0.9 <= info["drawn_mu"] <= 1.0
    env.set_randomization({"mu": (0.4, 0.5), "mass": [4.0]})
    *_, info = env.step(np.zeros(2, np.float32))
    assert 0.9 <= info["drawn_mu"] <= 1.0  # until the next reset
    _, info = env.reset()
    assert 0.4 <= info["drawn_mu"] <= 0.5 and info["drawn_mass"] == 4.0
    assert env._world.engine.cars[0].parameters.mass == pytest.approx(4.0)
    envs = F1TenthVectorEnv(2, beam_step=90, randomize={"mu": (0.9, 1.0)})
    envs.call("set_randomization", {"mu": [0.7]})
    assert envs.reset(seed=1)[1]["drawn_mu"].tolist() == [0.7, 0.7]


def test_opponents_that_take_no_part_are_nowhere():
    randomize = {"opponents": (0, 2), "opponent": ["gap_finder", "pure_pursuit"], "opponent_speed": (2.0, 4.0)}
    env = F1TenthEnv(beam_step=10, randomize=randomize, start="line", grid_order="reversed")
    for count in (2, 0, 1):
        observation, info = env.reset(seed=1, options={"opponents": count})
        assert (info["drawn_opponents"], info["position"]) == (count, count + 1)
        assert np.isinf(info["lead_m"]) == (count == 0)
        ahead = observation["scan"][len(observation["scan"]) // 2]
        if count == 0:
            alone = ahead
        for _ in range(5):
            *_, info = env.step(np.zeros(2, np.float32))
        assert info["touches"] == 0 and info["position"] == count + 1
    assert alone > 5.0 and info["drawn_opponent"] in ("gap_finder", "pure_pursuit")


def test_terms_of_the_course_are_those_of_each_worlds_own():
    envs = F1TenthVectorEnv(2, track=["oval", "hairpins"], builds=2, beam_step=90, rewards={"near_wall": 1.0})
    _, info = envs.reset(seed=3)
    assert set(info["drawn_track"]) == {"oval", "hairpins"}
    distances = envs._worlds.tick_state.wall_distance
    for i, name in enumerate(info["drawn_track"].tolist()):
        one = F1TenthEnv(track=name, beam_step=90, rewards={"near_wall": 1.0}, start="line")
        one.reset()
        x, y, heading = envs._worlds.tick_state.pose[i].tolist()
        state = one._world.tick_state
        own = state.ground.distances(np.zeros(1), np.array([[x, y, heading]]), state.car)
        assert distances[i] == own[0]


def test_a_build_of_one_episode_goes_with_it():
    settings = {"track": ["oval", "hairpins"], "builds": None, "beam_step": 90, "randomize": {"obstacles": (0, 3)}}
    env, worlds = F1TenthVectorEnv(2, **settings), []
    for seed in range(3):
        env.reset(seed=seed if seed % 2 else None)
        worlds += [weakref.ref(env._worlds.engine.world_of(i)) for i in range(2)]
    gc.collect()
    assert [seen() is not None for seen in worlds] == [False] * 4 + [True] * 2
    env.close()
