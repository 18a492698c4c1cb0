"""The cars of a world: what they are called in its model, how they see and touch each other.

Car 0 is `car/`, as in a world of its own; the others are `car_1/`, `car_2/` and so on. All stand on car 0's ground.

A car that races others carries a box, because the rules ask that every car be seen at each height from 10 to 30 cm: a
chassis ends below the LiDAR of a car of its own size. Chassis touch each other and walls; boxes touch boxes and walls.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import portable
from ..arguments import explain_class
from ..display import brief, changed
from ..errors import ModelError, SettingsError
from ..messages import MOST_OTHERS, CarParameters, FloatArray
from ..vehicle.bodywork import harden, stand_on_ground
from ..vehicle.car import WHEELS, element_id, sensor_slice
from ..vehicle.changes import CarChanges
from ..vehicle.tires import Tires
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

GREATEST_CARS = MOST_OTHERS + 1
"""In a world: what a state of 16 cars and their sensors need is measured; races of the field have two."""

CAR_PREFIX = "car/"
"""Of the names of everything that belongs to car 0 in a world's model."""

LIDAR_IN_CAR = "lidar/"
"""And of those of its LiDAR, behind the car's prefix."""

UNREAD_SENSORS = (
    "position", "orientation", "gyro", "steering_angle", *(f"{wheel}_wheel_speed" for wheel in WHEELS)
)  # fmt: skip
"""Sensors of a vehicle that a world goes without: the odometry has them from the state, at its very moment."""

BOX = "visible_box"
"""Name of the geom that makes a car visible."""

BOX_SIDE = 0.12
"""[m] of its square footprint: RoboRacer rules 3.2026, a car fills 12 x 12 cm seen from all sides."""

BOX_HEIGHTS = (0.10, 0.30)
"""[m] above the ground between which it stands: the same rule, at every height from 10 to 30 cm."""

TOUCH_READINGS = 10
"""Of a sensor of two cars: how many contacts, the net force of the first on the second (3,) [N], where (3,) [m], world
frame, and three that nobody uses."""

_COLOURS = (
    (0.90, 0.30, 0.10, 1.0), (0.15, 0.60, 0.25, 1.0), (0.95, 0.75, 0.10, 1.0), (0.50, 0.20, 0.65, 1.0),
    (0.10, 0.65, 0.75, 1.0), (0.85, 0.35, 0.60, 1.0), (0.45, 0.30, 0.15, 1.0),
)  # fmt: skip
_OWN_COLOUR = (0.10, 0.32, 0.72, 1.0)  # that of the default car's body
_BOX_CONTYPE, _BOX_CONAFFINITY = 16, 16 | 2  # boxes and walls; see the table of the vehicles' MJCF
_HIDDEN_GROUP = 3
_SAME_OPTIONS = ("timestep", "integrator", "cone", "impratio", "gravity")


@explain_class
@dataclass(frozen=True, kw_only=True, repr=False)
class WorldCar:
    """A car besides car 0, as it is put into a world.

    Raises:
      SettingsError, ModelError: as of World.
    """

    vehicle: Vehicle | str | Path = DEFAULT_VEHICLE
    mu: float | None = None  # friction coefficient of the tires, or their greatest peak; None: as in their file
    changes: CarChanges = field(default_factory=CarChanges)
    tires: Tires | str | Path | None = None  # None: the vehicle's

    def __post_init__(self) -> None:
        object.__setattr__(self, "vehicle", Vehicle.load(self.vehicle))
        if self.tires is not None:
            object.__setattr__(self, "tires", Tires.load(self.tires))

    def __repr__(self) -> str:
        return brief(self, *changed(self, type(self)()))  # the vehicle of both is loaded

    @property
    def tire_set(self) -> Tires:
        """The tires that it stands on, loaded."""
        return Vehicle.load(self.vehicle).tires if self.tires is None else Tires.load(self.tires)


def car_prefix(index: int) -> str:
    """Return the prefix of the names of everything that belongs to a car."""
    return f"car_{index}/" if index else CAR_PREFIX


def require_car(car: int, count: int) -> int:
    """Return the number of a car of a world, or of a run, of `count` cars; SettingsError: there is none of it."""
    if isinstance(car, bool) or not isinstance(car, int) or not 0 <= car < count:
        raise SettingsError(f"car is {car!r}; accepted: {f'0 to {count - 1}' if count > 1 else '0, the only one'}")
    return car


def lidar_prefix(index: int) -> str:
    """Return the prefix of the names of everything that belongs to a car's LiDAR."""
    return car_prefix(index) + LIDAR_IN_CAR


def car_prefixes(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the prefixes of all cars of a model, in their order."""
    found: list[str] = []
    body = mujoco.mjtObj.mjOBJ_BODY
    while mujoco.mj_name2id(model, body, f"{car_prefix(len(found))}base_link") >= 0:
        found.append(car_prefix(len(found)))
    return tuple(found)


def car_colour(index: int) -> tuple[float, ...]:
    """Return the colour of a car's box in pictures, RGBA."""
    return _COLOURS[(index - 1) % len(_COLOURS)] if index else _OWN_COLOUR


def car_colour_hex(index: int) -> str:
    """Return the colour of a car in plots and pages, as `#rrggbb`."""
    return "#" + "".join(f"{round(255.0 * part):02x}" for part in car_colour(index)[:3])


def drop_unread_sensors(spec: Any) -> None:
    """Take from a vehicle's spec, in place, the sensors of UNREAD_SENSORS that it has."""
    for name in UNREAD_SENSORS:
        if (sensor := spec.sensor(name)) is not None:
            spec.delete(sensor)


def make_visible(spec: Any, index: int, car: CarParameters) -> None:
    """Put the box on a vehicle's spec that races others, in place, behind its LiDAR."""
    base = spec.body("base_link")
    low, high = BOX_HEIGHTS
    half = (0.5 * BOX_SIDE, 0.5 * BOX_SIDE, 0.5 * (high - low))
    # the front face .07 m behind the LiDAR hides what is more than 139 deg to either side; a UST-10LX ends at 135
    position = (car.lidar_offset - BOX_SIDE - 0.01, 0.0, 0.5 * (low + high) - float(base.pos[2]))
    box = base.add_geom(
        name=BOX, type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=position, rgba=car_colour(index), mass=0.0,
        contype=_BOX_CONTYPE, conaffinity=_BOX_CONAFFINITY, group=2,
    )  # fmt: skip
    harden(box, spec.option.timestep)
    stand_on_ground(spec, BOX)


def hide_ground(spec: Any) -> None:
    """Keep a vehicle's ground for its own tires only: other cars' wheels, beams and pictures have car 0's."""
    ground = spec.geom("ground")
    ground.material, ground.rgba, ground.group = "", (0.0, 0.0, 0.0, 0.0), _HIDDEN_GROUP
    ground.contype = ground.conaffinity = 0


def add_touch_sensors(spec: Any, count: int) -> None:
    """Add to a world's spec, in place, a sensor for each two of its cars that says how their chassis touch."""
    data = sum(
        1 << int(kind)
        for kind in (
            mujoco.mjtConDataField.mjCONDATA_FOUND, mujoco.mjtConDataField.mjCONDATA_FORCE,
            mujoco.mjtConDataField.mjCONDATA_POS, mujoco.mjtConDataField.mjCONDATA_NORMAL,
        )
    )  # fmt: skip
    net_force = 3  # reduce="netforce"
    for first in range(count):
        for second in range(first + 1, count):
            sensor = spec.add_sensor(
                name=touch_name(first, second), type=mujoco.mjtSensor.mjSENS_CONTACT,
                objtype=mujoco.mjtObj.mjOBJ_GEOM, objname=f"{car_prefix(first)}chassis",
                reftype=mujoco.mjtObj.mjOBJ_GEOM, refname=f"{car_prefix(second)}chassis",
            )  # fmt: skip
            sensor.intprm[0], sensor.intprm[1], sensor.intprm[2] = data, net_force, 1


def touch_name(first: int, second: int) -> str:
    """Return the name of the sensor of two cars, the lesser number first."""
    return f"car_{first}_touches_car_{second}"


def touch_places(model: mujoco.MjModel, count: int) -> NDArray[np.int64]:
    """Return the index in sensordata of each two cars' sensor, -1 on the diagonal. Shape (cars, cars)."""
    places = np.full((count, count), -1, np.int64)
    for first in range(count):
        for second in range(first + 1, count):
            places[first, second] = places[second, first] = sensor_slice(model, touch_name(first, second)).start
    return places


def tree_of(model: mujoco.MjModel, prefix: str) -> int:
    """Return the id of the body at the root of a car's kinematic tree."""
    return int(model.body_rootid[element_id(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}base_link")])


def first_overlap(poses: ArrayLike, cars: Sequence[CarParameters]) -> tuple[int, int] | None:
    """Return the first two cars that touch at poses of rear axles (m, 3), x, y [m], heading [rad]; None: none do."""
    placed = np.asarray(poses, dtype=np.float64).reshape(-1, 3)
    for first in range(len(placed)):
        for second in range(first + 1, len(placed)):
            pair = [footprint(placed[car], cars[car]) for car in (first, second)]
            if all(_overlap_along(pair, axis) for axis in _axes(placed[[first, second], 2])):
                return first, second
    return None


def footprint(pose: FloatArray, car: CarParameters) -> FloatArray:
    """Return the corners of a car from above, one after the other; the pose is of its rear axle. Shape (4, 2) [m]."""
    ahead, left = _axes(pose[2:])
    back, front, side = -car.rear_overhang, car.length - car.rear_overhang, 0.5 * car.width
    corners = ((back, -side), (front, -side), (front, side), (back, side))
    return np.array([pose[:2] + along * ahead + aside * left for along, aside in corners])


def _axes(headings: FloatArray) -> FloatArray:
    """Return the directions ahead of cars, and those to their left. Shape (2 k, 2)."""
    cos, sin = portable.cos(headings), portable.sin(headings)
    return np.concatenate((np.column_stack((cos, sin)), np.column_stack((-sin, cos))))


def _overlap_along(shapes: Sequence[FloatArray], axis: FloatArray) -> bool:
    """Return whether the shadows of two shapes (k, 2) on an axis (2,) touch or overlap."""
    (low, high), (other_low, other_high) = [((shape @ axis).min(), (shape @ axis).max()) for shape in shapes]
    return bool(low <= other_high and other_low <= high)


def require_alike(specs: Sequence[Any], vehicles: Sequence[Vehicle]) -> None:
    """Refuse cars that cannot be in one world: more than there may be, or with other settings of the engine.

    Raises:
      SettingsError: more than GREATEST_CARS.
      ModelError: another timestep, or another solver's setting that all share; LiDARs with other beams.
    """
    if len(specs) > GREATEST_CARS:
        raise SettingsError(f"{len(specs)} cars in a world; accepted: up to {GREATEST_CARS}")
    for spec, vehicle in zip(specs[1:], vehicles[1:], strict=True):
        for name in _SAME_OPTIONS:
            own, first = getattr(spec.option, name), getattr(specs[0].option, name)
            if not np.array_equal(own, first):
                said = f"vehicle {vehicle.name!r} has {name} {own}, {vehicles[0].name!r} {first}"
                raise ModelError(f"{said}; accepted: the same option {name} in all cars of a world")
        if vehicle.lidar.beams.geometry != vehicles[0].lidar.beams.geometry:
            said = f"vehicles {vehicle.name!r} and {vehicles[0].name!r} have LiDARs with different beams"
            raise ModelError(f"{said}; accepted: the same beams in all cars of a world")
