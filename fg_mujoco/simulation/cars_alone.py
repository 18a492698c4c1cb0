"""The cars of a world without its course, which are stepped in its place where they touch nothing.

Where all worlds have another course, what a step reads of their models and data has left the processor's cache before
the world's next tick, and each step places what is only seen of a car. But cars that touch nothing move the same
without both. So of several worlds each thread has one model and one data of the cars alone. A world's state, and what
is its own in the model (`CHANGEABLE`), is written to them before a tick, and read from them afterwards. From the first
step on in which a car may touch something, the world's own model and data are stepped. The states have the same bits:
the cars in both models have the same ids of bodies, joints, actuators and pairs.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from hashlib import sha256
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..arguments import Uncopied
from ..lidar.visible_surfaces import Scratch
from ..vehicle.bodywork import fit_timestep
from ..vehicle.car import Car
from ..vehicle.friction_patches import PREFIX
from ..vehicle.tire_rows import take_over
from .physics import CHANGEABLE, Batch


def without_course(xml: str) -> str:
    """Return the MJCF text of a world's cars alone, the same on any course: nothing that stands or is only seen."""
    root = ElementTree.fromstring(xml)
    root.set("model", "cars")
    root.insert(0, ElementTree.Element("compiler", discardvisual="true"))
    ground = root.find("worldbody")
    assert ground is not None
    for element in list(ground):
        if element.tag in ("light", "site") or element.get("mesh") is not None:
            ground.remove(element)
    seen = {geom.get("mesh") for geom in root.iter("geom")}
    for section in (*root.findall("asset"), *root.findall("custom")):
        for element in list(section):
            name = element.get("name", "")
            heights = element.attrib.pop("elevation", None)  # copied from the world's model: reading them in a thread
            if heights is not None:  # fails now and then, "unknown error in attribute 'elevation'" (mujoco 3.17.0)
                root.set("model", f"{root.get('model')} {sha256(heights.encode()).hexdigest()}")
            if (element.tag == "mesh" and name not in seen) or (element.tag == "numeric" and name.startswith(PREFIX)):
                section.remove(element)
    return ElementTree.tostring(root, encoding="unicode")


_OF_CARS = (
    "tires", "gears", "row_counts", "row_starts", "inertia_columns", "wheels", "pairs", "car_places", "touch_places",
    "links", "offset_positions", "offset_rotations", "bodies", "sizes",
)  # fmt: skip
_ROOM = ("scratch", *Scratch._fields)
"""Of the arrays of a compiled tick: those that the same cars have in all worlds, and those that are calculated in."""


class CarsAlone(Uncopied):
    """A model of some cars without the course of their world's, and its data, for one thread; `addresses` of both."""

    def __init__(self, xml: str, world: mujoco.MjModel, cars: Sequence[Car]) -> None:
        self._model = mujoco.MjModel.from_xml_string(xml)
        for number in range(self._model.nhfield):
            field = self._model.hfield(number)
            field.data[:] = world.hfield(field.name).data
        fit_timestep(self._model)
        self._model.dof_length[:] = world.dof_length  # for falling asleep: with what is only seen
        for car in cars:
            take_over(self._model, car.prefix)
        self._data = mujoco.MjData(self._model)
        own = [getattr(self._model, name) for name in CHANGEABLE]
        self._fields, self._sizes = [values.ctypes.data for values in own], [values.size for values in own]
        self._shared: dict[str, NDArray[Any]] = {}
        self.addresses = np.array([self._model._address, self._data._address], np.int64)

    def copies(self, physics: Batch) -> NDArray[np.int64]:
        """Return which fields of the model are to be copied before states of a batch are stepped in it.

        There is a row for each: address there, address of the first state's values, how many numbers, and how far apart
        the values of two states are, in bytes; 0 where they are those of the batch's model.
        """
        rows = []
        for name, address, size in zip(CHANGEABLE, self._fields, self._sizes, strict=True):
            own = physics.expanded(name)
            values = getattr(physics.model, name) if own is None else own
            rows.append((address, values.ctypes.data, size, 0 if own is None else values.strides[0]))
        return np.array(rows, np.int64)

    def share(self, arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return the arrays of the compiled tick of some worlds, by name, where one serves all worlds, that one."""
        found = dict(arrays)
        for name in _OF_CARS:
            first = self._shared.setdefault(name, found[name])
            if first.shape == found[name].shape and first.tobytes() == found[name].tobytes():
                found[name] = first
        for name in _ROOM:
            if name in found:
                own = found[name]
                if name not in self._shared or self._shared[name].size < own.size:
                    self._shared[name] = own.ravel()
                found[name] = self._shared[name][: own.size].reshape(own.shape)
        return found
