"""Both interfaces of f1tenth_gym: what scripts read, write and ask for, beside driving."""

from __future__ import annotations

import copy
import math
import pickle
import warnings

import gymnasium
import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons import gym2d as f110
from fg_mujoco.addons.gym2d import gym_functions
from fg_mujoco.addons.gym2d.gym_world import LapCount
from fg_mujoco.addons.gym2d.params import F1FIFTH, F1TENTH, own_params
from fg_mujoco.errors import SettingsError, TrackError
from map_oracles import draw_map, ring

POSE = np.array([[7.5, 2.25, 0.0]])


@pytest.fixture
def drawn(tmp_path):
    draw_map(tmp_path, ring())
    return tmp_path / "drawn"


def new_env(drawn, **config):
    """An environment of v1.0 with one car on the drawn map."""
    return f110.make("f1tenth_gym:f1tenth-v0", config={"map": str(drawn), "num_agents": 1} | config)


def test_a_blank_map_is_the_ground_of_the_map_without_its_walls(drawn):
    turns = np.linspace(0.0, math.tau, 50, endpoint=False)
    rows = [f"{4.0 * turn}; {4.0 * math.cos(turn)}; {4.0 * math.sin(turn)}; 0; 0; 3; 0" for turn in turns]
    drawn.with_name("drawn_raceline.csv").write_text("\n".join(rows) + "\n")
    with pytest.warns(UserWarning, match=r"drawn_blank' is not there; open ground with the lines of .*drawn.yaml"):
        env = new_env(f"{drawn}_blank", observation_config={"type": "rl"}, scale=10.0)
    scan, _ = env.reset(seed=1)
    assert scan.min() > 25.0
    assert np.hypot(env.track.raceline.xs, env.track.raceline.ys) == pytest.approx(40.0, rel=1e-5)
    walled, _ = new_env(drawn, observation_config={"type": "rl"}).reset(seed=1)
    assert walled.min() < 5.0


# Parameters


def test_parameters_are_those_of_the_car_that_is_built():
    """Read back off the compiled world, which knows nothing of the gym's names."""
    for params in (F1TENTH, F1FIFTH, {"m": 4.5, "h": 0.09}, {"lf": 0.19, "lr": 0.17, "I": 0.06},
                   {"width": 0.25, "length": 0.5}, {"s_min": -0.3, "s_max": 0.3, "sv_min": -2.0, "sv_max": 2.0},
                   {"a_max": 5.0, "v_switch": 4.0, "v_max": 6.0}):  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            env = f110.make(map="oval", params=params)
        car = own_params(env.world.vehicle)
        for name, value in params.items():
            if name in car:
                assert car[name] == pytest.approx(value, rel=0.01), name
        assert env.world.car.mu == pytest.approx(params.get("mu", 1.0489))
    env.update_params({**F1TENTH, "mu": 0.5})
    assert env.world.car.mu == pytest.approx(0.5)


def test_cornering_stiffnesses_are_those_of_linear_tires():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = f110.make(map="oval", tires="f1tenth_gym", params={**F1TENTH, "C_Sf": 4.0, "C_Sr": 6.0})
    tires = env.world.tires
    assert (tires.front.lateral.stiffness, tires.rear.lateral.stiffness) == (4.0, 6.0)


@each("acceleration", [2.0, 5.0])
def test_the_car_accelerates_as_its_parameters_say(acceleration, drawn):
    env = f110.make(map=str(drawn), tires="coulomb", params={**F1TENTH, "a_max": acceleration})
    env.reset(POSE)
    for _ in range(10):
        obs, *_ = env.step(np.array([[0.0, 20.0]]))
    assert obs["linear_vels_x"][0] == pytest.approx(0.1 * acceleration, rel=0.02)


# What scripts read and write


def test_attributes_that_planners_read(drawn):
    env = f110.make(map=str(drawn), map_ext=".png", num_agents=2)
    env.reset(np.array([[8.0, 2.1, 0.0], [7.0, 2.4, 0.0]]))
    for _ in range(30):
        obs, *_ = env.step(np.array([[0.1, 2.0], [0.0, 1.0]]))
    state = env.sim.agents[0].state
    assert env.params["lf"] + env.params["lr"] == pytest.approx(0.3302)
    assert env.current_time == pytest.approx(0.31)
    assert state.shape == (7,)
    names = ("poses_x", "poses_y", "linear_vels_x", "poses_theta", "ang_vels_z")
    assert state[[0, 1, 3, 4, 5]].tolist() == pytest.approx([obs[name][0] for name in names])
    assert state[2] == pytest.approx(0.1, abs=0.01)
    assert math.tan(state[6]) == pytest.approx(obs["linear_vels_y"][0] / obs["linear_vels_x"][0])
    assert env.sim.agent_poses[:, 0].tolist() == env.poses_x == obs["poses_x"]
    assert env.start_xs.tolist() == [8.0, 7.0] and env.lap_counts.tolist() == [0.0, 0.0]
    assert env.render_obs["lap_times"][0] == env.lap_times[0] == pytest.approx(0.31)
    assert env.sim.agents[1].in_collision is False and env.sim.agents[1].opp_poses.shape == (1, 3)
    assert env.map_path == f"{drawn}.yaml" and env.renderer is None and env.unwrapped is env


def test_a_state_that_a_script_writes_is_where_the_car_goes_on(drawn):
    env = f110.make(map=str(drawn))
    env.reset(POSE)
    env.sim.agents[0].state[3] = 3.0
    obs, *_ = env.step(np.array([[0.0, 3.0]]))
    assert obs["linear_vels_x"][0] == pytest.approx(3.0, abs=0.05)
    assert obs["poses_x"][0] == pytest.approx(7.53, abs=0.005)
    env.sim.agents[0].state = np.array([8.0, 2.0, 0.0, 0.0, 0.5, 0.0, 0.0])
    obs, *_ = env.step(np.array([[0.0, 0.0]]))
    assert [obs[name][0] for name in ("poses_x", "poses_y", "poses_theta")] == pytest.approx([8.0, 2.0, 0.5], abs=1e-3)
    env = f110.make(map=str(drawn), tires="f1tenth_gym")  # whose poses are of the centre of gravity
    env.reset(POSE)
    written = [8.0, 2.0, 0.1, 3.0, 0.5, 1.2, 0.05]
    env.driving.put(0, written)
    assert env.driving.state(0).tolist() == pytest.approx(written, abs=1e-6)


def test_a_reset_without_poses_is_at_the_start_of_the_course(drawn):
    env = f110.make(map=str(drawn), num_agents=3)
    obs, _, done, _ = env.reset()
    x, y, heading = env.world.track.start_pose()
    assert not done and not obs["collisions"].any()
    assert (obs["poses_x"][0], obs["poses_y"][0]) == pytest.approx((x, y), abs=1e-3)
    behind = math.cos(heading) * (obs["poses_x"][1] - x) + math.sin(heading) * (obs["poses_y"][1] - y)
    assert behind == pytest.approx(-1.5, abs=0.1)


# Maps


def test_a_map_with_a_hole_is_driven_and_its_laps_count_at_the_start(tmp_path):
    free = ring()
    free[95:105, :40] = True  # an opening to the left, out of the course
    draw_map(tmp_path, free)
    with pytest.warns(UserWarning, match="driven as ground among walls, laps count at the start"):
        env = f110.make(map=str(tmp_path / "drawn"))
    obs, *_ = env.reset(POSE)
    laps = env.driving.laps[0]
    assert obs["scans"][0][np.argmin(np.abs(np.linspace(-2.35, 2.35, 1080) + 0.5 * math.pi))] < 2.0
    for x, y, completed in ((9.0, 2.25, 0), (9.0, 8.0, 0), (7.4, 2.2, 1), (9.0, 2.25, 1), (7.5, 2.25, 2)):
        laps.count(1.0, x, y)
        assert laps.completed == completed


# v1.0


def test_the_interface_is_gymnasiums(drawn):
    env = new_env(drawn)
    assert isinstance(env, gymnasium.Env)
    obs, info = env.reset(seed=1, options={"poses": POSE})
    obs, reward, terminated, truncated, info = env.step(env.action_space.sample())
    assert (reward, terminated, truncated) == (0.01, False, False) and info["checkpoint_done"].tolist() == [False]
    assert obs["poses_x"].dtype == np.float32 and obs["scans"].shape == (1, 1080)
    assert env.observation_space.contains(obs)
    assert env.action_space.low.tolist() == [[pytest.approx(-0.4189), -5.0]]
    assert env.render() is None and env.metadata["render_fps"] == 100


@each("kind, features",
      [("kinematic_state", ["pose_x", "pose_y", "delta", "linear_vel_x", "pose_theta"]),
       ("dynamic_state", ["pose_x", "pose_y", "delta", "linear_vel_x", "pose_theta", "ang_vel_z", "beta"]),
       ("direct", ["scan", "std_state", "state", "collision", "lap_time", "lap_count", "sim_time", "frenet_pose"])])
def test_observations_of_each_car_by_name(kind, features, drawn):
    env = new_env(drawn, num_agents=2, observation_config={"type": kind})
    obs, _ = env.reset(options={"poses": np.array([[8.0, 2.1, 0.1], [7.0, 2.4, 0.0]])})
    assert list(obs) == env.agent_ids == ["agent_0", "agent_1"]
    assert list(obs["agent_1"]) == features
    assert all(each.dtype == np.float32 for each in obs["agent_0"].values())
    if "pose_x" in features:
        assert obs["agent_0"]["pose_x"] == pytest.approx(8.0, abs=1e-3)
        assert obs["agent_0"]["pose_theta"] == pytest.approx(0.1, abs=1e-3)


@each("kind", [None, "rl_random_static", "cl_grid_static", "cl_random_random", "map_random_static"])
def test_a_reset_draws_poses_that_stand_apart_by_the_seed(kind, drawn):
    env = new_env(drawn, num_agents=3, reset_config={"type": kind})
    first, again, other = (env.reset(seed=seed)[0] for seed in (3, 3, 4))
    np.testing.assert_array_equal(first["poses_x"], again["poses_x"])
    assert not np.array_equal(first["poses_x"], other["poses_x"])
    assert not first["collisions"].any()


def test_environments_without_a_seed_begin_at_places_of_their_own(drawn):
    def places(**config):
        return [new_env(drawn, reset_config={"type": "rl_random_static"}, **config).reset()[0] for _ in range(2)]

    first, other = places()
    assert not np.array_equal(first["poses_x"], other["poses_x"])
    first, same = places(seed=5)
    np.testing.assert_array_equal(first["poses_x"], same["poses_x"])


def test_configuration_objects_are_the_settings(drawn):
    from fg_mujoco.addons.gym2d import gym_config

    settings = gym_config.EnvConfig(map_name=str(drawn), num_agents=2,
        params=gym_config.F1TENTH_VEHICLE_PARAMETERS.with_updates(mu=0.7),
        simulation_config=gym_config.SimulationConfig(timestep=0.02, max_laps=3),
        control_config=gym_config.ControlConfig(longitudinal_mode=gym_config.LongitudinalActionType.ACCL),
        observation_config=gym_config.ObservationConfig(type=gym_config.ObservationType.KINEMATIC_STATE),
        lidar_config=gym_config.LiDARConfig(num_beams=270, angle_min=-1.0, angle_max=1.0))  # fmt: skip
    env = f110.make("f1tenth-v0", config=settings)
    assert (env.num_agents, env.timestep, env.sim.num_beams, env.sim.fov) == (2, 0.02, 270, 2.0)
    assert env.action_type.type == ("steering_angle", "accl") and env.world.car.mu == pytest.approx(0.7)
    assert env.config["max_laps"] == 3 and env.observation_type.type == "kinematic_state"
    with pytest.raises(SettingsError, match="configure changes timestep; accepted"):
        env.configure(settings.with_updates(simulation=gym_config.SimulationConfig(max_laps=3)))
    env.configure(settings.with_updates(map_name="oval", params=settings.params.with_updates(mu=0.5)))
    env.reset(seed=1)
    assert env.world.track.name == "oval" and env.world.car.mu == pytest.approx(0.5)
    moved = gym_config.LiDARConfig(base_link_to_lidar_tf=(0.1, 0.0, 0.0))
    assert f110.make("f1tenth-v0", config=settings.with_updates(lidar=moved)).sim.lidar_dist == 0.1
    assert settings.with_updates(simulation=gym_config.SimulationConfig(max_laps=5)).simulation_config.max_laps == 5


def test_a_reset_of_the_later_releases_puts_cars_as_far_apart_as_asked_or_at_states():
    """Four metres and more on the centreline; or at 3 m/s, from where cars drive 0.02 s without a loss of speed."""
    from fg_mujoco.addons.gym2d import gym_config as config

    places = config.ResetConfig(reference_line=config.ReferenceLine.CENTERLINE, min_dist=4.0, max_dist=5.0,
                                move_laterally=False, shuffle=False)  # fmt: skip
    env = later("coulomb", num_agents=2, reset_config=places, lidar_config=config.LiDARConfig(noise_std=0.0))
    env.reset(seed=1)
    frenet = env.sim.state.frenet
    assert 4.0 <= frenet[1, 0] - frenet[0, 0] <= 5.0 and np.abs(frenet[:, 1:]).max() < 1e-3
    states = np.array([[0.0, 0.1, 0.0, 3.0, 0.0, 0.0, 0.0], [-2.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0]])
    info = env.reset(options={"states": states})[1]
    np.testing.assert_allclose(env.sim.state.standard_state[:, [0, 1, 2, 3]],
                               states[:, [0, 1, 2, 3]] + [[0.06, 0.0, 0.0, 0.0], [0.0] * 4], atol=1e-3)  # fmt: skip
    assert info["terminated_agents"].tolist() == [False, False] and env.sim.state.sim_time == 0.02
    scans = [env.reset(options={"states": states}) and env.sim.state.scans for _ in range(2)]
    assert np.array_equal(*scans) and scans[0].shape == (2, 1080)
    with pytest.raises(SettingsError, match=r"options has 'pose'; .*did you mean 'poses'"):
        env.reset(options={"pose": states[:, :3]})


def test_actions_of_the_later_releases_come_late_and_noisy_as_asked():
    """As the gym's ring buffers have it: steering after two steps and speed after three, zeros before."""
    from fg_mujoco.addons.gym2d.gym_config import ControlConfig

    env = later(control_config=ControlConfig(steer_delay_steps=2, throttle_delay_steps=3))
    for _ in range(2):  # nothing is left of the episode before
        env.reset(seed=1)
        sent = [np.array([[0.1 * k, 5.0 * k]]) for k in (1, 2, 3, 4)]
        taken = [env.step(action) and env.driving.engine.commands[0].copy() for action in sent]
        assert [row[0] for row in taken] == pytest.approx([0.0, 0.0, 0.1, 0.2])
        assert [row[1] > 0.1 for row in taken] == [False, False, False, True]
    noisy = later(control_config=ControlConfig(steer_noise_std=0.1, accl_noise_std=0.5))

    def steered(seed):
        noisy.reset(seed=seed)
        return [noisy.step(np.zeros((1, 2))) and noisy.driving.engine.commands[0, 0] for _ in range(40)]

    assert steered(1) == steered(1) != steered(2) and 0.05 < np.std(steered(1)) < 0.15
    with pytest.raises(SettingsError, match="steer_delay_steps is -1; accepted"):
        later(control_config=ControlConfig(steer_delay_steps=-1))


def test_scans_of_the_later_releases_have_the_limits_dropouts_and_bias_that_are_asked_for():
    """Beside the scan without errors at the same place: as the gym clips, then drops to range_max."""
    from fg_mujoco.addons.gym2d.gym_config import LiDARConfig

    def scans(**settings):
        env = later(lidar_config=LiDARConfig(noise_std=0.0, **settings))
        env.reset(options={"poses": np.zeros((1, 3))}, seed=1)
        return np.array([env.step(np.zeros((1, 2))) and env.sim.agent_scans[0] for _ in range(3)])

    true = scans()
    np.testing.assert_allclose(scans(range_min=1.0, range_max=2.5), np.clip(true, 1.0, 2.5), atol=1e-6)
    dropped = scans(range_max=6.0, dropout_prob=0.2) != np.minimum(true, 6.0)
    assert 0.1 < dropped[true < 6.0].mean() < 0.3 and (dropped[0] != dropped[1]).any()
    bias = scans(range_bias_std=0.05) - true
    assert np.std(bias[0]) == pytest.approx(0.05, rel=0.1) and np.abs(bias - bias[0]).max() < 1e-5
    for name, value in (("range_max", 31.0), ("dropout_prob", 1.5), ("range_min", -1.0)):
        with pytest.raises(SettingsError, match=f"{name} is {value}"):
            later(lidar_config=LiDARConfig(**{name: value}))


@each("way", [1, -1])
def test_with_an_envconfig_lap_times_are_of_the_lap_that_was_driven_last(way):
    """Driven by hand: a lap in 10 s, then one in 5 s."""
    from fg_mujoco.addons.gym2d import gym_config

    env = f110.make("f1tenth-v0", config=gym_config.EnvConfig(map_name="oval"))
    _, info = env.reset()
    assert (info["lap_times"].tolist(), info["lap_counts"].tolist(), info["sim_time"]) == ([0.0], [0.0], 0.01)
    course = env.world.track
    x, y, heading = course.start_pose(0.0)
    laps = LapCount(course, x, y, heading if way > 0 else heading + math.pi)
    found = {}
    for tick in range(1, 1650):
        time = 0.01 * tick
        lap = min(time, 10.0) / 10.0 + max(time - 10.0, 0.0) / 5.0
        laps.count(time, *course.start_pose(way * course.length * lap)[:2])
        found.setdefault(laps.completed, laps.last)
    assert found == {0: 0.0, 1: pytest.approx(10.0, abs=0.03), 2: pytest.approx(5.0, abs=0.03)}


def test_a_course_of_ours_is_scaled_with_its_lines_and_one_without_laps_is_refused():
    env = new_env("oval", scale=1.5)
    oval = fg.load_track("oval")
    assert env.world.track.length == pytest.approx(1.5 * oval.length)
    line = np.column_stack((env.track.centerline.xs, env.track.centerline.ys))
    assert np.ptp(line, axis=0) == pytest.approx(1.5 * np.ptp(oval.centreline, axis=0), rel=1e-3)
    with pytest.raises(SettingsError, match=r"scale is 1.5 of .*accepted: 1"):
        new_env("scene:dead_end:1", scale=1.5)


# Functions


def test_the_single_track_model_turns_as_a_steady_circle_does():
    """The published steady state: yaw rate of v delta / (L + K v^2), K of the linear tires and the mass."""
    order = ("mu", "C_Sf", "C_Sr", "lf", "lr", "h", "m", "I", "s_min", "s_max", "sv_min", "sv_max", "v_switch", "a_max",
             "v_min", "v_max")  # fmt: skip
    numbers = [F1TENTH[name] for name in order]
    x = np.array([0.0, 0.0, 0.1, 4.0, 0.0, 0.0, 0.0])
    for _ in range(2000):
        x = x + 0.002 * gym_functions.vehicle_dynamics_st(x, np.zeros(2), *numbers)
    mu, front, rear, wheelbase = F1TENTH["mu"], F1TENTH["C_Sf"], F1TENTH["C_Sr"], 0.3302
    understeer = (1.0 / front - 1.0 / rear) / (mu * 9.81)
    assert x[5] == pytest.approx(4.0 * 0.1 / (wheelbase + understeer * 16.0), rel=0.01)
    turning = gym_functions.vehicle_dynamics_ks(np.array([0.0, 0.0, 0.1, 4.0, 0.0]), np.zeros(2), *numbers)[4]
    assert turning == pytest.approx(4.0 * math.tan(0.1) / wheelbase, rel=1e-3)


def test_footprints_and_servos_are_the_gyms():
    corners = gym_functions.get_vertices(np.array([1.0, 2.0, 0.5 * math.pi]), 0.6, 0.2)
    assert corners.tolist() == [pytest.approx(c) for c in ([0.9, 1.7], [1.1, 1.7], [1.1, 2.3], [0.9, 2.3])]
    assert gym_functions.collision(corners, corners + np.array([0.15, 0.0]))
    assert not gym_functions.collision(corners, corners + np.array([0.25, 0.0]))
    assert gym_functions.pid(2.0, 0.1, 1.0, 0.0, 3.2, 9.51, 20.0, -5.0) == pytest.approx((10 * 9.51 / 20, 3.2))
    assert gym_functions.pid(0.0, 0.0, 1.0, 0.0, 3.2, 9.51, 20.0, -5.0) == pytest.approx((-10 * 9.51 / 5, 0.0))


def test_rays_pixels_and_times_to_collision_are_the_gyms():
    square = np.array([[1.0, -0.5], [2.0, -0.5], [2.0, 0.5], [1.0, 0.5]])
    scan = gym_functions.ray_cast(np.zeros(3), np.full(3, 9.0), np.array([-1.5, 0.0, 0.25]), square)
    assert scan.tolist() == pytest.approx([9.0, 1.0, 1.0 / math.cos(0.25)])
    assert gym_functions.xy_2_rc(1.06, 2.49, 1.0, 2.0, 1.0, 0.0, 20, 10, 0.05) == (9, 1)
    assert gym_functions.xy_2_rc(0.99, 2.0, 1.0, 2.0, 1.0, 0.0, 20, 10, 0.05) == (-1, -1)
    near, angles, sides = np.full(3, 0.5), np.array([-0.1, 0.0, 0.1]), np.full(3, 0.2)
    for speed, touches in ((0.0, False), (10.0, True), (2.0, False), (-10.0, False)):
        assert gym_functions.check_ttc_jit(near, speed, angles, np.cos(angles), sides, 0.05) is touches


def test_a_scaled_map_has_no_image_outside_of_its_folder(drawn):
    file = drawn.with_suffix(".yaml")
    (file.parent / "maps").mkdir()
    text = file.read_text("utf-8").replace("image: ", "image: ../")
    (file.parent / "maps/mine.yaml").write_text(text, "utf-8")
    with pytest.raises(TrackError, match="outside of its folder"):
        f110.make("f1tenth-v0", config={"map": str(file.parent / "maps/mine"), "scale": 2.0, "num_agents": 1})


def later(tires=None, **parts):
    """An environment of an EnvConfig on the oval, with observations by car."""
    from fg_mujoco.addons.gym2d import gym_config as config

    seen = config.ObservationConfig(type=config.ObservationType.KINEMATIC_STATE)
    simulated = config.SimulationConfig(max_laps=None, timestep=0.02)
    settings = {"map_name": "oval", "simulation_config": simulated, "observation_config": seen} | parts
    return f110.make("f1tenth-v0", config=config.EnvConfig(**settings), tires=tires)


def test_wrappers_of_the_later_releases_make_one_car_of_it_and_old_observations():
    from gymnasium.utils.env_checker import check_env
    from gymnasium.wrappers import FlattenObservation

    from fg_mujoco.addons.gym2d import gym_config as config
    from fg_mujoco.addons.gym2d.gym_wrappers import ObservationDelayWrapper, SingleAgentWrapper

    ends = config.TerminationConfig(max_episode_steps=20)
    check_env(FlattenObservation(SingleAgentWrapper(later(termination_config=ends))), skip_render_check=True)
    now, old = SingleAgentWrapper(later()), ObservationDelayWrapper(SingleAgentWrapper(later()), delay_steps=3)
    seen, delayed = ([float(env.reset(seed=1)[0]["pose_x"])] for env in (now, old))
    for _ in range(12):
        for env, found in ((now, seen), (old, delayed)):
            found.append(float(env.step(np.array([0.1, 4.0]))[0]["pose_x"]))
    assert delayed == [seen[max(step - 3, 0)] for step in range(13)] and len(set(seen)) == 13
    with pytest.raises(SettingsError, match="SingleAgentWrapper of 2 cars"):
        SingleAgentWrapper(later(num_agents=2))
    with pytest.raises(SettingsError, match="delay_steps is -1"):
        ObservationDelayWrapper(later(), delay_steps=-1)


def test_ends_and_rewards_of_the_later_releases():
    """The first car drives into the wall and on; the second stands behind it."""
    from fg_mujoco.addons.gym2d import gym_config as config

    poses = {"poses": np.array([[0.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])}
    actions, ended = np.array([[0.3, 4.0], [0.0, 0.0]]), {}
    for mode in config.AgentTerminationMode:
        env = later(num_agents=2, ego_index=1, termination_config=config.TerminationConfig(
            agent_mode=mode, max_episode_steps=150))  # fmt: skip
        env.reset(options=poses)
        terminated = truncated = False
        steps = 0
        while not (terminated or truncated):
            *_, terminated, truncated, _ = env.step(actions)
            steps += 1
        ended[mode.name] = (terminated, truncated, steps)
    assert ended["EGO"] == ended["ALL"] == (False, True, 150)
    assert ended["ANY"][:2] == (True, False) and ended["ANY"][2] < 150
    ends = config.TerminationConfig(terminate_on_collision=False)
    gains = config.RewardConfig(
        mode=config.RewardMode.PROGRESS, progress_weight=2.0, velocity_weight=0.1, timestep_weight=1.0,
        collision_penalty=10.0,
    )  # fmt: skip
    env, hits = later(termination_config=ends, reward_config=gains), []
    env.reset(options={"poses": np.zeros((1, 3))})
    for _ in range(150):
        seen, reward, terminated, _, info = env.step(np.array([[0.3, 4.0]]))
        speed = float(seen["agent_0"]["linear_vel_x"])
        hits.append(bool(info["collisions"][0]))
        assert not terminated and reward == pytest.approx(
            2.0 * info["progress"][0] + 0.1 * speed + 0.02 - 10.0 * hits[-1], abs=1e-5)  # fmt: skip
    assert any(hits) and not all(hits[hits.index(True):])  # a collision is of a step
    own = config.RewardConfig(mode=config.RewardMode.CUSTOM, reward_fn=lambda *given: float(len(given)))
    env = later(reward_config=own)
    env.reset(seed=0)
    assert env.step(np.zeros((1, 2)))[1] == 5.0
    for refused, message in (
        (lambda: config.TerminationConfig(max_episode_steps=0), "max_episode_steps is 0"),
        (lambda: config.TerminationConfig(agent_mode="any"), "agent_mode is 'any'"),
        (lambda: config.RewardConfig(mode=config.RewardMode.CUSTOM), "reward_fn is None"),
        (lambda: config.RewardConfig(collision_penalty=-1.0), "collision_penalty is -1.0"),
    ):
        with pytest.raises(SettingsError, match=message):
            refused()


def collisions_of(env, pose, count=20):
    env.reset(np.array([pose]))
    return [env.step(np.array([[0.0, 1.0]]))[0]["collisions"][0] for _ in range(count)]


def test_a_gym_script_goes_on_beyond_the_walls_with_a_warning(tmp_path):
    env = f110.make(map=str(draw_map(tmp_path, ring()).with_suffix("")), map_ext=".png", num_agents=1)
    with pytest.warns(UserWarning, match=r"pose of car 0 is \[-20.0, 5.0, 0.0\], beyond the walls of 'drawn'"):
        assert not any(collisions_of(env, (-20.0, 5.0, 0.0)))
    with pytest.warns(UserWarning, match=r"pose of car 0 is .*, in a wall of 'drawn': it collides at once"):
        assert collisions_of(env, (7.5, 1.5, 0.0), 1) == [1.0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not any(collisions_of(env, (7.5, 2.25, 0.0)))


def test_a_copy_drives_apart_on_the_map_that_was_set_last():
    env = f110.make("f110_gym:f110-v0", map="oval", num_agents=1, num_beams=20)
    env.update_map("hairpins")
    env.reset(np.zeros((1, 3)))
    for again in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        assert again.world.track.name == "hairpins"
        again.reset(np.zeros((1, 3)))
        again.step(np.array([[0.1, 3.0]]))
    assert env.step(np.zeros((1, 2)))[0]["linear_vels_x"] == pytest.approx([0.0], abs=1e-6)
