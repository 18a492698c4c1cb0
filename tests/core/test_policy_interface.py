"""What a policy sees and answers: parts with options, actions, and a planner that has the environment's bits."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from driven_environments import commands_of_ticks
from fg_mujoco.envs.observation_description import even_beams
from fg_mujoco.envs.observations import ObservationTerm
from fg_mujoco.envs.policy_interface import PolicyInterface
from fg_mujoco.errors import MessageError

pytest.importorskip("gymnasium")

from fg_mujoco.envs.gym_environment import F1TenthEnv
from fg_mujoco.envs.gym_vector import F1TenthVectorEnv

CAR = fg.World("oval").parameters
ISSUE = "beams:108,history:3,speed,steering,previous_action"


def bits(seen):
    """Return all bits of an observation."""
    return b"".join(each.tobytes() for each in seen.values()) if isinstance(seen, dict) else seen.tobytes()


def weaving(action):
    """Return a policy that answers pseudo-random actions about `action`, and keeps what it saw."""
    kept, rng = [], np.random.default_rng(5)

    def policy(seen):
        kept.append(bits(seen))
        return (np.asarray(action) + rng.uniform(-0.3, 0.3, 2)).astype(np.float32)

    return policy, kept


class Driven:
    """A planner that is a policy; keeps its commands."""

    def __init__(self, interface, policy):
        self.driver, self.policy, self.commands = interface.driver(), policy, []

    def reset(self):
        self.driver.reset()

    def __call__(self, scan, odometry):
        self.commands.append(self.driver.drive(self.policy, scan, odometry))
        return self.commands[-1]


@each(
    ("action", "settings"),
    [
        ((0.0, 1.5), {"beam_step": 60}),
        ((0.0, 1.5), {"observation": f"{ISSUE},command,normalised,flat", "smoothing": 0.1}),
        (
            (0.0, 0.4),
            {
                "observation": "beams:20:max=5,yaw_rate,acceleration,wheel_speeds,previous_action,history:2,flat",
                "action": "steering_rate,acceleration", "normalised_actions": True, "action_repeat": 3,
                "effects": {"latency": 0.05}, "sensors": ["imu"],
            },
        ),
    ],
    ids=["default", "issue", "rates"],
)  # fmt: skip
def test_a_policy_drives_a_race_with_the_bits_of_the_environment(action, settings):
    env = F1TenthEnv(track="hairpins", start="line", **settings)
    policy, seen = weaving(action)
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    commands = commands_of_ticks(env)
    while len(commands) < 30:
        observation, _, terminated, _, _ = env.step(policy(observation))
        assert not terminated
    interface = PolicyInterface.read(json.loads(json.dumps(env.policy_interface.described())))
    assert interface == env.policy_interface
    policy, seen_in_race = weaving(action)
    planner = Driven(interface, policy)
    of_car = {name: settings[name] for name in ("effects", "sensors", "mu") if name in settings}
    fg.race("hairpins", planner, time_limit=0.74, **of_car)
    driven = np.array([[command.steering_angle, command.speed] for command in planner.commands])
    assert len(driven) == 30 and driven.tobytes() == np.array(commands[:30]).tobytes()
    assert seen_in_race == seen[: len(seen_in_race)] and len(seen_in_race) == 30 // env.policy_interface.action_repeat


@each("chosen", [1, 2, 3, 20, 108, 109, 540, 1080, 1081])
def test_beams_are_even_and_the_same_on_both_sides(chosen):
    seen = even_beams(1081, chosen)
    assert len(set(seen.tolist())) == chosen and (seen + seen[::-1] == 1080).all()
    if chosen > 1:
        assert (seen[0], seen[-1]) == (0, 1080)
        assert np.ptp(np.diff(seen)) <= 2  # rounded to whole beams, and mirrored
    if chosen == 109:
        np.testing.assert_array_equal(seen, np.arange(0, 1081, 10))  # as beam_step=10


def test_history_delay_scale_and_order_are_those_of_the_plain_parts():
    """By hand, from the parts that an environment without them returns."""
    settings = {"start": "line", "action_repeat": 2}
    plain = F1TenthEnv(observation="speed,steering,beams:5", **settings)
    ticks = F1TenthEnv(observation="speed", start="line")
    text = "speed:delay=0.06,beams:5:max=3,steering,previous_action,history:3,normalised,flat"
    env = F1TenthEnv(observation=text, **settings)
    rng, rows, speeds = np.random.default_rng(0), [], []
    seen = plain.reset(seed=0)[0], env.reset(seed=0)[0]
    speeds.append(ticks.reset(seed=0)[0]["speed"])
    last = np.zeros(2)
    for _ in range(8):
        scan = np.minimum(seen[0]["scan"], np.float32(3.0))
        scan /= 1.0 + scan
        delayed = speeds[max(len(speeds) - 1 - 3, 0)]  # 0.06 s are 3 ticks
        limits = np.float32(CAR.max_steering_angle), np.float32(20.0)
        rows.append(np.concatenate((delayed / 10.0, scan, seen[0]["steering_angle"] / limits[0], last / limits)))
        stacked = np.concatenate([rows[max(len(rows) - 1 - k, 0)] for k in (2, 1, 0)])
        np.testing.assert_allclose(seen[1], stacked, rtol=3e-7, atol=1e-9)
        last = rng.uniform((-0.2, 1.0), (0.2, 3.0)).astype(np.float32)
        for _ in range(2):
            speeds.append(ticks.step(last)[0]["speed"])
        seen = plain.step(last)[0], env.step(last)[0]
    assert env.observation_space.contains(seen[1]) and env.observation_space.shape == (27,)


def test_a_part_has_a_history_of_its_own():
    """By hand: three speeds that are four steps apart beside the scan of the present, in both forms."""
    settings = {"start": "line", "action_repeat": 2}
    plain = F1TenthEnv(observation="beams:5,speed,yaw_rate", **settings)
    text = "beams:5,speed:history=3:every=4,yaw_rate:history=1,history:2"
    flat, parts = (F1TenthEnv(observation=text + form, **settings) for form in (",flat", ""))
    envs, rng, rows = (plain, flat, parts), np.random.default_rng(0), []
    seen = [env.reset(seed=0)[0] for env in envs]
    for step in range(14):
        if step == 11:
            rows, seen = [], [env.reset(seed=1)[0] for env in envs]
        rows.append(seen[0])
        speeds = [rows[max(len(rows) - 1 - k, 0)]["speed"] for k in (8, 4, 0)]
        scans = [rows[max(len(rows) - 1 - k, 0)]["scan"] for k in (1, 0)]
        np.testing.assert_array_equal(seen[1], np.concatenate([*scans, *speeds, seen[0]["yaw_rate"]]))
        np.testing.assert_array_equal(seen[2]["speed"], speeds)
        np.testing.assert_array_equal(seen[2]["scan"], scans)
        np.testing.assert_array_equal(seen[2]["yaw_rate"], seen[0]["yaw_rate"])
        action = rng.uniform((-0.2, 1.0), (0.2, 3.0)).astype(np.float32)
        seen = [env.step(action)[0] for env in envs]
    assert flat.observation_space.contains(seen[1]) and flat.observation_space.shape == (14,)
    assert flat.policy_interface.described()["observation"] == text + ",flat"


def test_noise_is_drawn_from_the_seed_and_the_same_in_any_batch():
    settings = {"beam_step": 540, "start": "line", "observation": "speed:noise=0.1,steering,scan:noise=0.5,flat"}
    env = F1TenthVectorEnv(3, threads=1, **settings)
    clean = F1TenthEnv(**settings | {"observation": "speed,steering,scan,flat"})
    alone = F1TenthEnv(**settings)
    found, own = [env.reset(seed=4)[0]], [alone.reset(seed=5)[0]]
    true = [clean.reset(seed=5)[0]]
    for _ in range(60):
        found.append(env.step(np.tile(np.float32((0.0, 1.0)), (3, 1)))[0])
        own.append(alone.step((0.0, 1.0))[0])
        true.append(clean.step((0.0, 1.0))[0])
    assert np.array(found)[:, 1].tobytes() == np.array(own).tobytes()
    noise = np.array(own) - np.array(true)
    assert (noise[:, 1] == 0.0).all()
    assert 0.07 < noise[:, 0].std() < 0.13 and 0.3 < noise[:, 3].std() < 0.7  # three deviations of 61 draws
    assert (np.array(found)[:, 0, 0] != np.array(found)[:, 1, 0]).all()


def test_privileged_terms_are_a_vector_of_their_own():
    """A critic sees them normalised like the rest; those of the scan stay what they are."""
    settings = {"start": {"s": 4.0, "offset": 0.2}, "mu": 0.7, "tires": "coulomb",
                "privileged": "pose,offset,curvature,slip,mu"}
    env = F1TenthEnv(observation="beams:9,speed,flat", **settings)
    seen, _ = env.reset(seed=0)
    assert env.observation_space.contains(seen) and list(seen) == ["observation", "privileged"]
    assert seen["privileged"][3] == pytest.approx(0.2, abs=1e-6) and seen["privileged"][-1] == pytest.approx(0.7)
    assert seen["privileged"].shape == (10,)
    other, _ = F1TenthEnv(observation="beams:9,speed,normalised", **settings).reset(seed=0)
    assert list(other) == ["scan", "speed", "privileged"]
    np.testing.assert_allclose(other["privileged"][:2], seen["privileged"][:2] / 10.0, rtol=1e-6)
    with pytest.raises(fg.SettingsError, match=r"pose, cross_track_error, .* accepted: scan"):
        env.policy_interface.driver()
    assert replace(env.policy_interface, privileged=()).driver() is not None  # the actor alone


@each("normalised", [False, True])
@each("action", ["steering,speed", "steering_rate,acceleration", "steering_rate,speed"])
def test_actions_are_integrated_and_filtered_within_the_cars_limits(action, normalised):
    """By hand; the car starts rolling, so that an integrated speed begins there."""
    env = F1TenthEnv(
        start={"s": 2.0, "speed": 1.2}, beam_step=540, action=action, normalised_actions=normalised, smoothing=0.1,
        action_repeat=2, speed_range=(0.0, 2.0),
    )  # fmt: skip
    env.reset(seed=0)
    commands = commands_of_ticks(env)
    least = np.array([-CAR.max_steering_angle, 0.0])
    greatest = np.array([CAR.max_steering_angle, 2.0])
    rates = np.array([CAR.max_steering_rate, CAR.max_acceleration])
    integrated = ["_rate" in action, "acceleration" in action]
    target, share = np.array([0.0, 1.2]), 1.0 - math.exp(-0.025 / 0.1)
    command, expected = target, []
    low, high = np.where(integrated, -rates, least), np.where(integrated, rates, greatest)
    for given in ([1.0, 1.0], [1.0, 1.0], [0.2, -1.0], [-1.0, 0.4], [-1.0, 0.0]):
        meant = low + 0.5 * (np.array(given) + 1.0) * (high - low)
        env.step(np.array(given) if normalised else meant)
        for _ in range(2):
            asked = np.clip(target + 0.025 * meant, least, greatest)
            target = np.where(integrated, asked, meant)
            command = command + share * (target - command)
            expected.append(command)
    np.testing.assert_allclose(commands, expected, atol=1e-6)


@each("others", [{}, {"opponents": ["gap_finder"], "grid_order": "reversed"}], ids=["alone", "two"])
def test_a_repeated_action_sums_the_rewards_of_its_ticks_and_ends_with_the_tick_that_ends(others):
    weights = {"survival": 1.0, "command_rate": 1.0, "slip": 1.0}
    settings = {"start": {"s": 4.0}, "beam_step": 90, "rewards": weights, **others}
    one, three = F1TenthEnv(**settings), F1TenthEnv(action_repeat=3, **settings)
    one.reset(seed=0), three.reset(seed=0)
    crashing = np.array([0.4, 4.0])
    terminated, sums = False, dict.fromkeys(("reward_survival", "reward_command_rate", "reward_progress"), 0.0)
    while not terminated:
        seen, reward, terminated, _, info = three.step(crashing)
        total, ticks = 0.0, 0
        sums = dict.fromkeys(sums, 0.0)
        while ticks < 3:
            tick_seen, of_tick, over, _, tick_info = one.step(crashing)
            total, ticks = total + of_tick, ticks + 1
            sums = {name: value + tick_info[name] for name, value in sums.items()}
            if over:
                break
        assert over == terminated and reward == pytest.approx(total, rel=1e-12) and bits(seen) == bits(tick_seen)
        assert sums == pytest.approx({name: info[name] for name in sums}, abs=1e-12)
        assert info["time_s"] == tick_info["time_s"] and info["return_survival"] == pytest.approx(info["time_s"])
    assert (info["end_reason"] == "crash" and ticks < 3) or info["time_s"] > 0.0


ANOTHER = ObservationTerm(name="another", function=len, bounds=(0.0, 1.0))


def test_a_planner_refuses_what_its_policy_was_not_trained_with():
    env = F1TenthEnv(observation="beams:9,speed", sensors=["imu"])
    driver = env.policy_interface.driver()
    simulation = fg.Simulation(fg.World("oval"))
    scan, odometry = simulation.reset()
    with pytest.raises(MessageError, match="'imu' of 6 values, and the car has no such sensor; accepted"):
        driver.observe(scan, odometry)
    half = replace(scan, ranges=scan.ranges[:540])
    with pytest.raises(MessageError, match=r"540 beams from -135.0 to -0.2 deg; accepted: .* 1081 beams"):
        driver.observe(half, odometry)
    with pytest.raises(MessageError, match="accepted: an action, two numbers"):
        F1TenthEnv().policy_interface.driver().drive(lambda seen: [1.0], scan, odometry)
    with pytest.raises(fg.SettingsError, match="observes another, which a car does not sense"):
        F1TenthEnv(observation=["scan", ANOTHER]).policy_interface.driver()
    described = env.policy_interface.described()
    with pytest.raises(fg.SettingsError, match="did you mean 'observation'"):
        PolicyInterface.read(described | {"observations": 1})
    del described["beams"]
    with pytest.raises(fg.SettingsError, match="without beams"):
        PolicyInterface.read(described)
