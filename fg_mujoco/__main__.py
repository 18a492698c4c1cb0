"""`python -m fg_mujoco` is the command `fg-mujoco`."""

import sys

from .cli.main import main

sys.exit(main())
