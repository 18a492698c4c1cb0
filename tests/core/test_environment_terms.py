"""Reward terms, end conditions and observations: what each is, and that all environments have them."""

import math

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.envs import rewards
from fg_mujoco.envs.end_conditions import END_CONDITIONS, EndCondition, end_condition
from fg_mujoco.envs.observations import OBSERVATIONS, SENSED, ObservationTerm, observation
from fg_mujoco.envs.rewards import REWARDS, reward
from fg_mujoco.envs.tick_state import Ground, SensedState, Snapshot, TickState
from fg_mujoco.racing.resolved import Ground as CourseGround

gymnasium = pytest.importorskip("gymnasium")

from fg_mujoco.envs.gym_environment import ID, F1TenthEnv  # noqa: E402

WORLD = fg.World("oval")
CAR, PERIOD = WORLD.parameters, 0.025
TERMS = REWARDS.names()  # the bundled ones: other tests register theirs
PARTS = [name for name in OBSERVATIONS.names() if name != "planner_command"]  # which needs a residual
CONDITIONS = END_CONDITIONS.names()
OTHERS = [name for name in TERMS if name not in ("progress", "collision", "sliding", "impact")]
ALL = {
    "rewards": dict.fromkeys(OTHERS, 1.0) | {"bounded": False},
    "observation": list(PARTS),
    "end_conditions": list(CONDITIONS),
}
STAND = np.zeros(2)


def state(before=None, **now):
    """A state of three cars, made by hand; what is not given is that of a car that stands at the start."""

    def arrays(given):
        plain = {name: np.zeros(3) for name in ("time", "progress", "place", "offset", "sliding")}
        plain |= {name: np.zeros(3, bool) for name in ("crashed", "rolled_over", "finished")}
        plain |= {"laps": np.zeros(3, int), "touches": np.zeros(3, int), "position": np.ones(3, int)}
        plain |= {"pose": np.zeros((3, 3)), "velocity": np.zeros((3, 3)), "command": np.zeros((3, 2))}
        plain |= {"lead": np.full(3, math.inf), "mu": np.ones(3), "action": np.zeros((3, 2)), "slip_speed": np.zeros(3)}
        return plain | {name: np.array(value) for name, value in given.items()}

    own = {"ground": Ground(WORLD), "car": CAR}
    return TickState(**own, **arrays(now), before=Snapshot(**own, **arrays(before or {})), period=PERIOD)


HEADING = WORLD.track.start_pose(0.0)[2]
BY_HAND = {
    "progress": (state(progress=[1.0, 2.0, 3.0], before={"progress": [0.5, 2.5, 3.0]}), [0.5, -0.5, 0.0]),
    "collision": (state(crashed=[True, False, False], rolled_over=[True, True, False]), [-1.0, -1.0, 0.0]),
    "impact": (
        state(crashed=[True, False, False], rolled_over=[False, True, False],
              before={"velocity": [[3.0, 4.0, 9.0], [-2.0, 0.0, 0.0], [1.0, 1.0, 1.0]]}),
        [-5.0, -2.0, 0.0],
    ),
    "sliding": (state(sliding=[0.0, 0.4, 1.0]), [0.0, -0.01, -0.025]),
    "slip": (state(slip_speed=[0.0, 1.0, 2.0]), [0.0, -0.025, -0.05]),
    "action_rate": (
        state(action=[[1.0, 0.0], [0.5, 0.5], [0.1, 0.2]], before={"action": [[-1.0, 0.0], [0.0, 0.5], [0.1, 0.2]]}),
        [-4.0, -0.25, 0.0],
    ),
    "survival": (state(), [0.025] * 3),
    "time": (state(), [-0.025] * 3),
    "lap": (state(laps=[1, 2, 0], before={"laps": [0, 2, 0]}), [1.0, 0.0, 0.0]),
    "speed": (state(velocity=[[2.0, 9.0, 9.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), [0.05, -0.025, 0.0]),
    "drift": (  # half of the angle at half of the speed; in full, to the right; too little
        state(velocity=[
            [1.25 * math.cos(0.425), 1.25 * math.sin(0.425), 0.0], [2.0, -3.0 - CAR.rear_axle_distance, 1.0],
            [3.0, 0.7, 0.0],
        ]),
        [0.25 * PERIOD, PERIOD, 0.0],
    ),
    "command_rate": (
        state(
            command=[[CAR.max_steering_angle, 0.0], [0.0, 2.5], [0.1, 1.0]],
            before={"command": [[-CAR.max_steering_angle, 0.0], [0.0, 0.0], [0.1, 1.0]]},
        ),
        [-4.0, -0.04, 0.0],  # the car's speeds are from -5 to 20 m/s
    ),
    "heading_error": (
        state(pose=[[0.0, 0.0, HEADING + 0.1], [0.0, 0.0, HEADING - 0.2], [0.0, 0.0, HEADING + 2.0 * math.pi]]),
        [-0.0025, -0.005, 0.0],
    ),
    "cross_track_error": (state(offset=[0.2, -0.4, 0.0]), [-0.005, -0.01, 0.0]),
    "overtaking": (state(position=[1, 3, 2], before={"position": [3, 2, 2]}), [2.0, -1.0, 0.0]),
    "car_contact": (state(touches=[1, 3, 2], before={"touches": [0, 1, 2]}), [-1.0, -2.0, 0.0]),
}


@each("name", BY_HAND)
def test_a_reward_term_is_its_closed_form(name):
    made, expected = BY_HAND[name]
    np.testing.assert_allclose(REWARDS.find(name)(made), expected, atol=1e-12)


def test_a_car_that_slides_is_paid_for_drifting_and_one_that_grips_is_not():
    """Where the tires hold less than the drive gives: full throttle in a bend, off it, again; a circle at 5 m/s^2."""
    def seconds(commands):
        env = F1TenthEnv(track="open_ground:8", observation="speed", rewards="drift", mu=0.6)
        env.reset(seed=0)
        for step in range(320):
            *_, info = env.step(np.array(commands[step % len(commands)]))
            assert 0.0 <= info["reward_drift"] <= PERIOD
        return info["return_drift"]

    assert seconds([(0.3, 10.0)] * 20 + [(0.3, 0.0)] * 8) > 1.2
    assert seconds([(0.2, 2.9)]) < 0.05


def test_near_wall_costs_all_of_the_time_at_the_wall_and_nothing_at_its_limit():
    x, y, heading = WORLD.track.start_pose(0.0)
    middle = state(pose=[[x, y, heading]] * 3).wall_distance[0]
    left = np.array([-math.sin(heading), math.cos(heading)])
    places = [(*(np.array([x, y]) + (middle - gap) * left), heading) for gap in (0.15, 0.3, -0.01)]
    near = state(pose=places)
    np.testing.assert_allclose(near.wall_distance, [0.15, 0.3, 0.0], atol=5e-3)
    expected = -PERIOD * np.maximum(1.0 - near.wall_distance / rewards.NEAR_WALL, 0.0)
    assert expected[1] == 0.0 and expected[2] == -PERIOD
    np.testing.assert_allclose(REWARDS.find("near_wall")(near), expected)


@each("name", [name for name in PARTS if name not in (*SENSED, "slip")])
def test_a_bundled_observation_is_a_quantity_of_the_state(name):
    made = state(
        pose=[[0.0, 0.0, 0.3]] * 3, velocity=[[1.0, 0.2, 3.0]] * 3, offset=[0.3, -9.0, 0.0], command=[[0.1, 2.0]] * 3,
    )  # fmt: skip
    attribute = {"cross_track_error": "offset"}.get(name, name)
    np.testing.assert_array_equal(OBSERVATIONS.find(name).function(made), getattr(made, attribute))
    term = OBSERVATIONS.find(name)
    read = term.read(made, term.bounds_of(CAR))
    assert read.dtype == np.float32 and read.shape == (3, {"command": 2, "pose": 3, "curvature": 3}.get(name, 1))
    if name == "cross_track_error":
        assert read.ravel().tolist() == [np.float32(0.3), -5.0, 0.0]


def test_slip_is_the_speed_of_each_axle_across_its_wheels():
    """Of a car that turns about a point on the left, 2 m from the rear axle; its front wheels point 0.1 rad too far."""
    right = math.atan(CAR.wheelbase / 2.0)
    made = state(velocity=[[1.0, 0.0, 0.5], [1.0, 0.2, 0.5], [1.0, 0.0, 0.5]])
    angles = np.array([right, right, right + 0.1])
    fields = {name: getattr(made, name) for name in made.__dataclass_fields__}
    odometry = np.zeros(3, fg.messages.ODOMETRY)
    odometry["steering_angle"] = angles
    found = OBSERVATIONS.find("slip").function(SensedState(**fields, ranges=np.zeros((3, 1)), odometry=odometry))
    front = math.hypot(1.0, 0.5 * CAR.wheelbase)
    expected = [[0.0, 0.0], [0.2 * math.cos(right), 0.2], [-front * math.sin(0.1), 0.0]]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_curvature_is_that_of_the_course_ahead():
    """The oval's straights turn by nothing, its bends by 1 / radius; by half where 1 of 2 m ahead are in one."""
    ahead = state(place=[0.0, 0.0, 0.0]).ground.curvatures(np.linspace(0.0, WORLD.track.length, 2001)[:-1], (1.0,))
    assert np.mean(ahead) == pytest.approx(2.0 * math.pi / WORLD.track.length, rel=1e-3)  # a lap is one turn
    first, second = (WORLD.track.start_pose(s)[2] for s in (3.0, 4.0))
    found = state(place=[3.0] * 3).curvature[0, 0]
    assert found == pytest.approx(math.remainder(second - first, 2.0 * math.pi), abs=0.05)


def test_conditions_hold_where_they_say():
    turned = state(pose=[[0.0, 0.0, HEADING + angle] for angle in (1.5, 1.6, -3.0)])
    assert END_CONDITIONS.find("turned_round").holds(turned).tolist() == [False, True, True]
    assert END_CONDITIONS.find("touched_car").holds(state(touches=[0, 1, 2])).tolist() == [False, True, True]


def actions(ticks, seed=0):
    """Actions of a car that winds along, some of them out of bounds."""
    rng = np.random.default_rng(seed)
    return [np.array([0.25 * math.sin(0.3 * tick), 2.0 + rng.uniform(-1.0, 1.0)]) for tick in range(ticks)]


@each("track", ["oval", "scene:crossing_box:1"])
def test_a_driven_state_is_that_of_the_simulation(track):
    """By other ways: the pose of a Simulation, projected on the course; clearances as a comparison has them."""
    names = ["heading_error", "cross_track_error", "wall_distance", "lateral_speed", "command"]
    env = F1TenthEnv(track=track, start="line", observation=names, rewards=ALL["rewards"])
    env.reset(seed=0)
    simulation = fg.Simulation(fg.World(track))
    simulation.reset()
    course, ground = simulation.world.track, CourseGround(simulation.world.track)
    path = turned = 0.0
    for action in actions(30):
        before = simulation.pose
        simulation.step(fg.DriveCommand(steering_angle=float(action[0]), speed=float(action[1])))
        seen, _, _, _, info = env.step(action)
        x, y, heading = simulation.pose
        (s,), (offset,) = course.project([[x, y]])
        error = (heading - course.start_pose(s - (course.origin or 0.0))[2] + math.pi) % (2.0 * math.pi) - math.pi
        times, poses = np.array([info["time_s"]]), np.array([simulation.pose])
        distance = ground.least_clearance(times, poses, simulation.world.parameters)
        path += math.hypot(x - before[0], y - before[1])
        turned += PERIOD * abs(error)
        assert seen["cross_track_error"].item() == pytest.approx(offset, abs=1e-6)
        assert seen["heading_error"].item() == pytest.approx(error, abs=0.02)  # in a corner the line is a polygon
        assert seen["wall_distance"].item() == pytest.approx(min(distance, 5.0), abs=1e-6)
        assert seen["command"].tolist() == action.astype(np.float32).tolist()
        assert abs(seen["lateral_speed"].item()) < 0.3
    late = 0.5 * info["reward_speed"]  # a sum of the speeds at the ends of the ticks, from a standing start
    assert info["return_speed"] - late == pytest.approx(path, rel=0.01)
    assert info["return_survival"] == -info["return_time"] == pytest.approx(info["time_s"])
    assert info["return_heading_error"] == pytest.approx(-turned, abs=0.02)


def test_terms_sum_up_to_the_reward_and_their_sums_to_the_return():
    env = F1TenthEnv(start="line", beam_step=540, rewards=ALL["rewards"])
    for _ in range(2):  # nothing is left of an episode in the next
        _, info = env.reset(seed=0)
        assert not any(value for name, value in info.items() if name.startswith(("reward_", "return_")))
        sums, terminated = dict.fromkeys(TERMS, 0.0), False
        while not terminated:
            _, value, terminated, _, info = env.step(np.array([0.3, 3.0]))
            assert value == pytest.approx(sum(info[f"reward_{name}"] for name in TERMS), abs=1e-12)
            sums = {name: total + info[f"reward_{name}"] for name, total in sums.items()}
            assert sums == {name: info[f"return_{name}"] for name in TERMS}
        assert info["end_reason"] == "crash" and info["return_collision"] == -10.0
        assert info["return_progress"] == pytest.approx(info["progress_m"])


def told_by_gym(settings, commands):
    env = gymnasium.make(ID, disable_env_checker=True, start="line", **settings)
    rows = [env.reset(seed=0)[::-1]]
    for command in commands:
        seen, value, terminated, truncated, info = env.step(command)
        rows.append((info | {"reward": value}, seen))
        if terminated or truncated:
            break
    return rows


def told_by_dm_env(settings, commands):
    pytest.importorskip("dm_control", reason="there is no dm_control for this Python")
    from fg_mujoco.envs.dm_environment import load

    env = load("oval", laps=1, start="line", **settings)
    step = env.reset()
    episodes = env.task.episodes
    rows = [(episodes.facts_of(0), step.observation)]
    for command in commands:
        step = env.step(command)
        ending = episodes.ending(0) if step.last() else {}
        rows.append((episodes.facts_of(0) | {"reward": step.reward} | ending, step.observation))
        assert {name: values[0] for name, values in episodes.facts().items()} == episodes.facts_of(0)
        if step.last():
            break
    return rows


def told_by_pettingzoo(settings, commands):
    pytest.importorskip("pettingzoo")
    env = fg.parallel_env(agents=1, start="line", **settings)
    seen, infos = env.reset(seed=0)
    rows = [(infos["car_0"], seen["car_0"])]
    for command in commands:
        seen, values, _, _, infos = env.step({"car_0": command})
        rows.append((infos["car_0"] | {"reward": values["car_0"]}, seen["car_0"]))
        if not env.agents:
            break
    return rows


@each("told", [told_by_dm_env, told_by_pettingzoo])
def test_all_doors_tell_the_same(told):
    @reward
    def mine_at_all_doors(state):
        return state.yaw_rate * state.period

    far = EndCondition(name="far", function=lambda state: np.abs(state.offset) > 0.3, outcome="truncated")
    settings = {
        "beam_step": 60,
        "rewards": ALL["rewards"] | {"mine_at_all_doors": 0.5, "other": (lambda state: state.lateral_speed, 2.0)},
        "observation": ALL["observation"],
        "end_conditions": ["turned_round", far],
    }
    commands = [np.array([0.2, 2.0])] * 100
    expected, found = told_by_gym(settings, commands), told(settings, commands)
    assert len(expected) == len(found) < 100
    for (info, seen), (other_info, other_seen) in zip(expected, found, strict=True):
        lap_times = [values.pop("lap_times_s", None) for values in (info, other_info)]
        assert (lap_times[0] is None) == (lap_times[1] is None)
        assert info == other_info
        assert {name: values.tobytes() for name, values in seen.items()} == {
            name: np.ascontiguousarray(other_seen[name]).tobytes() for name in seen
        }
    assert info["end_reason"] == "far" and info["return_mine_at_all_doors"] != 0.0 != info["return_other"]


def test_the_first_condition_that_holds_is_the_reason_and_the_races_own_come_before():
    def at(seconds, outcome):
        return lambda name: EndCondition(name=name, function=lambda s: s.time > seconds - 0.01, outcome=outcome)

    late, later = at(0.1, "truncated"), at(0.1, "terminated")
    for listed, reason, outcome in (
        ([late("a"), later("b")], "a", (False, True)),
        ([later("b"), late("a")], "b", (True, False)),
    ):
        env = F1TenthEnv(beam_step=540, end_conditions=listed)
        env.reset(seed=0)
        for tick in range(1, 5):
            _, _, *ended, info = env.step(STAND)
            assert any(ended) == (tick == 4)
        assert (tuple(ended), info["end_reason"]) == (outcome, reason)
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(STAND)
        env.reset()
        assert not any(env.step(STAND)[2:4])
    env = F1TenthEnv(beam_step=540, time_limit=0.1, end_conditions=[late("a")])
    env.reset(seed=0)
    infos = [env.step(STAND)[4] for _ in range(4)]
    assert infos[-1]["end_reason"] == "time_limit"


def test_own_terms_are_registered_by_their_functions_names():
    @reward
    def mine_rewarded(state):
        return state.speed

    @end_condition("truncated")
    def mine_ends(state):
        return state.time > 0.03

    @observation((0.0, 1.0))
    def mine_seen(state):
        return state.ranges[:, 540] / 30.0

    assert REWARDS.find("mine_rewarded") is mine_rewarded
    assert (END_CONDITIONS.find("mine_ends"), OBSERVATIONS.find("mine_seen")) == (mine_ends, mine_seen)
    env = F1TenthEnv(rewards={"mine_rewarded": 1.0}, end_conditions=["mine_ends"], observation=["mine_seen", "scan"])
    seen, _ = env.reset(seed=0)
    assert seen["mine_seen"].item() == pytest.approx(seen["scan"][540] / 30.0)
    env.step(STAND)
    *_, truncated, info = env.step(STAND)
    assert truncated and info["end_reason"] == "mine_ends"
    seen, _ = env.reset()
    assert seen["mine_seen"].item() == pytest.approx(seen["scan"][540] / 30.0)  # what is sensed now
    for decorate, name in ((reward, "progress"), (end_condition("truncated"), "turned_round")):
        taken = type(mine_ends.function)(mine_rewarded.__code__, {}, name)
        with pytest.raises(fg.SettingsError, match="bundled one; accepted: another name"):
            decorate(taken)


@each(
    ("settings", "match"),
    [
        ({"rewards": {"mine": (lambda state: state.pose, 1.0)}}, r"'mine' returned .*shape \(1,\)"),
        ({"rewards": {"mine": (lambda state: 1.0, 1.0)}}, "one number for each car"),
        ({"rewards": {"mine": (lambda state: state.lead, 1.0)}}, "'mine' is inf for car 0 of 1"),
        ({"end_conditions": [EndCondition(name="mine", function=lambda s: s.speed, outcome="truncated")]}, "one bool"),
        (
            {"observation": [ObservationTerm(name="mine", function=lambda s: s.pose, bounds=(0.0, 1.0))]},
            r"'mine' returned .*shape \(1, 1\)",
        ),
    ],
)
def test_what_a_function_must_not_return_is_refused(settings, match):
    env = F1TenthEnv(beam_step=540, **settings)
    with pytest.raises(fg.SettingsError, match=match):
        env.reset(seed=0), env.step(STAND)
