"""The build backend of the package: scikit-build-core's, which first looks for a compiler of C++20.

Where there is none, it takes that of the package ziglang, which is needed for the build alone. The core is compiled
with the headers of MuJoCo that the package `mujoco` brings, and then works with that version only: that of the
environment for which pip builds, or, where it has none yet, the newest, which pip then installs there, too.

pip calls it as pyproject.toml says. `python native/build_backend.py` prints what the build needs besides, for installs
without pip's own environment for builds; it ends with one line where something is missing that pip cannot install.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from scikit_build_core import build as _build
from scikit_build_core.build import (
    build_sdist,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable", "build_sdist", "build_wheel", "get_requires_for_build_editable", "get_requires_for_build_sdist",
    "get_requires_for_build_wheel", "prepare_metadata_for_build_editable", "prepare_metadata_for_build_wheel",
]  # fmt: skip

MUJOCO = "mujoco>=3.17,<5"  # as in pyproject.toml
ZIGLANG = "ziglang==0.17.1"
_NAMES = ("c++", "g++", "clang++")
_PROGRAM = "#include <bit>\n#include <numbers>\nstatic_assert(std::rotr(1u, 0) == 1u && std::numbers::pi > 3.0);\n"
_INSTALL = {"linux": "sudo apt-get install g++", "darwin": "xcode-select --install"}


def compiler() -> str | None:
    """Return the command of the compiler that CMake takes; None: there is none."""
    if named := os.environ.get("CXX"):
        return named
    return next(filter(None, map(shutil.which, _NAMES)), None)


def lacks_compiler() -> bool:
    """Return whether there is no compiler; exit with one line if there is one that does not compile C++20."""
    found = compiler()
    if sys.platform == "win32" or found is None:  # Windows' is left to CMake, which knows where it lies
        return sys.platform != "win32"
    install = f"to install one: {_INSTALL.get(sys.platform, 'see the documentation of this system')}"
    tried = [*shlex.split(found), "-std=c++20", "-fsyntax-only", "-x", "c++", "-"]
    try:
        done = subprocess.run(tried, input=_PROGRAM, capture_output=True, text=True)
    except OSError as error:
        sys.exit(f"fg_mujoco is built by a C++ compiler, and {found} does not run ({error.strerror}); {install}")
    if done.returncode != 0:
        sys.exit(f"{found} does not compile C++20; needed: g++ 11, clang 14, or newer; {install}")
    return False


def needed() -> list[str]:
    """Return what the build needs besides scikit-build-core's own: MuJoCo's headers, and maybe a compiler.

    MuJoCo is that of the environment that pip builds for; pip's own environment for builds hides it.
    """
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        install = "sudo apt-get install python3-dev" if sys.platform == "linux" else "see Python's documentation"
        sys.exit(f"fg_mujoco is built with the headers of Python, and they are not here; to install them: {install}")
    folders = [sysconfig.get_path("purelib"), sysconfig.get_path("platlib")]
    mujoco = next((f"mujoco=={found.version}" for found in distributions(name="mujoco", path=folders)), MUJOCO)
    if not lacks_compiler():
        return [mujoco]
    print("there is no C++ compiler here: that of the package ziglang is taken for the build (411 MB)", file=sys.stderr)
    return [mujoco, ZIGLANG]


@contextlib.contextmanager
def _with_compiler() -> Iterator[None]:
    """Let CMake use the compiler of the package ziglang where there is no other."""
    if not lacks_compiler():
        yield
        return
    folder = Path("build", "ziglang").resolve()  # where CMake finds it when it builds again
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("c++", "ar", "ranlib"):
        (folder / name).write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m ziglang {name} "$@"\n')
        (folder / name).chmod(0o755)
    before = os.environ.get("CMAKE_ARGS", "")
    os.environ["CXX"] = f"{folder}/c++"
    os.environ["CMAKE_ARGS"] = f"{before} -DCMAKE_AR={folder}/ar -DCMAKE_RANLIB={folder}/ranlib".strip()
    try:
        yield
    finally:
        del os.environ["CXX"]
        os.environ["CMAKE_ARGS"] = before


def build_wheel(*arguments: Any, **named: Any) -> str:
    """Build a wheel, as the backend of scikit-build-core does."""
    with _with_compiler():
        return _build.build_wheel(*arguments, **named)


def build_editable(*arguments: Any, **named: Any) -> str:
    """Build an editable install, as the backend of scikit-build-core does."""
    with _with_compiler():
        return _build.build_editable(*arguments, **named)


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    """Return what the build of a wheel needs."""
    return [*_build.get_requires_for_build_wheel(config_settings), *needed()]


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    """Return what the build for an editable install needs."""
    return [*_build.get_requires_for_build_editable(config_settings), *needed()]


if __name__ == "__main__":
    print(*get_requires_for_build_editable())
