"""The build backend of the package: scikit-build-core's, which first looks for a compiler of C++20.

pip calls it as pyproject.toml says. `python native/build_backend.py` prints what the build needs besides, for installs
without pip's own environment for builds; it ends with one line where there is no compiler.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from typing import Any

from scikit_build_core.build import (
    build_editable,
    build_sdist,
    build_wheel,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)
from scikit_build_core.build import get_requires_for_build_editable as _requires_for_editable
from scikit_build_core.build import get_requires_for_build_wheel as _requires_for_wheel

__all__ = [
    "build_editable", "build_sdist", "build_wheel", "get_requires_for_build_editable", "get_requires_for_build_sdist",
    "get_requires_for_build_wheel", "prepare_metadata_for_build_editable", "prepare_metadata_for_build_wheel",
]  # fmt: skip

_NAMES = ("c++", "g++", "clang++")
_PROGRAM = "#include <bit>\n#include <numbers>\nstatic_assert(std::rotr(1u, 0) == 1u && std::numbers::pi > 3.0);\n"
_INSTALL = {"linux": "sudo apt-get install g++", "darwin": "xcode-select --install"}


def compiler() -> str | None:
    """Return the command of the compiler that CMake takes; None: there is none."""
    if named := os.environ.get("CXX"):
        return named
    return next(filter(None, map(shutil.which, _NAMES)), None)


def check_compiler() -> None:
    """Exit with one line unless there is a compiler of C++20; Windows' is left to CMake, which knows where it lies."""
    if sys.platform == "win32":
        return
    found = compiler()
    install = f"to install one: {_INSTALL.get(sys.platform, 'see the documentation of this system')}"
    if found is None:
        sys.exit(f"fg_mujoco is built by a C++ compiler, and there is none here; {install}")
    tried = [*shlex.split(found), "-std=c++20", "-fsyntax-only", "-x", "c++", "-"]
    try:
        done = subprocess.run(tried, input=_PROGRAM, capture_output=True, text=True)
    except OSError as error:
        sys.exit(f"fg_mujoco is built by a C++ compiler, and {found} does not run ({error.strerror}); {install}")
    if done.returncode != 0:
        sys.exit(f"{found} does not compile C++20; needed: g++ 11, clang 14, or newer; {install}")


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    """Return what the build of a wheel needs."""
    check_compiler()
    return _requires_for_wheel(config_settings)


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    """Return what the build for an editable install needs."""
    check_compiler()
    return _requires_for_editable(config_settings)


if __name__ == "__main__":
    print(*get_requires_for_build_editable())
