"""Module that a process started by `spawn` or `forkserver` imports in place of the script.

Python lets such a process run the script again, as `__mp_main__`, so that what the script defines is there. It finds
this module by the name that `running` passes on. The modules of f1tenth_gym are installed first, with the
settings that `install` keeps in environment variables, and then the script is run.
"""

from __future__ import annotations

import os
from pathlib import Path

from .installing import install
from .running import SCRIPT

install()
__file__ = os.environ[SCRIPT]
exec(compile(Path(__file__).read_bytes(), __file__, "exec"), globals())
