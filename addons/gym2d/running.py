"""Run a script of f1tenth_gym unedited: python -m fg_mujoco.addons.gym2d [--maps FOLDER] script.py [arguments].

The script has its working directory, `sys.argv`, `__file__` and `__main__` as `python script.py` gives them.
"""

from __future__ import annotations

import argparse
import builtins
import multiprocessing.spawn
import os
import sys
import traceback
from pathlib import Path
from types import ModuleType
from typing import Any

from fg_mujoco.errors import FgMujocoError

from .installing import install, is_of_the_script

_HERE = str(Path(__file__).parent)
_SPAWNED = f"{__package__}.spawned"
_preparation_data = multiprocessing.spawn.get_preparation_data

SCRIPT = "FG_MUJOCO_SCRIPT"
"""Environment variable: the script that runs, for the processes that it spawns."""


def main(arguments: list[str] | None = None) -> int:
    """Run the script of the command line, and return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m fg_mujoco.addons.gym2d", description="Run a script written for f1tenth_gym, unedited.",
        epilog="What stands behind the script's name is the script's own.",
    )  # fmt: skip
    parser.add_argument("--maps", metavar="FOLDER", help="of maps that are asked for by name; else FG_MUJOCO_MAPS")
    parser.add_argument("--vehicle", metavar="NAME", help="of all cars: a bundled one, or path/to/file.xml")
    parser.add_argument("--tires", metavar="NAME", help="of all cars: a bundled set, or path/to/file.toml")
    parser.add_argument("script", help="the script")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="of the script")
    options = parser.parse_args(arguments)
    script = Path(options.script)
    try:
        text = script.read_bytes()
        install(maps=options.maps and os.path.abspath(options.maps), vehicle=options.vehicle, tires=options.tires)
    except OSError as error:
        print(f"error: {options.script}: {error.strerror}; accepted: a script in Python", file=sys.stderr)
        return 2
    except FgMujocoError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return run(script, options.script, text, [options.script, *options.arguments])


def run(script: Path, name: str, text: bytes, arguments: list[str]) -> int:
    """Run a script as `__main__`, and return the exit status; what this package refuses is reported in one line."""
    module = ModuleType("__main__")
    vars(module).update(__file__=name, __builtins__=builtins, __cached__=None, __annotations__={})
    multiprocessing.spawn.get_preparation_data = preparation_data
    os.environ[SCRIPT] = str(script.resolve())
    sys.modules["__main__"] = module
    sys.argv[:] = arguments
    sys.path[0] = str(script.resolve().parent)  # in the place of the working directory, as `python script.py` does
    try:
        exec(compile(text, name, "exec"), vars(module))
    except FgMujocoError as error:
        place = _place(error)
        said = str(error)
        print(f"error: {said if said.startswith(place) else place + said}", file=sys.stderr)
        return 2
    except ImportError as error:
        if not _is_ours(error):
            _print(error)
            return 1
        print(f"error: {error}", file=sys.stderr)
        return 2
    except Exception as error:
        _print(error)
        return 1
    return 0


def preparation_data(name: str) -> dict[str, Any]:
    """Return the preparation data of multiprocessing for a spawned process, with `spawned` in place of the script."""
    data = _preparation_data(name)
    if data.pop("init_main_from_path", None) is not None:
        data["init_main_from_name"] = _SPAWNED
    return data


def _is_ours(error: ImportError) -> bool:
    """Return whether an import failed here, and not in another library."""
    frames = list(traceback.walk_tb(error.__traceback__))
    return bool(frames) and frames[-1][0].f_code.co_filename.startswith(_HERE)


def _place(error: BaseException) -> str:
    """Return file and line of the last place of the script from which an error came."""
    places = [
        (frame.f_code.co_filename, line)
        for frame, line in traceback.walk_tb(error.__traceback__)
        if is_of_the_script(frame.f_code.co_filename)
    ]
    return f"{places[-1][0]}:{places[-1][1]}: " if places else ""


def _print(error: BaseException) -> None:
    """Print a traceback as Python does, from the script on."""
    kept: Any = error.__traceback__
    while kept is not None and kept.tb_frame.f_code.co_filename == __file__:
        kept = kept.tb_next
    traceback.print_exception(type(error), error, kept)
