"""What a URDF tells of a car: mass, centre of gravity and yaw inertia of all links, and where its wheels are.

Links hang on each other by joints, whose places and turns are followed from the root. Wheels are the children of
continuous joints. Pictures, transmissions and limits are not read; a XACRO has to be expanded first.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray

_MOST = 1e6  # kg, m, kg m^2 or rad


def urdf_values(path: Path, text: str) -> Iterator[tuple[str, float]]:
    """Yield the names of f1tenth_gym and the values that a URDF tells.

    Raises SettingsError: no URDF, one that is not expanded, or one without masses.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text or "xacro:" in text:
        made = f"xacro {path.name} > car.urdf"
        said = f"is a XACRO or has entities; accepted: the URDF that `{made}` writes, with ROS or `pip install xacro`"
        raise SettingsError(f"{path}: {said}")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise SettingsError(f"{path}: is no XML: {error}; accepted: a URDF") from error
    links = {link.get("name", ""): link for link in root.findall("link")}
    joints = [(joint, _name(joint, "parent"), _name(joint, "child")) for joint in root.findall("joint")]
    children = {child for _, _, child in joints}
    base = next((name for name in links if name not in children), None)
    if base is None:
        raise SettingsError(f"{path}: has no link that all others hang on; accepted: a URDF of a robot")
    try:
        places = _placed(base, joints)
        bodies = [body for name in links if name in places for body in _bodies(links[name], *places[name])]
        box = next((each for each in links[base].iterfind("collision/geometry/box")), None)
        size = None if box is None else _numbers(box.get("size"), 3)
        turning = (child for joint, _, child in joints if joint.get("type") == "continuous" and child in places)
        wheels = np.array([places[child][0] for child in turning])
        radii = [float(each.get("radius", "nan")) for each in root.iterfind("link/collision/geometry/cylinder")]
    except ValueError as error:
        raise SettingsError(f"{path}: {error}; accepted: numbers, as xyz=\"0 0 0\"") from error
    if not bodies:
        raise SettingsError(f"{path}: no link has a mass; accepted: a URDF with <inertial>")
    masses = np.array([mass for mass, _, _ in bodies])
    middles = np.array([middle for _, middle, _ in bodies])
    if not masses.sum() > 0.0:
        raise SettingsError(f"{path}: the masses of its links are 0 kg together; accepted: a URDF with masses above 0")
    centre = masses @ middles / masses.sum()
    levers = ((middles - centre)[:, :2] ** 2).sum(axis=1)
    yield "m of the links", float(masses.sum())
    yield "I of the links", float(sum(inertia[2, 2] for _, _, inertia in bodies) + masses @ levers)
    if len(wheels) >= 4:
        front, rear = float(wheels[:, 0].max()), float(wheels[:, 0].min())
        yield from (("lf of the wheels", front - centre[0]), ("lr of the wheels", centre[0] - rear))
        yield "track_width of the wheels", float(np.ptp(wheels[:, 1]))
        if radii and np.ptp(radii) < 1e-6:
            yield "wheel_radius of the cylinders", radii[0]
            yield "h of the links", float(centre[2] - wheels[:, 2].mean() + radii[0])
    if size is not None:
        yield from (("length of the base's box", float(size[0])), ("width of the base's box", float(size[1])))


def _placed(base: str, joints: list[tuple[Any, str, str]]) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return where each link is, and how it is turned, from the base."""
    below: dict[str, list[tuple[Any, str]]] = {}
    for joint, parent, child in joints:
        below.setdefault(parent, []).append((joint, child))
    places, reached = {base: (np.zeros(3), np.eye(3))}, [base]
    for name in reached:
        place, turn = places[name]
        for joint, child in below.get(name, ()):
            if child not in places:
                moved, turned = _origin(joint)
                places[child] = (place + turn @ moved, turn @ turned)
                reached.append(child)
    return places


def _bodies(link: Any, place: FloatArray, turn: FloatArray) -> Iterator[tuple[float, FloatArray, FloatArray]]:
    """Yield mass, middle and inertia of a link that has one, in the base's frame."""
    inertial = link.find("inertial")
    if inertial is None or inertial.find("mass") is None:
        return
    mass, (moved, turned) = float(inertial.find("mass").get("value", "nan")), _origin(inertial)
    element, own = inertial.find("inertia"), np.zeros((3, 3))
    for i, j, name in ((0, 0, "ixx"), (1, 1, "iyy"), (2, 2, "izz"), (0, 1, "ixy"), (0, 2, "ixz"), (1, 2, "iyz")):
        own[i, j] = own[j, i] = 0.0 if element is None else float(element.get(name, "0"))
    if not (0.0 <= mass <= _MOST and (np.abs(own) <= _MOST).all()):
        raise ValueError(f"link {link.get('name')!r} has a mass or an inertia that no car has")
    turned = turn @ turned
    yield mass, place + turn @ moved, turned @ own @ turned.T


def _origin(element: Any) -> tuple[FloatArray, FloatArray]:
    """Return place and turn of an element, whose `rpy` is about fixed axes."""
    origin = element.find("origin")
    if origin is None:
        return np.zeros(3), np.eye(3)
    (roll, pitch, yaw), place = _numbers(origin.get("rpy"), 3), _numbers(origin.get("xyz"), 3)
    c, s = np.cos, np.sin
    about_x = np.array([[1, 0, 0], [0, c(roll), -s(roll)], [0, s(roll), c(roll)]])
    about_y = np.array([[c(pitch), 0, s(pitch)], [0, 1, 0], [-s(pitch), 0, c(pitch)]])
    about_z = np.array([[c(yaw), -s(yaw), 0], [s(yaw), c(yaw), 0], [0, 0, 1]])
    return place, about_z @ about_y @ about_x


def _numbers(text: str | None, count: int) -> FloatArray:
    numbers = np.array([float(word) for word in (text or "0 0 0").split()])
    if len(numbers) != count or not (np.abs(numbers) <= _MOST).all():
        raise ValueError(f"{text!r} is not {count} numbers of at most {_MOST:g}")
    return numbers


def _name(joint: Any, kind: str) -> str:
    element = joint.find(kind)
    return "" if element is None else element.get("link", "")
