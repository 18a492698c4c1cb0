"""Patches of floor on which the tires have another friction: ice, sand, paint.

A patch has no thickness, so that nothing but friction changes where it begins. MJCF cannot say that: of two geoms that
touch, MuJoCo takes the greater friction. So a patch is a site, which touches nothing and which rays skip, and before
each physics step each tire's own pair with the ground gets the friction of what lies under the middle of the wheel. A
tire touches the ground in one point, so that it is on a patch or not; where patches overlap, the last counts. Tires
with a curve have their peaks scaled: that of the set's greatest is the patch's, and the ratio of front to rear stays.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from ..arguments import explain_class
from ..course.obstacles import Box
from ..course.track import Track
from ..errors import SettingsError
from ..messages import FloatArray, require, shown
from ..native import core
from .car import WHEELS, element_id

PREFIX = "patch_"
"""Of the names of the sites, and of the numbers that hold their friction."""

_HALF_THICKNESS = 5e-4  # [m] as drawn, over the ground by this much
_COLOUR = (0.55, 0.75, 0.95, 0.8)
CLEAR = 3.0
"""[m] Stretch to either side of the start without the middle of any random patch."""


@explain_class
@dataclass(frozen=True, kw_only=True)
class Patch:
    """A rectangle of floor.

    Raises:
      SettingsError: a size or friction that is not positive, or a position that is not finite.
    """

    x: float  # [m] centre, world frame
    y: float  # [m]
    length: float  # [m] along its heading
    width: float  # [m]
    heading: float = 0.0  # [rad]
    mu: float  # [-] friction coefficient of the tires on it

    def __post_init__(self) -> None:
        require(self, math.isfinite, "a finite number", ("x", "y", "heading"), SettingsError)
        require(self, lambda v: 0.0 < v < math.inf, "a positive length in metres", ("length", "width"), SettingsError)
        require(self, lambda v: 0.0 < v < math.inf, "a number above 0", ("mu",), SettingsError)

    def corners(self) -> FloatArray:
        """Counterclockwise. Shape (4, 2) [m]."""
        return Box(x=self.x, y=self.y, length=self.length, width=self.width, heading=self.heading).corners()


def require_patches(patches: Any) -> tuple[Patch, ...]:
    """Return patches as a tuple; SettingsError: this is no sequence of Patch."""
    if not isinstance(patches, Iterable):
        raise SettingsError(f"patches is {shown(patches)}; accepted: a sequence of Patch")
    found = tuple(patches)
    for index, patch in enumerate(found):
        if not isinstance(patch, Patch):
            raise SettingsError(f"patches[{index}] is {shown(patch)}; accepted: a Patch")
    return found


def add_patches(spec: Any, patches: Sequence[Patch]) -> None:
    """Add patches to the floor of a spec, in place: a site where each is, and a number for its friction."""
    for index, patch in enumerate(patches):
        name = f"{PREFIX}{index}"
        half = 0.5 * patch.heading
        spec.worldbody.add_site(
            name=name, type=mujoco.mjtGeom.mjGEOM_BOX, pos=(patch.x, patch.y, 0.0), rgba=_COLOUR,
            quat=(math.cos(half), 0.0, 0.0, math.sin(half)),
            size=(0.5 * patch.length, 0.5 * patch.width, _HALF_THICKNESS),
        )  # fmt: skip
        spec.add_numeric(name=name, data=[patch.mu])


def read_patches(model: mujoco.MjModel) -> tuple[Patch, ...]:
    """Return the patches of a compiled model, in their order."""
    patches = []
    for site in range(model.nsite):
        name = model.site(site).name
        if name.startswith(PREFIX):
            quat, size = model.site_quat[site], model.site_size[site]
            (x, y, _), mu = model.site_pos[site].tolist(), float(model.numeric(name).data[0])
            heading = 2.0 * math.atan2(float(quat[3]), float(quat[0]))
            length, width = 2.0 * float(size[0]), 2.0 * float(size[1])
            patches.append(Patch(x=x, y=y, length=length, width=width, heading=heading, mu=mu))
    return tuple(patches)


def patch_table(model: mujoco.MjModel) -> FloatArray:
    """Return the patches of a compiled model for `look_at_floor`, one row each. Shape (patches, 7)."""
    rows = [
        (p.x, p.y, 0.5 * p.length, 0.5 * p.width, math.cos(p.heading), math.sin(p.heading), p.mu)
        for p in read_patches(model)
    ]
    return np.array(rows, np.float64).reshape(-1, 7)


look_at_floor = core.look_at_floor


def random_patches(
    track: Track, count: int, rng: np.random.Generator, *, mu: float, length: float = 1.5, width: float = 1.4
) -> tuple[Patch, ...]:
    """Return patches of `mu` [-], length and width [m], in equal parts of the lap, away from its start.

    Raises:
      SettingsError: fewer than one, or parts that are shorter than a patch.
    """
    part = (track.length - 2.0 * CLEAR) / max(count, 1)
    if count < 1 or part < length:
        raise SettingsError(f"{count} patches of {length} m on {track.name!r}; accepted: at least 1, and room for each")
    patches = []
    for index in range(count):
        s = CLEAR + part * index + 0.5 * length + rng.random() * (part - length)
        nearest = int(np.abs(track.arc_length - s).argmin())
        right, left = float(track.corridor_right[nearest]), float(track.corridor_left[nearest])
        x, y, heading = track.start_pose(s, rng.uniform(-0.5 * right, 0.5 * left))
        patches.append(Patch(x=x, y=y, length=length, width=width, heading=heading, mu=mu))
    return tuple(patches)


def wheel_positions(model: mujoco.MjModel, prefix: str) -> FloatArray:
    """Return the middles of the wheels in the car's frame, at rest. Shape (4, 2) [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base = element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}base_link")
    wheels = [element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}{wheel}_wheel") for wheel in WHEELS]
    places = (data.xpos[wheels] - data.xpos[base]) @ data.xmat[base].reshape(3, 3)
    return np.ascontiguousarray(places[:, :2])
