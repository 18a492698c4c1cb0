"""The vector environment tells what single environments tell, bit for bit, in the form of Gymnasium's SyncVectorEnv."""

import numpy as np
import pytest

from cases import each

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.vector import AutoresetMode, SyncVectorEnv  # noqa: E402

from fg_mujoco.envs.environment_settings import EnvironmentSettings  # noqa: E402
from fg_mujoco.envs.gym_environment import F1TenthEnv  # noqa: E402
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv  # noqa: E402

WORLDS = 4
NOISE = {"range_noise_std": 0.02, "dropout_probability": 0.02, "latency": 0.025}
SETTINGS = {"beam_step": 30, "speed_range": (-1.0, 5.0), "time_limit": 1.2}


@pytest.fixture(scope="module", autouse=True)
def worlds_built_once():
    """What is simulated reads a compiled world and does not write to it."""
    make, made = EnvironmentSettings.make_world, {}

    def once(*arguments):
        if repr(arguments) not in made:
            made[repr(arguments)] = make(*arguments)
        return made[repr(arguments)]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(EnvironmentSettings, "make_world", once)
        yield


def vector(count=WORLDS, **settings):
    return F1TenthVectorEnv(count, **SETTINGS | settings)


def singles(mode=AutoresetMode.NEXT_STEP, count=WORLDS, max_episode_steps=None, **settings):
    def make():
        env = F1TenthEnv(**SETTINGS | settings)
        return env if max_episode_steps is None else gymnasium.wrappers.TimeLimit(env, max_episode_steps)

    return SyncVectorEnv([make] * count, autoreset_mode=mode)


def assert_same(first, second, where=""):
    """Same types, shapes and bits, all the way down."""
    assert type(first) is type(second), where
    if isinstance(first, dict):
        assert first.keys() == second.keys(), where
        for name in first:
            assert_same(first[name], second[name], f"{where}/{name}")
    elif isinstance(first, tuple):
        assert len(first) == len(second)
        for i, pair in enumerate(zip(first, second, strict=True)):
            assert_same(*pair, f"{where}/{i}")
    elif isinstance(first, np.ndarray):
        assert (first.dtype, first.shape) == (second.dtype, second.shape), where
        if first.dtype == object:
            for i, pair in enumerate(zip(first, second, strict=True)):
                assert_same(*pair, f"{where}/{i}")
        else:
            assert first.tobytes() == second.tobytes(), where
    else:
        assert first == second, where


def drive(envs, mode, steps, seed=3, action_seed=0):
    """Return all that an environment tells in so many steps of actions that make the cars crash, now and then."""
    told = [envs.reset(seed=seed)]
    rng = np.random.default_rng(action_seed)
    ends = 0
    for _ in range(steps):
        actions = np.column_stack((rng.uniform(-0.5, 0.5, WORLDS), rng.uniform(1.0, 7.0, WORLDS))).astype(np.float32)
        step = envs.step(actions)
        told.append(step)
        over = step[2] | step[3]
        ends += int(over.sum())
        if mode is AutoresetMode.DISABLED and over.any():
            told.append(envs.reset(options={"reset_mask": over}))
    envs.close()
    return told, ends


DRAWN = {
    "mu": (0.5, 1.1), "mass": (3.3, 4.2), "cog_height": (0.06, 0.09), "steering_gain": (0.8, 1.2),
    "speed_gain": (0.8, 1.2), "command_delay": (0.0, 0.04), "lidar_noise": (0.0, 0.02), "lidar_dropout": (0.0, 0.02),
    "lidar_latency": (0.0, 0.05), "odometry_drift": (-0.02, 0.02), "start_speed": (0.0, 2.0),
    "start_offset": (-0.2, 0.2), "obstacles": (0, 3), "patches": (0, 2), "patch_mu": (0.3, 0.6),
    "vehicle": ["f1tenth"], "tires": ["coulomb", "forzaeth_sim"],
}  # fmt: skip
CASES = {
    "drawn anew": (AutoresetMode.SAME_STEP, {"track": ["oval", "random:0:3"], "builds": 3, "randomize": DRAWN}),
    "next step": (AutoresetMode.NEXT_STEP, {}),
    "same step": (AutoresetMode.SAME_STEP, {}),
    "disabled": (AutoresetMode.DISABLED, {}),
    "noise, normalised": (AutoresetMode.SAME_STEP, {"effects": NOISE, "normalised_actions": True}),
    "boxes, narrow track": (AutoresetMode.NEXT_STEP, {"track": "chicanes", "obstacles": 3, "mu": 0.8}),
    "opponents": (AutoresetMode.SAME_STEP, {"opponents": ["gap_finder"], "grid_order": "random"}),
    "max steps": (AutoresetMode.SAME_STEP, {"max_episode_steps": 13}),
    "chosen terms": (
        AutoresetMode.NEXT_STEP,
        {
            "rewards": {"command_rate": 0.1, "near_wall": 1.0, "heading_error": 1.0},
            "observation": ["scan", "command", "wall_distance", "heading_error"],
            "end_conditions": ["turned_round"],
        },
    ),
    "a policy's view": (
        AutoresetMode.SAME_STEP,
        {
            "observation": "scan,speed:noise=0.1:delay=0.03,previous_action,history:3,flat,normalised",
            "privileged": "mu,slip,curvature", "action": "steering_rate,acceleration", "smoothing": 0.05,
            "action_repeat": 2, "rewards": "smooth",
        },
    ),
    "stop at walls": (AutoresetMode.SAME_STEP, {"track": "chicanes", "on_contact": "stop", "effects": NOISE}),
    "one crash ends all": (AutoresetMode.NEXT_STEP, {"opponents": ["straight"], "ended_by": "any"}),
    "drive on until all end": (
        AutoresetMode.SAME_STEP,
        {"opponents": ["straight"], "ended_by": "all", "on_contact": "continue", "action_repeat": 2},
    ),
    "moving boxes": (AutoresetMode.NEXT_STEP, {"track": "scene:crossing_box:1", "max_episode_steps": 29}),
}


@pytest.mark.slow
@each("case", CASES)
def test_worlds_tell_what_single_environments_tell(case):
    mode, settings = CASES[case]
    together, ends = drive(vector(autoreset_mode=mode, **settings), mode, 60)
    alone, _ = drive(singles(mode, **settings), mode, 60)
    assert ends >= 2  # or nothing began anew
    for step, (first, second) in enumerate(zip(together, alone, strict=True)):
        assert_same(first, second, f"step {step}")


def test_unstable_world_ends_and_begins_anew_as_if_new():
    """A physics that broke down leaves nothing in its world, and the others do not notice."""
    envs, others = vector(3), vector(3)
    envs.reset(seed=0), others.reset(seed=0)
    actions = np.tile([0.1, 2.0], (3, 1))
    envs.step(actions), others.step(actions)
    envs._worlds.engine.state(1)[1:10] = np.nan  # time comes first, then positions
    *_, terminated, _, infos = envs.step(actions)
    others.step(actions)
    assert terminated.tolist() == [False, True, False]
    assert infos["end_reason"].tolist() == [None, "unstable", None]
    again, fresh = envs.step(actions), vector(3)
    fresh.reset(seed=0)
    seen = fresh.reset()[0]  # world 1 begins its second episode
    assert again[0]["scan"][1].tobytes() == seen["scan"][1].tobytes()
    calm = others.step(actions)
    for _ in range(10):
        assert again[0]["scan"][[0, 2]].tobytes() == calm[0]["scan"][[0, 2]].tobytes()
        again, calm, new = envs.step(actions), others.step(actions), fresh.step(actions)
        assert again[0]["scan"][1].tobytes() == new[0]["scan"][1].tobytes()
        assert again[1][1] == new[1][1]


@each("settings", [{}, {"rewards": "no_slide", "observation": "scan,command,curvature"}, {"action_repeat": 3},
                   {"on_contact": "stop", "track": "chicanes", "rewards": "no_slide"}])
def test_the_native_core_alone_does_what_it_does_with_python_in_between(settings):
    """A hook that does nothing makes the engine step by step; in one thread and in two."""
    def drive(threads, hooked):
        envs = vector(9, threads=threads, **settings)
        engine = envs._worlds.engine
        engine.after_substep += [lambda engine, worlds: None] * hooked
        told, rng = [envs.reset(seed=1)], np.random.default_rng(0)
        assert engine.compiled is not hooked
        for _ in range(60):
            told.append(envs.step(rng.uniform((-0.4, 0.0), (0.4, 5.0), (9, 2))))
        assert any(step[3].any() for step in told[1:])
        return tuple(told)

    expected = drive(1, True)
    assert_same(drive(1, False), expected)
    assert_same(drive(2, False), expected)


def test_a_car_that_has_crashed_and_waits_is_terminated_where_its_episode_is_cut_off():
    settings = {"start": "line", "ended_by": "all", "opponents": ["straight"], "beam_step": 540}
    envs = F1TenthVectorEnv(2, max_episode_steps=60, **settings)
    envs.reset(seed=0)
    ends = [envs.step(np.array([[0.4, 4.0], [0.0, 1.0]]))[2:4] for _ in range(60)]
    assert not any(over.any() for step in ends[:-1] for over in step)
    assert [over.tolist() for over in ends[-1]] == [[True, False], [True, True]]


def test_stepping_what_does_not_run_is_refused():
    envs = vector(2, autoreset_mode="Disabled", max_episode_steps=1)
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"\[0, 1\]"):
        envs.step(np.zeros((2, 2)))
    envs.reset()
    envs.step(np.zeros((2, 2)))
    envs.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"\[1\]"):
        envs.step(np.zeros((2, 2)))


@pytest.mark.slow
def test_pictures_of_a_batch_are_those_of_single_environments():
    pytest.importorskip("mujoco.egl")
    settings = {"track": "oval", "camera": "32x24", "observation": "speed,flat"}
    envs, alone = F1TenthVectorEnv(2, **settings), F1TenthEnv(**settings)
    together, single = [envs.reset(seed=4)[0]], [alone.reset(seed=5)[0]]
    assert alone.observation_space.contains(single[0]) and alone.observation_space["camera"].shape == (24, 32, 3)
    for _ in range(3):
        together.append(envs.step(np.tile([0.2, 6.0], (2, 1)))[0])
        single.append(alone.step(np.array([0.2, 6.0]))[0])
    for both, own in zip(together, single, strict=True):
        assert both["camera"][1].tobytes() == own["camera"].tobytes() != both["camera"][0].tobytes()
    assert single[0]["camera"].tobytes() != single[-1]["camera"].tobytes()
    envs.close(), alone.close()
