"""The Gymnasium environment is a race seen through Gymnasium's interface."""

import copy
import math
import pickle
import warnings

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.random_obstacles import CLEAR_AHEAD, CLEAR_BEHIND
from fg_mujoco.envs.actions import ActionBounds
from fg_mujoco.envs.observation_description import DEFAULT_OBSERVATION
from fg_mujoco.envs.observer import Observer
from fg_mujoco.envs.rewards import Rewards
from fg_mujoco.envs.starts import draw_start
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.messages import ODOMETRY
from fg_mujoco.native import core
from fg_mujoco.vehicle.car import car_parameters

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from fg_mujoco.envs.gym_environment import ID, F1TenthEnv  # noqa: E402

DM_ENV = "fg_mujoco.envs.dm_environment"

CAR = car_parameters(fg.World("oval").model, "car/")


@pytest.fixture
def env():
    made = F1TenthEnv(beam_step=10)
    yield made
    made.close()


DRAWN = {
    "track": ["oval", "random:0:2"], "builds": 2,
    "randomize": {"mu": (0.5, 1.1), "lidar_noise": 0.01, "obstacles": (0, 3)},
}  # fmt: skip


@each("settings", [{}, {"beam_step": 20, "normalised_actions": True, "track": "scene:dead_end:1"}, DRAWN])
def test_env_checker_of_gymnasium_finds_nothing(settings):
    made = gymnasium.make(ID, **settings)
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        check_env(made.unwrapped, skip_render_check=True)  # test_rendering has it
    texts = [str(warning.message) for warning in found]
    advice = [] if "beam_step" in settings else ["symmetric and normalized"]  # for who wants it, `normalised_actions`
    assert len(texts) == len(advice) and all(part in text for part, text in zip(advice, texts, strict=True)), texts


def observer(step):
    """The observer of the default observation, with every so many-th beam."""
    bounds = ActionBounds(CAR)
    beams = LidarModel.load().beams
    return Observer(DEFAULT_OBSERVATION, CAR, beams, 0.025, beam_step=step, actions=(bounds.low, bounds.high))


@each("step", [1, 2, 7, 10, 45, 540])
def test_beams_seen_are_symmetric_about_the_one_straight_ahead(step):
    bearings = observer(step).bearings
    assert np.abs(bearings).min() < 1e-9
    np.testing.assert_allclose(bearings, -bearings[::-1], atol=1e-9)
    assert len(bearings) == 2 * (540 // step) + 1


def test_what_is_no_distance_reads_within_the_bounds():
    layout = observer(270)
    ranges = np.full((1, 1081), 5.0)
    ranges[0, [0, 270, 540, 810]] = math.inf, -math.inf, math.nan, 29.0
    odometry = np.zeros(1, ODOMETRY)
    odometry["speed"], odometry["linear_acceleration"] = 99.0, -1e3
    seen = layout.read(np.ones(1, bool), ranges, odometry)
    assert seen["scan"].tolist() == [[30.0, 0.0, 0.0, 29.0, 5.0]]
    assert seen["speed"][0] == layout.bounds["speed"].high
    assert (seen["acceleration"][0] == layout.bounds["acceleration"].low).all()


def test_actions_out_of_bounds_are_held_within_them_and_counted(env):
    start = {"start": {"s": 1.0}}
    env.reset(options=start)
    for action in ([9.0, 2.0], [-math.inf, 2.0], [0.1, 2.0]):
        *_, info = env.step(np.array(action))
    assert info["clipped_actions"] == 2
    held, *_ = env.step(np.array([0.0, 1e9]))
    env.reset(options=start)
    for action in ([0.4189, 2.0], [-0.4189, 2.0], [0.1, 2.0], [0.0, 20.0]):
        same, *_, info = env.step(np.array(action))
    assert info["clipped_actions"] == 0
    assert held["scan"].tobytes() == same["scan"].tobytes()


@each("compiled", [True, False])
@each(("bounded", "slid"), [(True, [0.075, 0.009, 0.0]), (False, [0.075, 0.06, 0.0375])])
def test_reward_is_the_sum_of_its_four_terms(compiled, bounded, slid):
    """Sliding takes at most nine tenths of the progress: of 0.2, 0.01 and -0.4; the last car was not driven."""
    given = Rewards(progress=2.0, collision=5.0, sliding=3.0, impact=0.5, bounded=bounded)
    driven, crashed = np.array([True, True, True, False]), np.array([False, False, True, True])
    progress, before, rewards = np.array([4.1, 4.005, 3.8, 9.0]), np.full(4, 4.0), np.full(4, 7.0)
    terms = np.full((2, 4, 4), 1.0)
    core.reward_ticks(
        driven, progress, before, crashed, np.array([1.0, 0.8, 0.5, 1.0]), np.full(4, 3.0), given.of_tick(0.025),
        given.share, compiled, rewards, terms,
    )  # fmt: skip
    if not compiled:  # there are other terms, which are summed with these
        core.sum_terms(driven, np.array([False, False, True, False]), given.share, rewards, terms)
    np.testing.assert_allclose(rewards, [0.2 - slid[0], 0.01 - slid[1], -0.4 - 5.0 - 1.5 - slid[2], 7.0])
    assert before.tolist() == [4.1, 4.005, 3.8, 4.0]
    ticks = np.array([[0.2, 0.01, -0.4], [0.0, 0.0, -5.0], [-each for each in slid], [0.0, 0.0, -1.5]])
    np.testing.assert_allclose(terms[0], np.column_stack((ticks, np.ones(4))))
    np.testing.assert_allclose(terms[1], np.column_stack((1.0 + ticks, np.ones(4))))


def test_random_starts_are_free_and_all_over_the_lap():
    world = fg.World("chicanes", obstacles=fg.race("chicanes", laps=1, obstacles=3, time_limit=0.05).world.obstacles)
    rng, length = np.random.default_rng(0), world.track.length
    boxes, _ = world.track.project([box.corners().mean(axis=0) for box in world.obstacles])
    simulation = fg.Simulation(world)
    starts = [draw_start(world, rng) for _ in range(40)]
    for start in starts:
        ahead = (boxes - start.s) % length
        assert (ahead >= CLEAR_AHEAD).all() and (ahead <= length - CLEAR_BEHIND).all()
        simulation.reset(**vars(start))
        assert not simulation.crashed
    assert np.ptp([start.s for start in starts]) > 0.7 * length
    assert np.ptp([start.offset for start in starts]) > 0.1


AWAY, HOME = np.array([0.1, 3.0]), np.array([0.0, 1.0])
FACES = {  # how it is made, what a reset and a step return
    "gymnasium": (
        lambda: gymnasium.make(ID, beam_step=60, start="line"),
        lambda env: env.reset(seed=1)[0], lambda env, action: env.step(action)[0],
    ),
    "vector": (
        lambda: gymnasium.make_vec(ID, num_envs=2, beam_step=60, start="line"),
        lambda env: env.reset(seed=1)[0], lambda env, action: env.step(np.tile(action, (2, 1)))[0],
    ),
    "parallel": (
        lambda: fg.parallel_env(2, beam_step=60, start="line"),
        lambda env: env.reset(seed=1)[0], lambda env, action: env.step(dict.fromkeys(env.agents, action))[0],
    ),
    "dm_env": (
        lambda: pytest.importorskip(DM_ENV, exc_type=ImportError).load("oval", seed=1, beam_step=60),
        lambda env: env.reset().observation, lambda env, action: env.step(action).observation,
    ),
}  # fmt: skip


def all_numbers(seen):
    parts = [all_numbers(part) for part in seen.values()] if isinstance(seen, dict) else [np.ravel(seen)]
    return np.concatenate(parts).astype(float)


@each("how", ["copy", "pickle"])
@each("face", FACES)
def test_a_copied_environment_is_a_new_one_that_drives_apart(face, how):
    make, reset, step = FACES[face]
    first, other = make(), make()
    for env in (first, other):
        reset(env), step(env, AWAY)
    again = copy.deepcopy(first) if how == "copy" else pickle.loads(pickle.dumps(first))
    assert np.array_equal(all_numbers(reset(again)), all_numbers(reset(make())))
    assert getattr(again, "spec", None) == getattr(first, "spec", None)
    for _ in range(10):
        moved = step(again, AWAY)
    own, undisturbed = step(first, HOME), step(other, HOME)
    assert np.array_equal(all_numbers(own), all_numbers(undisturbed))
    assert not np.array_equal(all_numbers(own), all_numbers(moved))


def test_a_copy_draws_from_the_ranges_that_were_set_last():
    env = F1TenthEnv(beam_step=60, randomize={"mu": (0.9, 1.0)})
    env.set_randomization({"mu": (0.4, 0.41)})
    copied = copy.deepcopy(env)
    assert copied.reset(seed=1)[1]["drawn_mu"] == env.reset(seed=1)[1]["drawn_mu"] < 0.42


@each("how", [copy.copy, copy.deepcopy, pickle.dumps])
def test_what_holds_addresses_is_not_copied(how):
    world = fg.World("oval")
    simulation = fg.Simulation(world)
    for held in (simulation, simulation.engine, simulation.engine._batches[0]._table):
        with pytest.raises(TypeError, match=f"{type(held).__name__} cannot be copied"):
            how(held)
    with pytest.raises(TypeError, match="cannot be copied"):
        copy.deepcopy(simulation.engine._batches[0])


@each("on_contact", ["stop", "continue"])
def test_a_car_that_touches_a_wall_drives_on(on_contact):
    """It stands there at once, or comes off as it may; each touch costs once; then it reverses."""
    env = F1TenthEnv(beam_step=540, start="line", on_contact=on_contact, rewards={"collision": 7.0, "impact": 1.0})
    env.reset(seed=0)
    speeds, touches = [], []
    for command in [[0.0, 4.0]] * 120 + [[0.0, -1.0]] * 60:
        seen, _, terminated, truncated, info = env.step(np.array(command))
        assert not terminated and not truncated
        speeds.append(float(seen["speed"][0]))
        if info["reward_collision"] < 0.0:
            assert info["reward_collision"] == -7.0 and -4.1 < info["reward_impact"] < -3.9 + 4.0 * len(touches)
            touches.append(len(speeds) - 1)
    assert info["contacts"] == len(touches) >= 1 and speeds[touches[0] - 1] > 3.9 and speeds[-1] < -0.5
    if on_contact == "stop":
        assert speeds[touches[0]] == 0.0 and len(touches) == 1
    else:
        assert speeds[touches[0]] > 2.0  # of its wheels
    assert env.reset(seed=0)[1]["contacts"] == 0


@each("on_contact", ["end", "stop", "continue"])
def test_a_car_that_hits_a_wall_among_others_is_rewarded_as_alone(on_contact):
    settings = {"beam_step": 540, "rewards": "no_slide", "on_contact": on_contact}
    among = F1TenthEnv(opponents=[lambda seen: np.zeros(2)], start="line", **settings)
    among.reset(seed=0)
    offset = float(among._world.monitor.timers["offset"][0])
    alone = F1TenthEnv(start={"offset": offset}, **settings)
    alone.reset(seed=0)
    terms, ended = [f"reward_{name}" for name in ("progress", "collision", "sliding", "impact", "slip")], False
    while not ended and alone._world.times[0] < 1.0:
        steps = [env.step(np.array([0.25, 4.0])) for env in (alone, among)]
        assert steps[0][2] == steps[1][2]
        ended = steps[0][2]
        for name in terms:
            assert steps[1][4][name] == pytest.approx(steps[0][4][name], abs=1e-4), name
    assert alone._info()["return_impact"] < -1.0


def test_a_stopped_car_stops_no_other():
    fast = {"opponents": [lambda seen: np.array([0.0, 4.0])], "grid_order": "reversed"}
    env = F1TenthEnv(beam_step=540, start="line", on_contact="stop", **fast)
    env.reset(seed=0)
    engine = env._world.engine
    while not env._world.contacts.counts[1]:  # the opponent, which starts in front, at the wall
        env.step(np.array([0.0, 1.5]))
    assert engine.speed(1) == 0.0 and engine.speed(0) > 1.4
