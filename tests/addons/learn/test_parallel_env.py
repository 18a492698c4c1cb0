"""The PettingZoo environment: PettingZoo's own tests pass, and its agents are the cars of the Gymnasium environment."""

import warnings

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.errors import MessageError

pytest.importorskip("pettingzoo", reason="the extra pettingzoo is not installed; make test installs it")

import gymnasium
from pettingzoo.test import parallel_api_test, parallel_seed_test

from fg_mujoco.envs.gym_environment import F1TenthEnv

STAND = np.zeros(2)


@pytest.mark.slow
@each("settings",
      [{"agents": 4, "track": "hairpins", "grid": "side_by_side", "normalised_actions": True},
       {"agents": 2, "opponents": ["gap_finder"], "grid_order": "random"},
       {"agents": 3, "ended_by": "all", "time_limit": 2.0}])  # fmt: skip
def test_api_test_of_pettingzoo_passes_without_a_warning(settings, capsys):
    env = fg.parallel_env(beam_step=60, **settings)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(env, num_cycles=100)
    assert "Passed Parallel API test" in capsys.readouterr().out


def test_seed_test_of_pettingzoo_passes():
    settings = {"agents": 3, "effects": {"range_noise_std": 0.01}, "grid_order": "random"}
    parallel_seed_test(lambda: fg.parallel_env(beam_step=60, **settings), num_cycles=30)


def test_agents_are_the_learning_car_and_a_policy_of_the_gymnasium_environment():
    """The same world by the other door: car_1's actions given by a policy, and all bits the same."""
    rng = np.random.default_rng(0)
    actions = rng.uniform((-0.1, 0.5), (0.1, 3.0), (40, 2, 2))
    clock, seen_by_policy = iter(range(41)), []

    def policy(observation):
        seen_by_policy.append(observation["scan"])
        return actions[next(clock), 1]

    env = F1TenthEnv(beam_step=20, opponents=[policy])
    parallel = fg.parallel_env(beam_step=20)
    seen, _ = env.reset(seed=3)
    both, _ = parallel.reset(seed=3)
    for tick, (own, other) in enumerate(actions):
        assert seen["scan"].tobytes() == both["car_0"]["scan"].tobytes()
        before = both["car_1"]["scan"]
        seen, reward, *_, info = env.step(own)
        both, rewards, _, _, infos = parallel.step({"car_0": own, "car_1": other})
        assert seen_by_policy[tick].tobytes() == before.tobytes()
        assert (reward, info) == (rewards["car_0"], infos["car_0"])


def test_an_agent_that_crashes_is_out_and_stays_as_an_obstacle():
    env = fg.parallel_env(agents=2, beam_step=540, start="line", rewards={"collision": 7.0})
    env.reset(seed=0)
    lines = {"car_0": np.array([0.4, 3.0]), "car_1": STAND}
    rewards, terminations = {}, {"car_0": False}
    while not terminations["car_0"]:
        assert env.agents == ["car_0", "car_1"]
        _, rewards, terminations, truncations, infos = env.step(lines)
    assert rewards["car_0"] < -6.0 < rewards["car_1"] and infos["car_0"]["end_reason"] == "crash"
    assert "end_reason" not in infos["car_1"] and not any(truncations.values())
    assert env.agents == ["car_1"]
    for _ in range(40):
        seen, rewards, *_ = env.step({"car_1": STAND})
        assert seen.keys() == rewards.keys() == {"car_1"}
    assert env._worlds.engine.speed(0) == pytest.approx(0.0, abs=0.02)
    while env.agents:
        _, _, terminations, truncations, infos = env.step({"car_1": STAND})
    assert truncations == {"car_1": True} and infos["car_1"]["end_reason"] == "no_progress"
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step({})


def test_agents_stay_until_all_have_ended_or_all_end_with_the_first():
    """As a vector of SuperSuit needs it: the same agents in each step, and one end for all."""
    env = fg.parallel_env(agents=2, beam_step=540, start="line", ended_by="all", time_limit=6.0)
    env.reset(seed=0)
    lines, told = {"car_0": np.array([0.4, 3.0]), "car_1": STAND}, []
    while env.agents:
        assert env.agents == ["car_0", "car_1"]
        told.append(env.step(lines))
    crash = next(tick for tick, (*_, infos) in enumerate(told) if "end_reason" in infos["car_0"])
    assert crash < 100 and len(told) == 240
    assert told[crash][0]["car_0"]["scan"].any() and told[crash][1]["car_0"] < -6.0
    for seen, rewards, _, _, infos in told[crash + 1 :]:
        assert rewards["car_0"] == infos["car_0"]["sliding"] == 0.0
        assert not any(values.any() for values in seen["car_0"].values())
    ends = [(any(terminations.values()), any(truncations.values())) for _, _, terminations, truncations, _ in told]
    assert ends[:-1] == [(False, False)] * 239
    assert told[-1][2:4] == ({"car_0": True, "car_1": False}, {"car_0": False, "car_1": True})
    env = fg.parallel_env(agents=2, beam_step=540, start="line", ended_by="any")
    env.reset(seed=0)
    while env.agents:
        _, _, terminations, _, infos = env.step(lines)
    assert terminations == {"car_0": True, "car_1": True}
    assert [info["end_reason"] for info in infos.values()] == ["crash", "other_crashed"]


def test_a_vector_of_supersuit_takes_cars_that_end_at_different_times():
    supersuit = pytest.importorskip("supersuit", reason="SuperSuit is not installed")
    env = fg.parallel_env(agents=3, ended_by="all", time_limit=2.0, observation="beams:9,speed,flat", start="line")
    envs = supersuit.concat_vec_envs_v1(supersuit.pettingzoo_env_to_vec_env_v1(env), 2, base_class="gymnasium")
    envs.reset(seed=0)
    for tick in range(1, 162):
        _, _, terminations, truncations, _ = envs.step(np.tile([[0.4, 3.0], [0.0, 0.0], [0.0, 0.0]], (2, 1)))
        over = terminations | truncations
        assert over.tolist() == [tick % 80 == 0] * 6


def test_who_finishes_sees_the_end_and_is_off_the_course():
    """The last observation is that of the finish line, and positions are those of the finish."""
    env = fg.parallel_env(track="oval", beam_step=60, start="line")
    env.reset(seed=0)
    engine, length = env._worlds.engine, env._worlds.world.track.length
    engine.monitor.timers["progress"][0] = engine.monitor.timers["furthest"][0] = length - 0.1
    while "car_0" in env.agents:
        seen, _, terminations, _, infos = env.step({"car_0": np.array([0.0, 2.0]), "car_1": STAND})
    assert terminations == {"car_0": True, "car_1": False} and infos["car_0"]["end_reason"] == "finished"
    assert 0.5 < seen["car_0"]["scan"].max() <= 30.0 and seen["car_0"]["scan"].min() < 2.0  # among the walls
    assert infos["car_0"]["position"] == 1
    engine.monitor.timers["progress"][0] = length  # so that the other comes further past the line
    engine.monitor.timers["progress"][1] = engine.monitor.timers["furthest"][1] = length - 0.01
    while env.agents:
        seen, _, _, _, infos = env.step({"car_1": np.array([0.0, 4.0])})
    assert infos["car_1"]["end_reason"] == "finished" and infos["car_1"]["lead_m"] > 0.0
    assert infos["car_1"]["position"] == 2


@each("actions, message",
      [({"car_0": STAND}, r"actions are of \['car_0'\]; accepted: one of each of \['car_0', 'car_1'\]"),
       ({"car_0": STAND, "car_1": STAND, "car_2": STAND}, "actions are of .*car_2"),
       (STAND, "actions are of .*accepted"),
       ({"car_0": STAND, "car_1": [0.0]}, "the action of car_1 is .*accepted: an action"),
       ({"car_0": STAND, "car_1": [np.nan, 0.0]}, "steering_angle is nan in world 1 of 2")])  # fmt: skip
def test_actions_that_are_none_are_refused_and_nothing_is_driven(actions, message):
    env = fg.parallel_env(beam_step=540)
    env.reset(seed=0)
    with pytest.raises(MessageError, match=message):
        env.step(actions)
    *_, infos = env.step({"car_0": STAND, "car_1": STAND})
    assert infos["car_0"]["time_s"] == pytest.approx(0.025)
