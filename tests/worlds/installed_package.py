"""The package as it is installed, for tests that edit it or start it elsewhere."""

import shutil
from importlib.resources import files

PACKAGES = ("fg_mujoco", "fg_mujoco.addons", "fg_mujoco.controllers", "fg_mujoco.models", "fg_mujoco.tracks")


def install_into(site):
    """Copy the package into a folder, as an installation lays it out."""
    for name in PACKAGES:
        place = site.joinpath(*name.split("."))
        shutil.copytree(str(files(name)), place, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
