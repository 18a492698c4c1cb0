"""The dm_env environment keeps dm_env's contract, and its episodes are races."""

import os
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("dm_control", reason="there is no dm_control for this Python")

from fg_mujoco.envs.dm_environment import TASKS, load

CRASHING = np.array([0.3, 4.0], np.float32)


def drive(env, actions):
    """Return the time steps of a reset and of some actions."""
    return [env.reset(), *map(env.step, actions)]


def test_contract_tests_see_the_end_of_an_episode():
    for task in TASKS:
        assert any(step.last() for step in drive(load("oval", task, seed=0, beam_step=540), [CRASHING] * 60)), task


def test_crash_ends_with_discount_0_and_the_time_limit_with_1():
    crash = next(step for step in drive(load("oval", beam_step=540), [CRASHING] * 60) if step.last())
    *_, late = drive(load("oval", beam_step=540, time_limit=0.5), [np.zeros(2)] * 20)
    assert crash.discount == 0.0
    assert crash.reward < -5.0
    assert (late.last(), late.discount) == (True, 1.0)


RENDER = """
import numpy as np, sys
try:
    import mujoco
    mujoco.GLContext(64, 64).free()
except Exception as error:
    print("no OpenGL:", error)
    sys.exit()
from gymnasium.utils.env_checker import check_env
import gymnasium, mujoco.viewer
from fg_mujoco.envs import rendering
from fg_mujoco.envs.dm_environment import load
from fg_mujoco.envs.gym_environment import ID, RENDER_MODES
class StandIn:  # for a window
    shown, cam = 0, mujoco.MjvCamera()
    def is_running(self): return True
    def sync(self): StandIn.shown += 1
    def close(self): pass
mujoco.viewer.launch_passive = lambda *args, **settings: StandIn()
rendering.can_open_window = lambda: True  # on a machine without a display, too
env = load("oval", beam_step=540)
env.reset()
top = env.physics.render(120, 160)
before = env.physics.render(120, 160, depth=True)
check_env(gymnasium.make(ID, render_mode=RENDER_MODES[0], beam_step=540).unwrapped)  # it tries the other modes, too
env = gymnasium.make(ID, render_mode="rgb_array", start="line")
env.reset()
frame = env.render()
for _ in range(20):
    env.step(np.array([0.0, 4.0]))
envs = gymnasium.make_vec(ID, num_envs=2, render_mode="rgb_array", start="line", beam_step=540)
envs.reset()
frames = envs.render()
drawn = gymnasium.make(ID, track=["oval", "random:0"], builds=2, beam_step=540, start="line", render_mode="rgb_array")
seen = []
for seed in range(4):
    drawn.reset(seed=seed)
    seen.append(drawn.render().tobytes())
check_env(drawn.unwrapped)
print(len(set(seen)) == 2, len(np.unique(top)) > 50, before.shape, frame.shape, frame.std() > 10,
      (env.render() != frame).mean() > 0.05, (frames[0] == frame).all(), (frames[1] == frame).all(), StandIn.shown > 3)
"""


@pytest.mark.slow
def test_rendering():
    """In a process of its own: which OpenGL is used is decided when mujoco is imported."""
    pytest.importorskip("gymnasium")
    ours = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}  # other tests set it
    where = ours | {"MUJOCO_GL": "egl"}
    run = subprocess.run([sys.executable, "-W", "ignore", "-c", RENDER], capture_output=True, text=True, env=where)
    if run.stdout.startswith("no OpenGL"):
        pytest.skip(run.stdout.strip())
    assert run.stdout.strip() == "True True (120, 160) (480, 640, 3) True True True True True", run.stdout + run.stderr
