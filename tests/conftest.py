import os

import pytest
from hypothesis import settings

import fg_mujoco as fg

# The same examples in every run, so that a change that passes here passes everywhere; `make fuzz` tries others.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("fuzz", max_examples=1000, deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

# Commands that the tests run write nothing about kernels, in a cache that is empty as in one that is not.
os.environ["FG_MUJOCO_COMPILING"] = "in tests"


class Straight:
    """Drives straight on, gently."""

    def __init__(self, speed=1.0):
        self.speed = speed

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.02, speed=min(self.speed, odometry.speed + 0.1))


@pytest.fixture(scope="session")
def short_race():
    """A race of 40 ticks."""
    return fg.race("oval", Straight(), laps=1, time_limit=0.99)


@pytest.fixture(scope="session")
def lap():
    """One lap of the oval by the gap finder."""
    return fg.race("oval", laps=1)
