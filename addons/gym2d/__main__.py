"""python -m fg_mujoco.addons.gym2d script.py; see `running`."""

import sys

from .running import main

if __name__ == "__main__":
    sys.exit(main())
