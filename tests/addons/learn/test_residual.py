"""Residual policies: they correct a planner's commands. Without a correction the planner drives, bit for bit."""

from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from driven_environments import race_as_environment
from fg_mujoco.addons.learn import policy_files
from fg_mujoco.addons.learn.policy_files import description_of, read_policy, save_policy
from fg_mujoco.addons.learn.residual import Residual
from fg_mujoco.controllers.gap_finder import GapFinder
from fg_mujoco.envs.actions import ActionBounds, ActionReader
from fg_mujoco.errors import FgMujocoError
from small_policies import network_for

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
from fg_mujoco.envs.gym_environment import F1TenthEnv
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv

BASE = "gap_finder[assist=safe]"
SETTINGS = {"residual": {"planner": BASE, "steering": 0.1, "speed": 1.0, "mu": 0.7}, "normalised_actions": True,
    "speed_range": (-5, 8), "observation": "beams:20,planner_command:history=2,speed,previous_action,normalised,flat"}
CAR = fg.World("oval").parameters


@cache
def planned(track, seconds):
    """What a race has recorded of the planner, as bytes."""
    return fg.race(track, BASE, mu=0.7, planner_mu=0.7, time_limit=seconds).car.telemetry.tobytes()


@cache
def interface_of_all():
    return F1TenthEnv(**SETTINGS).policy_interface


@each("repeat", [1, 3])
def test_without_a_correction_the_planner_drives(repeat, tmp_path):
    env = F1TenthEnv(**SETTINGS, action_repeat=repeat)
    network = network_for(env.policy_interface, gain=0.0)
    controller = str(save_policy(network, tmp_path / "nothing", env.policy_interface))
    race = fg.race("random:3:tight", controller, mu=0.7, time_limit=4.0)
    assert race.car.telemetry.tobytes() == planned("random:3:tight", 4.0)


@each("repeat", [1, 2])
def test_its_file_commands_in_a_race_what_it_commands_in_the_environment(repeat, tmp_path):
    env = F1TenthEnv(track="hairpins", start="line", mu=0.7, action_repeat=repeat, **SETTINGS)
    controller = save_policy(network_for(env.policy_interface), tmp_path / "policy", env.policy_interface)
    assert race_as_environment(env, controller, 40, mu=0.7).telemetry.tobytes() != planned("hairpins", 0.99)


def episodes_of(envs, steps, act):
    """Observations, rewards and ends of some steps of an environment, by their bytes."""
    seen, _ = envs.reset(seed=3)
    found = [np.asarray(seen).copy()]
    for step in range(steps):
        seen, reward, terminated, truncated, _ = envs.step(act(step))
        found += [np.asarray(each).copy() for each in (seen, reward, terminated | truncated)]
    return found


@each("alone", [False, True])
def test_worlds_are_single_environments(alone, monkeypatch):
    settings = SETTINGS | {"track": ["oval", "random:1:tight"],
                           "randomize": {"mu": (0.5, 1.1), "command_delay": (0.0, 0.02)}, "action_repeat": 2,
                           "time_limit": 0.8, "builds": 2, "effects": {"range_noise_std": 0.01}}  # fmt: skip
    actions = np.random.default_rng(0).uniform(-1, 1, (25, 3, 2)).astype(np.float32)
    if alone:
        monkeypatch.setattr(GapFinder, "batch", None)
    vector = F1TenthVectorEnv(3, threads=2, autoreset_mode="SameStep", **settings)
    found = episodes_of(vector, 25, lambda step: actions[step])
    for world in range(3):
        monkeypatch.undo()
        env = F1TenthEnv(**settings)
        seen, _ = env.reset(seed=3 + world)
        assert seen.tobytes() == found[0][world].tobytes()
        for step in range(25):
            seen, reward, terminated, truncated, _ = env.step(actions[step, world])
            if terminated or truncated:
                seen, _ = env.reset()
            assert (seen.tobytes(), reward) == (found[3 * step + 1][world].tobytes(), found[3 * step + 2][world])
        env.close()
    assert any(over.any() for over in found[3::3])


COMMANDS = st.tuples(st.floats(-0.4, 0.4), st.floats(-5.0, 8.0))


@given(planned=COMMANDS, action=st.tuples(st.floats(-2, 2), st.floats(-2, 2)), slow=st.sampled_from([0.0, 2.0]))
def test_a_command_is_the_planned_one_and_the_correction_within_the_limits(planned, action, slow):
    residual = Residual(planner=BASE, steering=0.1, speed=1.5, slow=slow)
    reader = ActionReader(ActionBounds(CAR, (-1.0, 7.0), normalised=True, residual=residual), 1)
    reader.planned, commands = np.array([planned]), np.zeros((1, 2))
    reader.read(np.array([action]), np.ones(1, np.bool_), commands, np.zeros(1, np.int64))
    share = 1.0 if slow == 0.0 else min(max(planned[1], 0.0) / slow, 1.0)
    expected = np.array(planned) + share * np.clip(action, -1, 1) * (0.1, 1.5)
    expected = np.clip(expected, (-CAR.max_steering_angle, -1.0), (CAR.max_steering_angle, 7.0))
    np.testing.assert_allclose(commands[0], expected, atol=1e-12)


@each("ending, planner", product((".onnx", ".zip"), (
        "mine.py", "./mine.py", "mine.py:mine", "mine.py[speed=1]", "ros:mine.py", "ros:mine.launch.py", "p"
    )))
def test_a_policys_file_runs_no_planners_file(ending, planner, here, monkeypatch):
    """Whoever made the policy chose the text of its base planner."""
    for name in ("mine.py", "mine.launch.py"):
        (here / name).write_text("open('executed', 'w')\ndef mine(scan, odometry): pass\n")
    path, described = Path("p").with_suffix(ending), description_of(interface_of_all())
    described["interface"]["residual"]["planner"] = planner
    path.write_bytes(b"")  # which the reader of the form returns so
    monkeypatch.setitem(policy_files._FORMS, ending, lambda content: (described, pytest.fail))
    for use in (lambda: read_policy(path), lambda: F1TenthEnv(residual=planner)):
        with pytest.raises(FgMujocoError, match=r"residual has the planner .*, which is no registered one; accepted:"):
            use()
    assert not (here / "executed").exists()


def test_a_training_begins_as_the_planner(tmp_path):
    pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed")
    from fg_mujoco.addons.learn.training import train

    ppo = {"n_steps": 32, "minibatches": 2, "n_epochs": 1, "net": (8,), "learning_rate": 1e-9}
    train(tmp_path / "first", environment={"track": "oval", "residual": BASE}, worlds=2, steps=64, ppo=ppo)
    policy = read_policy(tmp_path / "first")
    seen = np.full(policy.interface.observer().bounds.low.shape, 0.3, np.float32)
    np.testing.assert_allclose(policy.act(seen), 0.0, atol=1e-6)
    assert policy.interface.residual.planner == BASE
