"""Imported once, by the process of which those that try are forks: loads, or compiles, what every target needs."""

import subprocess
import sys

import fg_mujoco as fg

from . import targets as targets

_RACES = "import fg_mujoco as fg; [fg.race('oval', name, time_limit=0.03) for name in fg.controller_names()]"

subprocess.run([sys.executable, "-c", _RACES], check=True, capture_output=True)  # what compiles takes memory for good
fg.race("oval", time_limit=0.03)
