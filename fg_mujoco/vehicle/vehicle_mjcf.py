"""Reads a vehicle's MJCF, and finds the LiDAR, the look and the tires that it names; `contract` checks it."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import mujoco

from ..course.files import is_file
from ..course.mjcf import checked_mjcf, inside, short_text, show_as_drawn
from ..errors import ModelError, SettingsError
from ..lidar.beams import DEFAULT_LIDAR, LidarModel
from .tires import DEFAULT_TIRES, Tires

OWN_CAR = "an MJCF file with the names that the page 'A car of your own' (howto/own_car) lists"
"""What is accepted as a vehicle, for messages."""

_HEAD = 2000  # characters, within which an XML says what it is


def parsed(text: str, where: str, hint: Callable[[str], str] = lambda text: "") -> Any:
    """Return the mujoco.MjSpec of an MJCF text; ModelError: none, or what `checked_mjcf` refuses, with a `hint`."""
    if re.search(r"<(robot|sdf)\b", text[:_HEAD]):
        raise ModelError(f"{where}: is a URDF or SDF, of ROS or Gazebo; accepted: {OWN_CAR}")
    try:
        document = checked_mjcf(text)
    except ValueError as error:
        raise ModelError(f"{where}: {error}{hint(text)}") from error
    try:
        return show_as_drawn(mujoco.MjSpec.from_string(document.text))
    except ValueError as error:
        raise ModelError(f"{where}: {_reason(error)}") from error


def compiled(spec: Any, where: str) -> Any:
    """Return the compiled mujoco.MjModel of a spec; ModelError: what MuJoCo refuses, as a body without mass."""
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"{where}: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    """Return MuJoCo's error in one line, with what it would accept."""
    text = " ".join(str(error).split())
    line = re.search(r"line (\d+)", text)
    at = f" (line {line[1]})" if line else ""
    if twice := re.search(r"repeated name '(.+?)' in (\w+)", text):
        return f"{twice[2]} {twice[1]!r} is there twice{at}; accepted: each name once"
    if "mass and inertia" in text and (body := re.search(r"name '(.+?)'", text)):
        return f"mass or inertia of body {body[1]!r} is not positive{at}; accepted: numbers above 0 [kg, kg m^2]"
    return f"{text}; accepted: an MJCF file that MuJoCo {mujoco.__version__} compiles"


def find_lidar(spec: Any, folder: Path | None, where: str) -> LidarModel:
    """Return the LiDAR that a text `lidar` names, in its folder or bundled, or the default; ModelError: none."""
    file = _named_file(spec, "lidar", folder, where, default=DEFAULT_LIDAR)
    assert file is not None
    return LidarModel.load(file)


def find_look(spec: Any, folder: Path | None, where: str) -> str | None:
    """Return the file of meshes that a text `look` names, in its folder or bundled; ModelError: no such file."""
    return _named_file(spec, "look", folder, where)


def find_tires(spec: Any, folder: Path | None, where: str) -> Tires:
    """Return the tires that a text `tires` names, in its folder or bundled, or the default; ModelError: none."""
    element = spec.text("tires")
    if element is None:
        return Tires.load(DEFAULT_TIRES)
    name = str(element.data)
    own = None if folder is None else inside(folder, name)
    try:
        if own is not None and is_file(own):
            return Tires.load(own)
        if "/" not in name and not name.endswith(".toml"):
            return Tires.load(name)
    except SettingsError as error:
        raise ModelError(f"{where}: text 'tires': {error}") from error
    named = short_text(repr(name))
    raise ModelError(f"{where}: text 'tires' names {named}; accepted: a file in its folder, or a bundled set")


def _named_file(spec: Any, text: str, folder: Path | None, where: str, default: str | None = None) -> str | None:
    element = spec.text(text)
    if element is None:
        return default
    name = str(element.data)
    own = None if folder is None else inside(folder, name)
    if own is not None and is_file(own):
        return str(own)
    if Path(name).name == name and is_file(str(files("fg_mujoco.models") / name)):
        return name
    named = short_text(repr(name))
    raise ModelError(f"{where}: text {text!r} names {named}; accepted: a file in its folder, or a bundled one")
