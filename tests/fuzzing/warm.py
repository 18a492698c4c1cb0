"""Imported once, by the process of which those that try are forks: loads, or compiles, what every door needs."""

import fg_mujoco as fg

from . import doors as doors

fg.race("oval", time_limit=0.03)
