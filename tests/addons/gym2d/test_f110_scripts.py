"""Scripts for f1tenth_gym run unedited, in a process of their own, with Gymnasium alone of what they import."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap

import pytest

from cases import each
from fg_mujoco.addons.gym2d import running
from fg_mujoco.course.maps.map_track import read_map
from map_oracles import draw_map, ring

HIDDEN = """
import importlib.machinery
real = importlib.machinery.PathFinder.find_spec
def find_spec(name, path=None, target=None):
    return None if name.partition(".")[0] in {names!r} else real(name, path, target)
importlib.machinery.PathFinder.find_spec = staticmethod(find_spec)
"""
"""A sitecustomize.py that hides libraries which are installed."""

FOLLOWER = """
    def follow(points, x, y, theta):
        away = np.hypot(*(points - (x, y)).T)
        ahead = np.roll(np.arange(len(points)), -int(np.argmin(away)))
        goal = points[ahead[np.argmax(away[ahead] >= 0.9)]]
        aside = np.cos(theta) * (goal[1] - y) - np.sin(theta) * (goal[0] - x)
        return np.arctan(2 * 0.3302 * aside / 0.81)
"""


@pytest.fixture
def folder(tmp_path):
    """A folder as a student has it: a map, its waypoints, a configuration."""
    draw_map(tmp_path, ring())
    course = read_map(tmp_path / "drawn.yaml")
    rows = "\n".join(f"0.0; {x:.4f}; {y:.4f}; 0.0; 0.0; 4.0; 0.0" for x, y in course.centreline.tolist())
    (tmp_path
     / "waypoints.csv").write_text(f"# a\n# b\n# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2\n{rows}\n")
    x, y, heading = course.start_pose()
    (tmp_path / "config.yaml").write_text(f"map_path: ./drawn\nmap_ext: .png\nsx: {x}\nsy: {y}\nstheta: {heading}\n")
    return tmp_path


def run(folder, text, *arguments, name="script.py", hidden=(), options=(), where=None):
    """Run a script in a process of its own; return what it printed, what it said of errors, and its status."""
    (folder / name).write_text(textwrap.dedent(text))
    (folder / "sitecustomize.py").write_text(HIDDEN.format(names=set(hidden)) if hidden else "")
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY", "FG_MUJOCO_MAPS")}
    environment["PYTHONPATH"] = str(folder)
    done = subprocess.run([sys.executable, "-m", "fg_mujoco.addons.gym2d", *options,
                           str(name if where is None else folder / name), *arguments], cwd=where or folder,
                          env=environment, capture_output=True, text=True, timeout=300, check=False)  # fmt: skip
    return done.stdout, done.stderr, done.returncode


ALL = ("gym", "pyglet", "f110_gym", "f1tenth_gym")

OLD = f"""
    import time
    from f110_gym.envs.base_classes import Integrator
    import yaml
    import gym
    import numpy as np
    from argparse import Namespace
    from pyglet.gl import GL_POINTS
    {FOLLOWER}
    with open('config.yaml') as file:
        conf = Namespace(**yaml.load(file, Loader=yaml.FullLoader))
    waypoints = np.loadtxt('waypoints.csv', delimiter=';', skiprows=3)
    drawn = []

    def render_callback(env_renderer):
        e = env_renderer
        x = e.cars[0].vertices[::2]
        y = e.cars[0].vertices[1::2]
        e.score_label.x, e.score_label.y = min(x), max(y) - 700
        e.left, e.right, e.top, e.bottom = min(x) - 800, max(x) + 800, max(y) + 800, min(y) - 800
        for i, (px, py) in enumerate(50.0 * waypoints[:, 1:3]):
            if len(drawn) < len(waypoints):
                drawn.append(e.batch.add(1, GL_POINTS, None, ('v3f/stream', [px, py, 0.]),
                                         ('c3B/stream', [183, 193, 222])))
            else:
                drawn[i].vertices = [px, py, 0.]

    env = gym.make('f110_gym:f110-v0', map=conf.map_path, map_ext=conf.map_ext, num_agents=1, timestep=0.01,
                   integrator=Integrator.RK4)
    env.add_render_callback(render_callback)
    obs, step_reward, done, info = env.reset(np.array([[conf.sx, conf.sy, conf.stheta]]))
    env.render()
    laptime = 0.0
    while not done:
        steer = follow(waypoints[:, 1:3], obs['poses_x'][0], obs['poses_y'][0], obs['poses_theta'][0])
        obs, step_reward, done, info = env.step(np.array([[steer, 4.0]]))
        laptime += step_reward
        if round(laptime, 2) % 1 == 0:
            env.render(mode='human_fast')
    print(obs['lap_counts'][0], obs['collisions'][0], len(drawn) == len(waypoints), 13 < laptime < 17)
"""

NEW = f"""
    import gymnasium as gym
    import numpy as np
    {FOLLOWER}
    env = gym.make("MODULE", config={{"map": "drawn", "num_agents": 1, "timestep": 0.01, "integrator": "rk4",
                   "control_input": ["speed", "steering_angle"], "model": "st", "params": {{"mu": 1.0}},
                   "observation_config": {{"type": "kinematic_state"}}}}, render_mode="human")
    track = env.unwrapped.track
    waypoints = np.stack([track.raceline.xs, track.raceline.ys], axis=1)
    env.unwrapped.add_render_callback(track.raceline.render_waypoints)
    env.unwrapped.add_render_callback(lambda e: e.get_points_renderer(waypoints[:1], color=(1, 2, 3), size=4))
    poses = np.array([[track.raceline.xs[0], track.raceline.ys[0], track.raceline.yaws[0]]])
    obs, info = env.reset(options={{"poses": poses}})
    done = False
    env.render()
    while not done:
        car = obs[env.agent_ids[0]]
        steer = follow(waypoints, car["pose_x"], car["pose_y"], car["pose_theta"])
        obs, step_reward, done, truncated, info = env.step(np.array([[steer, 4.0]]))
    print(env.unwrapped.lap_counts[0], info["checkpoint_done"].tolist(), 13 < env.unwrapped.current_time < 17)
"""


def test_a_waypoint_follower_of_v0_2_laps_unedited(folder):
    out, error, status = run(folder, OLD, hidden=ALL)
    assert (out, status) == ("2.0 0.0 True True\n", 0), error
    assert error.count("render shows nothing and goes on: there is no display") == 1
    assert "script.py" in error  # the warning names the script's line


def test_a_waypoint_follower_of_v1_0_laps_unedited(folder):
    out, error, status = run(folder, NEW.replace("MODULE", "f1tenth_gym:f1tenth-v0"))
    assert (out, status) == ("2.0 [True] True\n", 0), error


def test_a_script_is_in_its_own_place(folder):
    """Working directory, arguments, `__file__`, `__main__` and the first folder of imports, as `python script.py`."""
    inside = folder / "inside"
    inside.mkdir()
    (inside / "helper.py").write_text("import gym\nname = gym.__name__\n")
    text = """
        import os, sys, pickle
        import __main__
        import helper
        class Thing: pass
        print(os.getcwd(), sys.argv, __file__, __name__, __main__.__file__, sys.path[0])
        print(helper.name, type(pickle.loads(pickle.dumps(Thing()))) is Thing, __spec__, __package__)
    """
    (folder / "inside" / "script.py").write_text(textwrap.dedent(text))
    command = [sys.executable, "-m", "fg_mujoco.addons.gym2d", "inside/script.py", "a", "--maps", "b"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=100, check=True)
    place = "inside/script.py"
    assert done.stdout == (
        f"{folder} ['{place}', 'a', '--maps', 'b'] {place} __main__ {place} {inside}\ngym True None None\n"
    )


@each("text, said",
      [("import math\nfrom f110_gym.envs.base_classes import Foo",
        "script.py:2: f110_gym.envs.base_classes has no 'Foo'"),
       ("import gym\ngym.make('f110_gym:f110-v0')", "script.py:2: map 'vegas': unknown track 'vegas'"),
       ("import gym\ngym.make('f110_gym:f110-v0', map='drawn').reset([[0, 0]])", "script.py:2: poses is")])  # fmt: skip
def test_what_is_not_there_is_told_by_name_file_and_line(text, said, folder):
    out, error, status = run(folder, text, hidden=ALL)
    assert said in error and "Traceback" not in error.replace('Traceback (most recent call last):\n  File "script', "")
    assert (out, status) == ("", 2)


def test_without_gymnasium_the_command_that_installs_it_is_named(folder):
    out, error, status = run(folder, "import gym\n", hidden=("gym", "gymnasium"))
    assert (out, status) == ("", 1)
    assert "environments of f1tenth_gym need Gymnasium: " in error and "[gym]" in error


def test_an_error_of_the_script_is_its_own(folder, capsys):
    out, error, status = run(folder, "import gym\n\n1 / 0\n")
    assert status == 1 and out == ""
    assert (error.startswith('Traceback (most recent call last):\n  File "script.py", line 3')
            and "fg_mujoco" not in error)  # fmt: skip
    assert run(folder, "import sys\nsys.exit(7)\n")[2] == 7
    assert running.main(["nowhere.py"]) == 2 and "error: nowhere.py: No such file" in capsys.readouterr().err


def test_maps_vehicle_and_tires_are_those_of_the_command(folder, capsys):
    tracks = folder / "tracks"
    tracks.mkdir()
    for suffix in (".yaml", ".png"):
        (tracks / f"drawn{suffix}").write_bytes((folder / f"drawn{suffix}").read_bytes())
    (tracks / "drawn.yaml").rename(tracks / "vegas.yaml")
    text = """
        import gym
        env = gym.make("f110_gym:f110-v0")
        print(env.num_agents, env.map_path.endswith("tracks/vegas.yaml"), env.world.tires.name, env.world.vehicle.name)
    """
    options = ("--maps", "tracks", "--tires", "f1tenth_gym", "--vehicle", "nuc2")
    assert run(folder, text, options=options)[0] == "2 True f1tenth_gym nuc2\n"
    assert running.main(["--tires", "rubber", str(folder / "script.py")]) == 2
    assert capsys.readouterr().err.startswith("error: tires 'rubber' are not known")


def test_gymnasium_stays_itself_and_has_the_environments(folder):
    text = """
        import gymnasium, f110_gym
        from gymnasium.wrappers import TimeLimit
        env = TimeLimit(gymnasium.make("f110-v0", map="drawn", num_agents=1), 3)
        obs, info = env.reset()
        print(gymnasium.__file__.endswith("gymnasium/__init__.py"), "f110-v0" in gymnasium.registry, len(info))
        print([env.step([[0.0, 1.0]])[3] for _ in range(3)], isinstance(env.unwrapped, f110_gym.envs.F110Env))
        vector = gymnasium.make_vec("f1tenth_gym:f1tenth-v0", 2, vectorization_mode="sync",
                                    config={"map": "drawn", "num_agents": 1})
        print(vector.reset(seed=1)[0]["scans"].shape)
    """
    out, error, status = run(folder, text)
    assert (out, status) == ("True True 4\n[False, False, True] True\n(2, 1, 1080)\n", 0), error


PROCESSES = """
    import multiprocessing
    import gym
    import numpy as np

    def work(seed, answers):
        env = gym.make("f110_gym:f110-v0", map="./drawn", map_ext=".png", num_agents=1, seed=seed)
        scan = env.reset(np.array([[0.0, 0.0, 0.0]]))[0]["scans"][0]
        answers.put((seed, len(scan), float(scan.sum())))

    if __name__ == "__main__":
        found = []
        for method, seeds in (("fork", 2), ("spawn", 1), ("forkserver", 1)):
            context = multiprocessing.get_context(method)
            answers = context.Queue()
            processes = [context.Process(target=work, args=(seed, answers)) for seed in range(seeds)]
            for process in processes:
                process.start()
            found.append(sorted(answers.get(timeout=200) for _ in processes))
            for process in processes:
                process.join()
        print(found[0][:1] == found[1] == found[2], found[0][0][1], found[0][0][2] != found[0][1][2])
"""


def test_processes_that_a_script_starts_have_the_modules_too(folder):
    printed, errors, status = run(folder, PROCESSES)
    assert (printed.split(), status) == (["True", "1080", "True"], 0), errors


CHECKS = """
    import gym
    import numpy as np
    def draw(e):
        e.label.text = np.zeros(3)[e.ego_idx + 7]
    for name, settings in (("f110_gym:f110-v0", {"map": "drawn", "num_agents": 1}),
                           ("f1tenth_gym:f1tenth-v0", {"config": {"map": "drawn", "num_agents": 1}})):
        env = gym.make(name, **settings)
        env.add_render_callback(draw)
        env.reset()
        env.render("rgb_array"), env.render("rgb_array")
        print(len(env.step(np.zeros((1, 2)))))
    from gym.wrappers.record_episode_statistics import RecordEpisodeStatistics
    class Slow(gym.ActionWrapper):
        def action(self, action):
            return np.clip(action, -0.5, 0.5)
    class Scans(gym.ObservationWrapper):
        def observation(self, observation):
            return observation["scans"]
    class Hundred(gym.RewardWrapper):
        def reward(self, reward):
            return 100.0 * reward
    for env in (gym.make("f110_gym:f110-v0", map="drawn", num_agents=1),
                gym.make("f1tenth_gym:f1tenth-v0", config={"map": "drawn", "num_agents": 1})):
        env = RecordEpisodeStatistics(gym.wrappers.TimeLimit(Hundred(Scans(Slow(env))), 2))
        seen = env.reset()[0]
        for _ in range(2):
            found = env.step(np.full((1, 2), 50.0))
        episode = found[-1]["episode"]
        print(len(found), np.shape(seen), found[1], episode["r"], episode["l"], env.num_agents)
    print(isinstance(env, gym.Env), gym.spaces.Box(0.0, 1.0, (2,)).shape, gym.__version__)
    try:
        import gym.spaces.box_
    except ImportError as error:
        print(error)
    from f110_gym.envs.base_classes import RaceCar, Simulator
    from f110_gym.envs.f110_env import F110Env
    from f110_gym.envs.laser_models import ScanSimulator2D

    env = gym.make("f110_gym:f110-v0", map="./drawn", map_ext=".png", num_agents=1)
    assert RaceCar.scan_angles.shape == RaceCar.cosines.shape == RaceCar.side_distances.shape == (1080,)
    assert np.allclose(RaceCar.scan_angles[[0, -1]], [-2.35, 2.35])
    assert np.isclose(RaceCar.side_distances.min(), 0.155)

    car = RaceCar(env.params, 12345, is_ego=True, time_step=0.02)
    car.set_map("./drawn.yaml", ".png")
    car.reset(np.array([0.5, 0.0, 0.1]))
    assert np.allclose(car.state, [0.5, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0])
    for _ in range(100):
        scan = car.update_pose(0.0, 1.0)
    assert scan.shape == (1080,) and 1.5 < np.hypot(car.state[0] - 0.5, car.state[1]) < 2.0

    ground = Simulator(F110Env.f1tenth_vehicle_params(), 1, seed=42)
    ground.reset(np.array([[1.0, 2.0, 0.5]]))
    assert np.allclose(ground.agent_poses, [[1.0, 2.0, 0.5]])

    RaceCar.scan_simulator = ScanSimulator2D(1440, 4.0)
    RaceCar.scan_simulator.set_map(env.map_path, env.map_ext)
    obs, *_ = env.reset(np.array([[0.0, 0.0, 0.0]]))
    agent = env.sim.agents[0]
    assert len(obs["scans"][0]) == agent.num_beams == env.num_beams == 1440
    assert np.isclose(agent.scan_angles[-1], 2.0)
    other = gym.make("f110_gym:f110-v0", map="./drawn", map_ext=".png", num_agents=1)
    assert len(other.reset(np.array([[0.0, 0.0, 0.0]]))[0]["scans"][0]) == 1440
    env.render()
    assert F110Env.renderer is env.renderer
    print("done")
"""


def test_callbacks_wrappers_and_classes_of_the_gym_are_here(folder):
    """A render callback that fails is told once, wrappers take four values and five, classes stand by themselves."""
    out, error, status = run(folder, CHECKS, hidden=ALL)
    assert status == 0, error
    assert error.count("the render callback 'draw' fails at script.py:5: IndexError") == 2
    assert out.splitlines() == ["4", "5", "4 (1, 1080) 1.0 2.0 2 1", "5 (1, 1080) 1.0 2.0 2 1", "True (2,) 0.21.0",
                                "No module named 'gym.spaces.box_'", "done"]  # fmt: skip
