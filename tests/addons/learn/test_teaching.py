"""A planner teaches a policy: what is learned of the friction, actions that follow a planner, turns, and lessons."""

import json
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from fg_mujoco.addons.drivers.friction_learning import LEARNED, learn, learning_row
from fg_mujoco.addons.learn.policy_files import read_policy
from fg_mujoco.controllers.control.planner_settings import CAR
from fg_mujoco.envs.actions import ActionBounds, ActionReader
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv
from fg_mujoco.envs.policy_interface import PolicyInterface
from fg_mujoco.messages import ODOMETRY
from refusals import refused

PARAMETERS = fg.Vehicle.load("f1tenth").parameters
ANGLES, SPEEDS = st.floats(-0.5, 0.5), st.floats(-2.0, 9.0)


def test_what_a_car_learns_of_the_friction_is_what_gap_finder_would_learn():
    """Of the odometry of each tick, also of those between the steps; and it is forgotten at the end of an episode."""
    env = F1TenthVectorEnv(2, track="oval", observation="friction", action_repeat=2, start="line", mu=0.7)
    car = env.episodes.worlds.world.parameters
    learning, parameters = learning_row(car), np.zeros(1, CAR)
    parameters[0] = astuple(car)
    read, ticks = env.episodes.observer.read, []
    env.episodes.observer.read = lambda which, ranges, odometry, *rest, **more: (
        ticks.append(odometry.copy()), read(which, ranges, odometry, *rest, **more)
    )[1]  # fmt: skip
    seen, _ = env.reset(seed=0)
    for step in range(30):
        seen = env.step(np.tile((0.02 * (-1) ** step, 1.0 + 0.1 * step), (2, 1)).astype(np.float32))[0]
    learned = np.zeros(2, LEARNED)
    for odometry in ticks:
        for car_of_it in range(2):
            learn(learning[0], learned[car_of_it], parameters[0], odometry[car_of_it], 0.025)
    expected = np.stack([learned[name] for name in ("mu", "mean", "deviation", "held")], axis=1)
    assert len(ticks) == 61 and (learned["mean"] > 0.0).all() and (learned["held"] > 0.05).all()
    np.testing.assert_array_equal(seen["friction"], expected.astype(np.float32))
    seen, _ = env.reset(options={"reset_mask": np.array([True, False])})
    assert seen["friction"][0].tolist() == [np.float32(0.4), 0.0, 0.0, 0.0]
    assert seen["friction"][1, 1] > 0.0


def test_the_car_that_learns_is_in_the_interface():
    interface = F1TenthVectorEnv(1, observation="friction,speed").policy_interface
    described = json.loads(json.dumps(interface.described(), allow_nan=False))
    assert PolicyInterface.read(described) == interface and interface.parameters.mass == PARAMETERS.mass
    assert "parameters" not in F1TenthVectorEnv(1).policy_interface.described()
    del described["parameters"]
    with pytest.raises(fg.SettingsError, match="accepted: the car's parameters where friction is observed"):
        PolicyInterface.read(described)


@given(target=st.tuples(ANGLES, SPEEDS), wanted=st.tuples(ANGLES, SPEEDS), normalised=st.booleans())
def test_rates_lead_to_a_command_or_as_near_as_a_tick_allows(target, wanted, normalised):
    bounds = ActionBounds(PARAMETERS, (-1.5, 8.0), normalised=normalised, action="steering_rate,acceleration")
    reader, every = ActionReader(bounds, 1), np.ones(1, np.bool_)
    odometry = np.zeros(1, ODOMETRY)
    odometry["steering_angle"], odometry["speed"] = target
    reader.sense(odometry, every)
    least, greatest = (-PARAMETERS.max_steering_angle, -1.5), (PARAMETERS.max_steering_angle, 8.0)
    held = np.clip(target, least, greatest)
    most = np.array((PARAMETERS.max_steering_rate, PARAMETERS.max_acceleration)) * 0.025
    commands = np.zeros((1, 2))
    reader.read(reader.towards(np.array([wanted])), every, commands, np.zeros(1, np.int64))
    expected = np.clip(np.clip(wanted, held - most, held + most), least, greatest)
    np.testing.assert_allclose(commands[0], expected, atol=1e-6)


@pytest.mark.parametrize("normalised", [False, True])
def test_an_action_that_is_the_command_itself_is_that_of_the_planner(normalised):
    reader = ActionReader(ActionBounds(PARAMETERS, (0.0, 8.0), normalised=normalised), 2)
    commands, every = np.zeros((2, 2)), np.ones(2, np.bool_)
    wanted = np.array([(0.1, 3.0), (-0.2, 11.0)])
    reader.read(reader.towards(wanted), every, commands, np.zeros(2, np.int64))
    np.testing.assert_allclose(commands, [(0.1, 3.0), (-0.2, 8.0)], atol=1e-6)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--teacher", "stepps=5"], "did you mean 'steps'?"),
        (["--teacher", "steps=0"], "steps is 0"),
        (["--teacher", "planner=3"], "planner is 3; accepted: the name or the path of a planner"),
        (["--teacher", "policy_turn=0"], "Teacher.policy_turn is 0; accepted: a positive number"),
        (["--teacher", "steps=5", "--env", "observation=speed"], "teacher with the observation 'speed'; accepted:"),
        (["--teacher", "steps=5", "--ppo", "normalise_observation=true"], "teacher with normalise_observation"),
    ],
)
def test_a_teacher_that_cannot_teach_is_refused(options, said, tmp_path, capsys):
    assert said in refused(tmp_path, capsys, "train", "--out", str(tmp_path / "first"), *options)


def test_the_latency_of_a_world_is_that_of_its_lidar_and_of_its_servos():
    env = F1TenthVectorEnv(4, randomize={"command_delay": (0.0, 0.02), "lidar_latency": (0.0, 0.06)})
    env.reset(seed=3)
    facts, worlds = env.episodes.facts(), env.episodes.worlds
    np.testing.assert_allclose(worlds.late, np.ceil(facts["drawn_lidar_latency"] / 0.025 - 1e-9) * 0.025)
    np.testing.assert_allclose(worlds.command_delays, facts["drawn_command_delay"])
    assert len(np.unique(worlds.command_delays)) == 4
    fixed = F1TenthVectorEnv(1, effects={"latency": 0.03}, changes={"command_delay": 0.01})
    assert (fixed.episodes.worlds.late, fixed.episodes.worlds.command_delays) == (0.05, 0.01)


@pytest.fixture
def teaching():
    pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed")
    from fg_mujoco.addons.learn import teaching

    return teaching


def test_planners_are_told_what_holds_in_each_world(teaching):
    from fg_mujoco.addons.learn.stable_baselines3_env import F1TenthVecEnv

    drawn = {"mu": (0.5, 1.1), "command_delay": (0.0, 0.02)}
    env = F1TenthVecEnv(3, threads=1, observation="speed,flat", randomize=drawn)
    env.seed(4)
    env.reset()
    teachers = teaching.Teachers("gap_finder", env, 8.0)
    facts = env.envs.episodes.facts()
    told = np.array([each[0] for each in teachers._planners])
    np.testing.assert_allclose(told[:, 0], facts["drawn_mu"], atol=0.01)
    np.testing.assert_allclose(told[:, 2], facts["drawn_command_delay"], atol=1e-3)
    assert (told[:, 0] <= facts["drawn_mu"]).all() and not told[:, 1].any() and len(np.unique(told)) == 7
    commands = teachers.commands()
    assert commands.shape == (3, 2) and (commands[:, 1] > 0.0).all()
    assert not env.envs.episodes.worlds.engine.commands.any()  # nobody has driven yet


def test_a_policy_that_was_taught_answers_as_the_planner(teaching, tmp_path):
    from fg_mujoco.addons.learn.training import train

    told = []
    environment = {"track": "oval", "observation": "beams:54,speed,command,flat,normalised", "randomize": {},
                   "privileged": "mu", "action": "steering,speed", "time_limit": 20.0}  # fmt: skip
    teacher = {"steps": 12_000, "critic_steps": 256, "passes": 4.0}
    ppo = {"n_steps": 32, "minibatches": 2, "net": (32,)}
    training = train(tmp_path / "taught", environment=environment, teacher=teacher, ppo=ppo, worlds=8, steps=256,
                     watch=told.append)  # fmt: skip
    taught = [each.figures["teacher/loss"] for each in told if "teacher/loss" in each.figures]
    assert training.steps == 256 and 0.0 < taught[-1] < 0.1
    first, last = sorted((tmp_path / "taught/checkpoints").iterdir())
    actors = [read_policy(path) for path in (first, last)]
    seen = np.full(actors[0].interface.observer().bounds.low.shape, 0.3, np.float32)
    np.testing.assert_array_equal(actors[0].act(seen), actors[1].act(seen))  # only the critic has learned since
    race = fg.race("oval", str(tmp_path / "taught"), time_limit=2.0)
    assert race.car.mean_speed_m_s > 2.0
