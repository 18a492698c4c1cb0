"""The force of the ground on each tire, as an arrow inside its friction circle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from ...messages import FloatArray
from ...simulation.cars import CAR_PREFIX
from ...vehicle.car import WHEELS, element_id
from ...vehicle.tire_patch import curve_peaks
from ...vehicle.tire_rows import FORCE_ACROSS, FORCE_ALONG, LOAD, USERDATA, peaks, tire_rows, userdata_place
from .cameras import View
from .colours import friction_colour
from .decor import disc, ring

SCALE = 0.018
"""[m/N] of a picture: a tire of a car at rest, 9.6 N of friction to be had, has a circle of .17 m."""

_UP = np.array([0.0, 0.0, 1.0])
_ABOVE = 0.004  # [m] over the ground


@dataclass(frozen=True, kw_only=True, eq=False)
class TireForces:
    """Forces of the ground on the tires, one row a tire in the order of WHEELS; NaN for a tire off the ground."""

    points: FloatArray  # (4, 3) [m] of contact
    friction: FloatArray  # (4, 3) [N] along the ground, world frame
    limit: FloatArray  # (4,) [N] mu times the normal force; the lateral peak of a tire with a curve

    @property
    def use(self) -> FloatArray:
        """Share of the limit (4,)."""
        share: FloatArray = np.linalg.norm(self.friction, axis=1) / self.limit
        return share


class TireForceMeter:
    """Reads the forces of a car's tires: those of our laws in `userdata`, those of the model `contact` in contacts."""

    def __init__(self, model: mujoco.MjModel, prefix: str = CAR_PREFIX) -> None:
        self._model = model
        geoms = [element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}{wheel}_tire") for wheel in WHEELS]
        self._tires = {geom: index for index, geom in enumerate(geoms)}
        self._rows, self._mu = tire_rows(model, prefix), peaks(model, prefix)
        self._place = userdata_place(model, prefix) if len(self._rows) else 0
        self._ground = element_id(model, mujoco.mjtObj.mjOBJ_GEOM, f"{prefix}ground")

    def read(self, data: mujoco.MjData) -> TireForces:
        """Return the forces at a state that vehicle.tire_forces.TireForces.forward has seen."""
        found = TireForces(points=np.full((4, 3), np.nan), friction=np.full((4, 3), np.nan), limit=np.full(4, np.nan))
        if len(self._rows):
            self._read_laws(data, found)
        else:
            self._read_contacts(data, found)
        return found

    def _read_laws(self, data: mujoco.MjData, found: TireForces) -> None:
        own = data.userdata[self._place : self._place + USERDATA * len(WHEELS)].reshape(len(WHEELS), USERDATA)
        for tire, (row, did) in enumerate(zip(self._rows, own, strict=True)):
            if did[LOAD] <= 0.0:
                continue
            axle = data.xmat[row["body"]].reshape(3, 3) @ row["axle"]
            ahead = np.array((axle[1], -axle[0], 0.0)) / math.hypot(axle[0], axle[1])
            left = np.array((-ahead[1], ahead[0], 0.0))
            found.points[tire] = *data.xpos[row["body"], :2], row["ground"]
            found.friction[tire] = did[FORCE_ALONG] * ahead + did[FORCE_ACROSS] * left
            found.limit[tire] = curve_peaks(row, did[LOAD], self._mu[tire])[1]

    def _read_contacts(self, data: mujoco.MjData, found: TireForces) -> None:
        force = np.empty(6)
        for index in range(data.ncon):
            contact = data.contact[index]
            first, second = int(contact.geom[0]), int(contact.geom[1])
            tire = self._tires.get(first, self._tires.get(second))
            if tire is None or self._ground not in (first, second):
                continue
            mujoco.mj_contactForce(self._model, data, index, force)
            axes = np.asarray(contact.frame).reshape(3, 3)  # rows: normal, from the first geom to the second; tangents
            on_second = force[1] * axes[1] + force[2] * axes[2]
            found.points[tire] = contact.pos
            found.friction[tire] = on_second if second in self._tires else -on_second
            found.limit[tire] = contact.friction[0] * force[0]


def draw_circles(scene: mujoco.MjvScene, forces: TireForces) -> None:
    """Add the friction circle of each tire that is on the ground."""
    for point, limit in zip(forces.points, forces.limit, strict=True):
        if not np.isfinite(limit) or limit <= 0.0:
            continue
        centre = np.array([point[0], point[1], _ABOVE])
        radius = SCALE * float(limit)
        disc(scene, centre, radius, (1.0, 1.0, 1.0, 0.16))
        ring(scene, centre + 0.001 * _UP, radius, 0.007, (0.97, 0.97, 0.97, 1.0))


def draw_arrows(picture: NDArray[np.uint8], forces: TireForces, view: View) -> None:
    """Draw the forces onto a picture (height, width, 3), flat on the ground and over the car that would hide them."""
    from PIL import Image, ImageDraw

    height, width = picture.shape[:2]
    factor = 2  # drawn larger and then reduced: no jagged edges
    layer = Image.new("RGBA", (factor * width, factor * height))
    pen = ImageDraw.Draw(layer)
    for point, friction, use in zip(forces.points, forces.friction, forces.use, strict=True):
        along = SCALE * friction
        length = float(np.linalg.norm(along))
        if not np.isfinite(length) or length < 0.004:
            continue
        outline = _arrow(point, along, length)
        corners, depth = view.project(outline, (factor * width, factor * height))
        if (depth > view.near).all():
            colour = tuple(int(255 * part) for part in friction_colour(use))
            pen.polygon(
                [tuple(corner) for corner in corners], fill=(*colour, 255), outline=(12, 14, 20, 255), width=factor
            )
    small = np.asarray(layer.resize((width, height), Image.Resampling.BOX)).astype(np.uint16)
    cover = small[..., 3:]
    picture[:] = ((picture * (255 - cover) + small[..., :3] * cover) // 255).astype(np.uint8)


def _arrow(point: FloatArray, along: FloatArray, length: float) -> FloatArray:
    """Return the outline of a flat arrow from a contact point. Shape (7, 3) [m]."""
    ahead = along / length
    aside = np.array([-ahead[1], ahead[0], 0.0])
    head = min(0.05, 0.6 * length)
    neck = length - head
    outline = [(0.0, 0.009), (neck, 0.009), (neck, 0.024), (length, 0.0), (neck, -0.024), (neck, -0.009), (0.0, -0.009)]
    start = np.array([point[0], point[1], _ABOVE])
    return np.array([start + x * ahead + y * aside for x, y in outline])
