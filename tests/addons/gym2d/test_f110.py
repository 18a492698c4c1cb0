"""The interface of f1tenth_gym v0.2: a script written to it laps a map here."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cases import each
from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.gym2d import gym_world
from fg_mujoco.course.maps.map_track import read_map
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.simulation.cars import first_overlap
from fg_mujoco.simulation.world import LIDAR_PREFIX
from lidar_worlds import mujoco_rays
from map_oracles import draw_map, ring

KEYS = {"ego_idx", "scans", "poses_x", "poses_y", "poses_theta", "linear_vels_x", "linear_vels_y", "ang_vels_z",
        "collisions", "lap_times", "lap_counts"}  # fmt: skip


class WaypointFollower:
    """Pure pursuit, written to the interface and to nothing else."""

    def __init__(self, waypoints, *, speed=3.0, lookahead=0.9, wheelbase=0.33):
        self.waypoints, self.speed, self.lookahead, self.wheelbase = waypoints, speed, lookahead, wheelbase

    def plan(self, obs):
        x, y, theta = obs["poses_x"][0], obs["poses_y"][0], obs["poses_theta"][0]
        distance = np.hypot(*(self.waypoints - (x, y)).T)
        ahead = np.roll(np.arange(len(distance)), -int(np.argmin(distance)))
        goal = self.waypoints[ahead[np.argmax(distance[ahead] >= self.lookahead)]]
        aside = math.cos(theta) * (goal[1] - y) - math.sin(theta) * (goal[0] - x)
        return np.array([[math.atan(2.0 * self.wheelbase * aside / self.lookahead**2), self.speed]])


def first_pose(waypoints):
    (x, y), (next_x, next_y) = waypoints[:2]
    return np.array([[x, y, math.atan2(next_y - y, next_x - x)]])


def drive(env, waypoints, **settings):
    """Run the loop of a script; return the observations."""
    planner = WaypointFollower(waypoints, **settings)
    obs, reward, done, info = env.reset(first_pose(waypoints))
    observed, time = [obs], reward
    while not done and time < 200.0:
        obs, reward, done, info = env.step(planner.plan(obs))
        observed.append(obs)
        time += reward
    return observed, time, done, info


@pytest.fixture
def drawn(tmp_path):
    draw_map(tmp_path, ring())
    return tmp_path / "drawn"


@pytest.mark.slow
@each("backwards", [False, True])
def test_a_waypoint_follower_laps_a_map_in_either_direction(backwards, drawn):
    waypoints = read_map(f"{drawn}.yaml").centreline
    waypoints = waypoints[::-1] if backwards else waypoints
    env = f110.make("f110_gym:f110-v0", map=str(drawn), map_ext=".png", num_agents=1)
    observed, time, done, info = drive(env, waypoints, speed=4.0)
    last = observed[-1]
    assert done and info["checkpoint_done"].tolist() == [True]
    assert last["lap_counts"].tolist() == [2.0]
    assert last["collisions"].tolist() == [0.0]
    assert last["lap_times"][0] == pytest.approx(time) == pytest.approx(2 * 29.2 / 4.0, rel=0.1)
    counts = [obs["lap_counts"][0] for obs in observed]
    assert sorted(counts) == counts


@each("name, steps", [("drawn", 60), ("scene:crossing_box:2", 60)])
def test_a_scan_is_what_single_rays_measure_along_its_beams(name, steps, drawn, monkeypatch):
    monkeypatch.setattr(gym_world, "SCAN_NOISE", 0.0)
    env = f110.make(map=str(drawn) if name == "drawn" else name)
    obs, *_ = env.reset(np.array([[7.5, 2.25, 0.1]] if name == "drawn" else [[0.0, 0.1, 0.05]]))
    bearings = np.linspace(-2.35, 2.35, 1080)
    beams = replace(LidarModel.load().beams, bearings=bearings, origins=np.zeros((1080, 3)),
                    directions=np.column_stack((np.cos(bearings), np.sin(bearings), np.zeros(1080))))  # fmt: skip
    body = LIDAR_PREFIX + LidarModel.load().body
    for step in range(steps):
        obs, *_ = env.step(np.array([[0.2 * math.sin(0.1 * step), 2.0]]))
        ranges = np.clip(mujoco_rays(env.world.model, env.data, beams, body), 0.0, beams.range_max)
        np.testing.assert_allclose(obs["scans"][0], ranges, rtol=0.0, atol=1e-9)


def test_noise_is_that_of_the_published_generator_to_the_bit(drawn, monkeypatch):
    pose, rng = np.array([[7.5, 2.25, 0.0]]), np.random.default_rng(5)
    noisy = f110.make(map=str(drawn), seed=5).reset(pose)[0]["scans"][0]
    monkeypatch.setattr(f110.gym_world, "SCAN_NOISE", 0.0)
    plain = f110.make(map=str(drawn), seed=5).reset(pose)[0]["scans"][0]
    np.testing.assert_array_equal(noisy, np.clip(plain + rng.normal(0.0, 0.01, 1080), 0.0, 10.0))


def test_velocities_are_in_the_frame_of_the_car(drawn):
    env = f110.make(map=str(drawn))
    obs, *_ = env.reset(np.array([[7.0, 2.25, 0.0]]))
    before = obs
    for _ in range(60):
        before, (obs, *_) = obs, env.step(np.array([[0.15, 1.5]]))
    moved = np.array([obs[name][0] - before[name][0] for name in ("poses_x", "poses_y")]) / 0.01
    heading = 0.5 * (obs["poses_theta"][0] + before["poses_theta"][0])
    ahead = moved @ (math.cos(heading), math.sin(heading))
    aside = moved @ (-math.sin(heading), math.cos(heading))
    assert obs["linear_vels_x"][0] == pytest.approx(ahead, abs=0.03)
    assert obs["linear_vels_y"][0] == pytest.approx(aside, abs=0.03)
    assert obs["ang_vels_z"][0] == pytest.approx((obs["poses_theta"][0] - before["poses_theta"][0]) / 0.01, abs=0.05)
    assert obs["ang_vels_z"][0] > 0.3


def test_a_collision_ends_an_episode_and_a_reset_begins_another(drawn):
    env = f110.make(map=str(drawn))
    _, _, done, _ = env.reset(np.array([[7.5, 2.25, -0.5 * math.pi]]))
    assert not done
    while not done:
        obs, _, done, _ = env.step(np.array([[0.0, 2.0]]))
    assert obs["collisions"].tolist() == [1.0] and obs["lap_counts"].tolist() == [0.0]
    obs, _, done, _ = env.reset(np.array([[7.5, 2.25, 0.0]]))
    assert not done and obs["collisions"].tolist() == [0.0]


def run(env, poses, actions):
    """The observations of a reset and of some steps, until one is done."""
    obs, _, done, _ = env.reset(poses)
    observed = [obs]
    for action in actions:
        if done:
            break
        obs, _, done, _ = env.step(np.array(action))
        observed.append(obs)
    return observed, done


def test_cars_see_each_other_where_they_are(drawn, monkeypatch):
    """The car behind sees the box of the car ahead: 0.12 m wide, its rear face 0.19 m behind that car's LiDAR."""
    monkeypatch.setattr(gym_world, "SCAN_NOISE", 0.0)
    env = f110.make(map=str(drawn), num_agents=2)
    obs, *_ = env.reset(np.array([[7.0, 2.25, 0.0], [8.5, 2.25, 0.0]]))
    alone = f110.make(map=str(drawn)).reset(np.array([[7.0, 2.25, 0.0]]))[0]["scans"][0]
    differ = np.flatnonzero(np.abs(obs["scans"][0] - alone) > 1e-6)
    bearings = np.linspace(-2.35, 2.35, 1080)[differ]
    lidar = 7.0 + 0.275
    rear = 8.5 + 0.275 - 0.19
    assert obs["scans"][0][540] == pytest.approx(rear - lidar, abs=0.005)
    assert np.abs(bearings).max() == pytest.approx(math.atan2(0.06, rear - lidar), abs=0.005)


@pytest.mark.slow
def test_cars_that_touch_have_collided_and_the_episode_ends_with_the_ego(drawn):
    """The last of three drives into the middle one; the first is out of it."""
    poses, actions = (np.array([[8.0, 2.1, 0.0], [7.0, 2.1, 0.0], [6.0, 2.1, 0.0]]),
                      [[[0.0, 0.0]] * 2 + [[0.0, 3.0]]] * 200)  # fmt: skip
    for ego, ends in ((0, False), (1, True), (2, True)):
        observed, done = run(f110.make(map=str(drawn), num_agents=3, ego_idx=ego), poses, actions[:60])
        assert done is ends
        touched = np.array([obs["collisions"] for obs in observed])
        assert touched.any(axis=0).tolist() == [False, True, True]
        assert not touched[0].any()


@pytest.mark.slow
def test_the_episode_is_done_when_all_cars_have_driven_two_laps(drawn):
    waypoints = read_map(f"{drawn}.yaml").centreline
    planners = [WaypointFollower(waypoints, speed=speed) for speed in (4.0, 3.0)]
    env = f110.make(map=str(drawn), num_agents=2)
    first = first_pose(waypoints)[0]
    behind = first_pose(np.roll(waypoints, len(waypoints) // 10, axis=0))[0]
    obs, _, done, info = env.reset(np.array([first, behind]))
    finished = [info["checkpoint_done"].tolist()]
    while not done:
        views = [{name: values[row : row + 1] for name, values in obs.items() if name != "ego_idx"} for row in (0, 1)]
        actions = [planner.plan(view) for planner, view in zip(planners, views, strict=True)]
        obs, _, done, info = env.step(np.concatenate(actions))
        finished.append(info["checkpoint_done"].tolist())
    assert [True, False] in finished and finished[-1] == [True, True]  # the quicker one first
    assert obs["lap_times"][0] < obs["lap_times"][1]
    assert obs["collisions"].tolist() == [0.0, 0.0]


@pytest.mark.slow
def test_a_car_drives_the_same_bits_with_others_far_away_and_its_noise_is_its_own(drawn, monkeypatch):
    monkeypatch.setattr(gym_world, "SCAN_NOISE", 0.0)
    pose, action = [7.0, 2.25, 0.0], [0.02, 2.0]
    pair, _ = run(f110.make(map=str(drawn), num_agents=2), np.array([pose, [9.5, 2.25, 0.0]]), [[action, action]] * 40)
    again, _ = run(f110.make(map=str(drawn), num_agents=2), np.array([pose, [9.5, 2.25, 0.0]]), [[action, action]] * 40)
    swapped, _ = run(f110.make(map=str(drawn), num_agents=2), np.array([[9.5, 2.25, 0.0], pose]),
                     [[action, action]] * 40)  # fmt: skip
    for name in KEYS - {"ego_idx"}:
        np.testing.assert_array_equal(pair[-1][name], again[-1][name])
        np.testing.assert_allclose(pair[-1][name], swapped[-1][name][::-1], rtol=0.0, atol=1e-6)
    monkeypatch.undo()
    scans = [f110.make(map=str(drawn), num_agents=2).reset(np.array([pose, [x, 2.25, 0.0]]))[0] for x in (9.5, 10.0)]
    quiet = pair[0]["scans"][0]
    one, two = scans[0]["scans"]
    assert np.std(one - quiet) == pytest.approx(gym_world.SCAN_NOISE, rel=0.2)
    alone = f110.make(map=str(drawn)).reset(np.array([pose]))[0]["scans"][0]
    behind = np.arange(1080) < 400  # where the other car is not seen
    np.testing.assert_array_equal(one[behind], alone[behind])
    assert np.abs((one - quiet) - (two - pair[0]["scans"][1]))[behind].max() > gym_world.SCAN_NOISE


@each("second", [(0.0, 0.0, 0.0), (0.2, 0.25, 1.5)])
def test_cars_that_are_placed_in_each_other_collide_at_once_and_come_apart(second):
    env = f110.make(map="oval", num_agents=3)
    poses = np.array([(2.0, 0.0, 0.0), np.add((2.0, 0.0, 0.0), second), (6.0, 0.0, 0.0)])
    with pytest.warns(UserWarning, match=r"poses of the cars 0 and 1 are .*, where they touch: they collide at once"):
        observation, _, done, _ = env.reset(poses)
    assert done
    assert observation["collisions"].tolist() == [1.0, 1.0, 0.0]
    for _ in range(100):
        env.step(np.zeros((3, 2)))
    ends = np.column_stack((env.poses_x, env.poses_y))
    assert np.hypot(*(ends[0] - ends[1])) > np.hypot(*second[:2])
    assert np.abs(ends - poses[:, :2]).max() < 3.0
    assert ends[2] == pytest.approx((6.0, 0.0), abs=1e-3)


def test_footprints_touch_where_mujoco_finds_contacts():
    """Random poses of two cars: whether they are refused is whether their chassis are in contact."""
    env, rng = f110.make(map="oval", num_agents=2), np.random.default_rng(0)
    found = []
    for _ in range(200):
        near = rng.uniform((-0.8, -0.8, -math.pi), (0.8, 0.8, math.pi))
        poses = np.array([[5.0, 0.0, 0.3], near + np.array([5.0, 0.0, 0.0])])
        overlap = first_overlap(poses, [car.parameters for car in env.world.cars]) is not None
        data = env.data
        for car, pose in zip(env.world.cars, poses, strict=True):
            car.set_pose(data, *pose)
        assert overlap == bool(data.sensor("car_0_touches_car_1").data[0] > 0.0), near
        found.append(overlap)
    assert 20 < sum(found) < 180


@each("tires", ["coulomb", "f1tenth_gym"])
@each("heading", [0.0, 0.7, 5.0])
def test_a_car_stands_where_a_reset_has_put_it(heading, tires, drawn):
    """It moved by 2 um in the step of the reset, on springs that had not come to rest, and by 17 um in 5 s."""
    env, pose = f110.make(map=str(drawn), num_agents=1, tires=tires), (7.5, 2.25, heading)
    observation = env.reset(np.array([pose]))[0]
    for _ in range(50):
        for name, wanted in zip(("poses_x", "poses_y", "poses_theta"), pose, strict=True):
            assert observation[name][0] == pytest.approx(wanted, abs=1e-10)
        assert abs(observation["linear_vels_x"][0]) < 1e-9  # a wound-up shaft relaxes: .3 nm/s
        observation = env.step(np.zeros((1, 2)))[0]


@each("timestep", [0.01, 0.002])
def test_linear_tires_keep_one_speed_in_a_bend_at_any_time_step(timestep, tmp_path):
    """From 2 ms down the speed swung by .03 to .04 m/s: what was missing was added by a share of each step."""
    angles = np.linspace(0.0, 2.0 * math.pi, 60, endpoint=False)
    rows = np.column_stack((30.0 * np.cos(angles), 30.0 * np.sin(angles), np.full((60, 2), 14.0)))
    np.savetxt(tmp_path / "plaza.csv", rows, delimiter=",", header="x_m, y_m, w_tr_right_m, w_tr_left_m")
    env = f110.make(map=str(tmp_path / "plaza.csv"), num_agents=1, timestep=timestep, tires="f1tenth_gym")
    env.reset(np.array([[30.0, 0.0, 0.5 * math.pi]]))
    driven = [env.step(np.array([[0.1, 4.0]]))[0]["linear_vels_x"][0] for _ in range(round(2.0 / timestep))]
    last = driven[-round(0.3 / timestep) :]
    assert max(last) - min(last) < 3e-3 and np.mean(last) == pytest.approx(3.997, abs=2e-3)
