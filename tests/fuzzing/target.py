"""The class of targets, and what they share: commands, calls of Python, and samples of which one file is changed.

An attempt is a call without arguments. It returns an exit code, or, of Python's targets, 0; any error that it raises is
a finding. It runs in a folder that is empty but for what the try has put there.
"""

import contextlib
import shutil
from collections.abc import Callable
from dataclasses import dataclass

from fg_mujoco.cli.main import main
from fg_mujoco.errors import FgMujocoError

from .mutations import any_json_file, changed_arrays, mutated, mutated_binary, one_of

SHORT = ("--time-limit", "0.03")
"""Of a race whose drive does not matter."""
BINARY = {".png", ".pgm", ".mcap", ".db3", ".npy"}


@dataclass(frozen=True, kw_only=True)
class Target:
    """A kind of files or values that is read.

    Attributes:
      attempt: takes the folder of samples, the present folder and the generator; puts a changed input there.
      prepare: writes the samples.
    """

    attempt: Callable
    prepare: Callable = lambda samples: None


def command(*arguments):
    """Return a call of the command line."""
    return lambda: main([str(argument) for argument in arguments])


def ignore_refusal(call):
    """Return a call of Python's, which may raise errors of this package only."""

    def attempt():
        with contextlib.suppress(FgMujocoError):
            call()
        return 0

    return attempt


def as_text(content):
    return content.decode("utf-8", errors="surrogateescape")


def change(path, rng):
    """Change a file as its ending says."""
    if path.suffix == ".json":
        any_json_file(path, rng)
    elif path.suffix == ".npz":
        changed_arrays(path, rng)
    else:
        path.write_bytes((mutated_binary if path.suffix in BINARY else mutated)(path.read_bytes(), rng))


def of_files(prepare, names, *ways, lost=0.0):
    """Return a target of samples of which one file is changed before one of some commands is run.

    Args:
      prepare: writes the samples.
      names: patterns of the files.
      ways: arguments of a command, or what makes an attempt of the path of the file and the generator.
      lost: share of the tries in which the file is lost, or another is in its place.
    """

    def attempt(samples, here, rng):
        shutil.copytree(samples, here, dirs_exist_ok=True)
        files = sorted(path for name in names for path in here.glob(name) if path.is_file())
        path, other = one_of(rng, files), one_of(rng, files)
        if rng.random() >= lost:
            change(path, rng)
        elif path != other:
            shutil.copy(other, path)
        else:
            path.unlink()
        way = one_of(rng, ways)
        return way(path, rng) if callable(way) else command(*way)

    return Target(attempt=attempt, prepare=prepare)
