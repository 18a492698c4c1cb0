"""What environments do from tick to tick, for tests."""

import numpy as np

import fg_mujoco as fg
from fg_mujoco.addons.learn.policy_files import read_policy


def commands_of_ticks(env):
    """Return a list that gets the commands [rad, m/s] of each tick that an F1TenthEnv drives from now on."""
    episodes, commands = env._episodes, []
    tick = episodes.tick

    def ticking(actions, **options):
        tick(actions, **options)
        commands.append(episodes.commands[0].copy())

    episodes.tick = ticking
    return commands


def race_as_environment(env, path, ticks, track="hairpins", check=lambda observation, action: None, **settings):
    """Race a policy's file and drive it in an F1TenthEnv: the commands have the same bits. Return the race's car.

    `check` gets each observation and action of the environment.
    """
    commands, policy = commands_of_ticks(env), read_policy(path)
    observation, _ = env.reset(seed=0)
    while len(commands) < ticks:
        action = policy.act(observation)
        check(observation, action)
        observation, _, terminated, _, _ = env.step(action)
        assert not terminated
    car = fg.race(track, str(path), time_limit=0.025 * ticks - 0.01, **settings).car
    column = fg.TELEMETRY.index("command_steering_rad")
    assert car.telemetry[:, column : column + 2].tobytes() == np.array(commands).tobytes()
    return car
