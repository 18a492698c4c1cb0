"""A world: one track or scene, its cars with their LiDARs, and any obstacles, attached into one MjModel.

The model that is simulated is compiled from the very XML that a run folder keeps, so that a replay of the folder
starts from the same bits.
"""

from __future__ import annotations

import math
import re
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from ..arguments import Suggesting, explain_class
from ..controllers.control.speed import lifting_share
from ..course.course import Course
from ..course.definitions import course_sha256
from ..course.kept_courses import sources_of_courses
from ..course.moving_obstacles import PREFIX as MOVING_PREFIX
from ..course.moving_obstacles import MovingObstacle, moving_obstacles
from ..course.obstacles import Obstacle, Pipe, require_obstacles
from ..display import brief, quoted
from ..errors import ModelError, Note, SettingsError, TrackError, accepted_names
from ..kept import kept
from ..lidar.lidar import LIDAR_BACKENDS, Lidar, make_lidar
from ..lidar.visible_surfaces import AS_OPTICS_SAY, ScanlineScene, let_through
from ..messages import CarParameters, FloatArray, shown
from ..vehicle.bodywork import PUSH_OF_MOVING, add_hull, harden, stand_on_ground
from ..vehicle.car import Car
from ..vehicle.changes import CarChanges
from ..vehicle.friction_patches import Patch, add_patches, require_patches
from ..vehicle.tire_slip import add_axle_sensors, drop_tire_sensors
from ..vehicle.tires import NUMERIC, Tires, tires_of
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from .cars import (
    CAR_PREFIX,
    LIDAR_IN_CAR,
    WorldCar,
    add_touch_sensors,
    car_prefix,
    car_prefixes,
    drop_unread_sensors,
    hide_ground,
    lidar_prefix,
    make_visible,
    require_alike,
)
from .clear_ground import distances_of
from .course_loading import load_track

_WALL_CONTYPE = 2  # contact roles are those of the vehicles' MJCF: the chassis meets walls and obstacles
_BELOW_GROUND = 0.5  # [m] that solids reach down: MuJoCo pushes a car out by the shortest way, which is never down
_COLLISION_GROUP = 3  # viewers hide it, as the car's own collision geoms
_WALL_COLOUR = (0.86, 0.84, 0.80, 1.0)
_DUCT_COLOUR = (0.16, 0.16, 0.18, 1.0)
_OBSTACLE_COLOUR = (0.85, 0.45, 0.15, 1.0)
_INVISIBLE = (0.0, 0.0, 0.0, 0.0)  # rays skip it too

_LOW_WALLS = 0.3  # [m] over the LiDARs of all vehicles of this scale
_LEAST_MEMORY = 2**21  # bytes of contacts and constraints, as the bundled vehicles have it; a car in a wall uses 0.1 MB

OBSTACLE_PREFIX = "obstacle_"
"""Of the names of the obstacles that stand, which are numbered."""
LIDAR_PREFIX = lidar_prefix(0)
"""Of the names of everything that belongs to car 0's LiDAR."""


@explain_class
class World(Suggesting):
    """A compiled world.

    Args:
      track: a course, or what `load_track` makes one of.
      vehicle: a bundled name, the path of a vehicle's MJCF, or a Vehicle.
      mu: friction coefficient of the tires, or the greatest peak of those with a curve; None: as in their file.
      lidar: back end of the LiDAR, "raycast" or "rangefinder".
      tires: a bundled set, the path of a TOML file, or Tires; None: the vehicle's.
      others: the cars besides this one; vehicle, mu, changes and tires are those of car 0.
      keep: whether the model is kept on disk, for the next world of the same course, cars and obstacles.

    Attributes:
      track, vehicle, tires: the course, and of car 0, without the changes.
      vehicles, cars, car: of all cars, the Car of each in the model, and that of car 0.
      obstacles: all that stands there and the chassis can hit, besides the walls.
      moving: the moving obstacles, as they are in `model`.
      xml, model: the MJCF text, and the compiled mujoco.MjModel.

    Raises:
      TrackError: a track that cannot be read, or is narrower than the car.
      SettingsError: a friction that is not positive, or not that of `changes`; an unknown vehicle or LiDAR back end.
      ModelError: an MJCF that is not that of a vehicle; cars that cannot be in one world.
    """

    def __init__(
        self,
        track: Course | str,
        vehicle: Vehicle | str | Path = DEFAULT_VEHICLE,
        *,
        mu: float | None = None,
        lidar: str = "raycast",
        obstacles: tuple[Obstacle, ...] = (),
        changes: CarChanges | None = None,
        tires: Tires | str | Path | None = None,
        patches: Sequence[Patch] = (),
        others: Sequence[WorldCar] = (),
        keep: bool = False,
    ) -> None:
        require_obstacles(obstacles)
        self.vehicle = Vehicle.load(vehicle)
        self.tires = self.vehicle.tires if tires is None else Tires.load(tires)
        first = WorldCar(vehicle=self.vehicle, mu=mu, changes=changes or CarChanges(), tires=self.tires)
        builds = (first, *others)
        self.vehicles = tuple(Vehicle.load(build.vehicle) for build in builds)
        self.track = load_track(track, car=self.vehicle.parameters)
        for own in dict.fromkeys(self.vehicles):
            self.track.check_car(own.parameters)
        self.lidar_backend = lidar
        self.obstacles = (*self.track.obstacles, *obstacles)
        parts = self.track, builds, lidar, self.obstacles, require_patches(patches)
        self.xml, model = (_kept if keep else _built)(*parts)
        self.model = copy(model)
        self.moving = moving_obstacles(self.model)
        self.cars = tuple(Car(self.model, car_prefix(index)) for index in range(len(builds)))
        self.car = self.cars[0]
        _note_walls(self)
        for build, car in zip(builds, self.cars, strict=True):
            if build.changes.center_of_gravity_height is not None:
                _warn_of_lifting(car)

    def __repr__(self) -> str:
        course = "of a scene.xml" if self.track is None else f"{quoted(self.track.name)}, {quoted(self.vehicle.name)}"
        course += f" and {len(self.cars) - 1} more" if len(self.cars) > 1 else ""
        return brief(
            self, course, f"mu {self.car.mu:.4g}", f"{len(self.obstacles)} obstacles, {len(self.moving)} moving"
        )

    @classmethod
    def from_xml(cls, xml: str, *, lidar: str = "raycast") -> World:
        """Return the world of the MJCF text of a run folder, without course and vehicle, which it does not say.

        Raises:
          ValueError: it does not compile.
          ModelError: it does not hold the car.
        """
        world = cls.__new__(cls)
        world.track = world.vehicle = None  # type: ignore[assignment]  # nobody asks for them
        world.vehicles = ()
        world.lidar_backend, world.obstacles, world.xml = lidar, (), xml
        world.model = compiled_model(xml)
        world.tires = tires_of(world.model, CAR_PREFIX)
        world.moving = moving_obstacles(world.model)
        world.cars = tuple(Car(world.model, prefix) for prefix in car_prefixes(world.model) or (CAR_PREFIX,))
        world.car = world.cars[0]
        return world

    @property
    def parameters(self) -> CarParameters:
        """Parameters of the car for planners, read off `model`."""
        return self.car.parameters

    @cached_property
    def lidar(self) -> Lidar:
        """The LiDAR, for what does not change: beams, mount, and what they can meet; measuring is for one thread."""
        return self.make_lidar()

    def make_lidar(self, car: int = 0) -> Lidar:
        """Return the LiDAR of a car of this world, with the back end it was built for."""
        return make_lidar(self.lidar_backend, self.model, lidar_prefix(car))

    @cached_property
    def distances(self) -> tuple[FloatArray, FloatArray]:
        """Distances to everything that stands, see `clear_ground.distances_of`."""
        return distances_of(self.model)

    @cached_property
    def xml_of_cars(self) -> str:
        """The MJCF text of the cars alone, see `cars_alone.without_course`."""
        from .cars_alone import without_course

        return without_course(self.xml)

    @cached_property
    def all_seen(self) -> ScanlineScene:
        """All that the LiDARs of the cars can meet, each other too, prepared for the beams of car 0's."""
        return ScanlineScene(self.model, self.lidar.beams, None)


def _note_walls(world: World) -> None:
    """Remark walls over which the beams look and see nothing; refuse porous ones that MuJoCo's rays are to measure."""
    parts = getattr(world.track, "wall_parts", ())
    if not parts:
        return
    porosity, lowest = max(part.built.porosity for part in parts), min(part.built.height for part in parts)
    if porosity and world.lidar_backend != "raycast":
        said = f"walls with a porosity of {porosity:g} for the LiDAR back end {world.lidar_backend!r}"
        raise SettingsError(f"{said}; accepted: 'raycast'")
    if lowest >= _LOW_WALLS or getattr(world.track, "hall", ()):
        return
    data = mujoco.MjData(world.model)
    mujoco.mj_kinematics(world.model, data)
    height = float(data.body(LIDAR_PREFIX + world.vehicle.lidar.body).xpos[2])
    if lowest < height:
        said = f"walls of {world.track.name!r} are {lowest:g} m high, below the LiDAR at {height:.3g} m"
        warnings.warn(f"{said}: its beams see none of them, and no hall behind", Note, stacklevel=3)


def _warn_of_lifting(car: Car) -> None:
    """Warn of a centre of gravity that is so high that a wheel lifts before the tires slide."""
    own = car.parameters
    lifts = lifting_share(own, own.max_steering_angle)
    if lifts < car.mu:
        warnings.warn(
            f"center_of_gravity_height is {own.center_of_gravity_height:.4g} m: at full lock a wheel lifts at "
            f"{lifts:.3g} g, before the tires slide at {car.mu:.3g} g. The friction limiter stays below; a planner "
            "without it may roll over",
            stacklevel=3,
        )


def compiled_model(xml: str) -> mujoco.MjModel:
    """Return the model of an MJCF text, the caller's own; the last texts are compiled once; ValueError: a bad one."""
    return copy(_compiled(xml))


@lru_cache(maxsize=8)
def _compiled(xml: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(xml)  # never given away, because a model's arrays can be written to


@lru_cache(maxsize=8)
def _kept(track: Course, builds: tuple[WorldCar, ...], *others: Any) -> tuple[str, mujoco.MjModel]:
    """Return the MJCF text of a world and its model, which are kept on disk; arguments as of `_text_of`."""

    if not type(track).__module__.startswith("fg_mujoco.course."):  # walls may be of more than the definition
        return _built(track, builds, *others)
    text = _text_of(track, builds, *others, walls=False)
    key = text, type(track).__name__, course_sha256(track), mujoco.__version__, sources_of_courses()
    return kept("world", key, lambda: _built(track, builds, *others), lambda made: isinstance(made[1], mujoco.MjModel))


def _built(*parts: Any) -> tuple[str, mujoco.MjModel]:
    """Return the same, made anew."""
    text = _text_of(*parts)
    try:
        return text, _compiled(text)
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(
            f"MuJoCo does not read the world that it wrote: {' '.join(str(error).split())}; accepted: a vehicle "
            "without the element that it names"
        ) from error


@lru_cache(maxsize=8)
def _text_of(
    track: Course,
    builds: tuple[WorldCar, ...],
    lidar: str,
    obstacles: tuple[Obstacle, ...],
    patches: tuple[Patch, ...],
    *,
    walls: bool = True,
) -> str:
    """Return the MJCF text of a world. Writing it takes as long as compiling it, so the last few are kept."""
    spec = _compose(track, builds, lidar, obstacles, walls=walls)
    add_patches(spec, patches)
    try:
        return str(spec.to_xml())
    except ValueError as error:
        which = re.search(rf"mesh '{OBSTACLE_PREFIX}(\d+)'", str(error))
        if which is None:
            raise
        said = f"obstacle {which[1]} is {shown(obstacles[int(which[1])])}, which MuJoCo cannot make a solid"
        raise SettingsError(f"{said}; accepted: a larger one, or one nearer to the world's origin") from error


def _compose(
    track: Course, builds: Sequence[WorldCar], lidar: str, obstacles: tuple[Obstacle, ...], *, walls: bool
) -> Any:
    """Return the spec of the whole world: walls, obstacles, and the cars with their ground and their LiDARs."""
    if lidar not in LIDAR_BACKENDS:
        raise SettingsError(f"lidar is {lidar!r}; {accepted_names(lidar, LIDAR_BACKENDS)}")
    vehicles = [Vehicle.load(build.vehicle) for build in builds]
    cars = [
        add_hull(vehicle.spec(build.mu, build.changes, build.tire_set))
        for vehicle, build in zip(vehicles, builds, strict=True)
    ]
    require_alike(cars, vehicles)
    spec = mujoco.MjSpec()
    spec.modelname = f"fg_mujoco {track.name}"
    spec.option = cars[0].option  # the engine settings that the car was validated with
    spec.memory = max(cars[0].memory, _LEAST_MEMORY) if cars[0].memory >= 0 else cars[0].memory
    if len(cars) > 1:
        spec.memory = sum(car.memory for car in cars)
        # cars that do not touch are solved apart, so that each costs as much as if it were alone
        spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    spec.nuserdata = sum(car.nuserdata for car in cars)
    spec.nuser_geom = max(1 if len(cars) > 1 else -1, *(car.nuser_geom for car in cars))
    if not any(equality.type == mujoco.mjtEq.mjEQ_TENDON for car in cars for equality in car.equalities):
        # static geoms are placed once, not every step; MuJoCo lets nothing sleep beside an equality of tendons
        spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    ground = getattr(track, "ground", None)
    if ground is not None:
        _require_level_for(track, cars)
        from .terrain import add_terrain

        add_terrain(spec, ground)
    _add_light(spec, track)
    _add_course(spec, track, obstacles, walls=walls)
    for index, (car, vehicle) in enumerate(zip(cars, vehicles, strict=True)):
        drop_tire_sensors(car) if car.numeric(NUMERIC.format("front")) is not None else add_axle_sensors(car)
        drop_unread_sensors(car)
        if len(cars) > 1:
            for geom in car.geoms:
                if geom.name != "ground":
                    let_through(car, geom, AS_OPTICS_SAY)
            make_visible(car, index, vehicle.parameters)
        if index > 0:
            hide_ground(car)
        car.memory, car.nuserdata, car.nuser_geom = spec.memory, spec.nuserdata, spec.nuser_geom  # or attaching warns
        beams = vehicle.lidar.spec(sensors=lidar == "rangefinder")
        solids = _named_solids(beams)
        car.attach(beams, site=car.site("lidar_mount"), prefix=LIDAR_IN_CAR)
        stand_on_ground(car, *(LIDAR_IN_CAR + name for name in solids))
        spec.attach(car, frame=spec.worldbody.add_frame(), prefix=car_prefix(index))
    add_touch_sensors(spec, len(cars))
    if walls:
        _add_pieces(spec, track)
    if ground is not None and not ground.flat:
        from .terrain import stand_on_terrain

        stand_on_terrain(spec)
    return spec


def _named_solids(beams: Any) -> list[str]:
    """Return the names of the geoms of a LiDAR's spec that can lie on the ground; one without a name gets one."""
    flat = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    solids = [geom for geom in beams.geoms if geom.type not in flat]
    for index, geom in enumerate(solids):
        geom.name = geom.name or f"solid_{index}"
    return [geom.name for geom in solids]


def shows(xml: str, track: Course) -> bool:
    """Return whether the MJCF text of a world has the walls of a course, its obstacles and its moving obstacles."""
    spec = mujoco.MjSpec()
    _add_course(spec, track, track.obstacles)
    wanted, found = _shapes(spec.to_xml()), _shapes(xml)
    walls = [sum(name.startswith("wall") for _, name in shapes) for shapes in (wanted, found)]
    return walls[0] == walls[1] and all(found.get(name) == shape for name, shape in wanted.items())


def _shapes(xml: str) -> dict[tuple[str, str], str]:
    """Return the corners of each mesh of an MJCF text, and its numbers, by kind and name."""
    return {
        (kind, element.get("name", "")): element.get(values, "")
        for kind, values in (("mesh", "vertex"), ("numeric", "data"))
        for element in ElementTree.fromstring(xml).iter(kind)
    }


def _add_course(spec: Any, track: Course, obstacles: tuple[Obstacle, ...], *, walls: bool = True) -> None:
    """Add the walls of a course, what moves there, and obstacles."""
    ground = getattr(track, "ground", None)
    if walls:
        _add_walls(spec, track)
    for index, moving in enumerate(track.moving):
        _add_moving(spec, f"{MOVING_PREFIX}{index}", moving)
    for index, obstacle in enumerate(obstacles):
        _add_hull(spec, f"{OBSTACLE_PREFIX}{index}", _prism(obstacle, ground), _OBSTACLE_COLOUR)


def _require_level_for(track: Course, cars: Sequence[Any]) -> None:
    """Raise SettingsError for tires, or things that move, that level ground only can have."""
    if any(car.numeric(NUMERIC.format("front")) is None for car in cars):
        said = "tires of the model 'contact', which MuJoCo's height fields shake, on ground that is not level"
        raise SettingsError(f"{said}; accepted: any other set, or a level course")
    if track.moving or any(part.built.weight for part in getattr(track, "wall_parts", ())):
        said = f"things that move on {track.name!r}, whose ground is not level"
        raise SettingsError(f"{said}; accepted: none, or a level course")


def _add_light(spec: Any, track: Course) -> None:
    """Add the sky, and daylight over the middle of the track."""
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.75, 0.85, 0.95), rgb2=(0.35, 0.5, 0.75), width=128, height=128,
    )  # fmt: skip
    low, high = track.bounds
    middle = 0.5 * (low + high)
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, pos=(*middle, 20.0), dir=(0.3, 0.2, -1.0),
        diffuse=(0.7, 0.7, 0.7), ambient=(0.3, 0.3, 0.3),
    )  # fmt: skip


def _add_walls(spec: Any, track: Course) -> None:
    """Add the walls as solids that are hit; where the course has a surface of them, it is seen in their place."""
    ground, all_parts = getattr(track, "ground", None), getattr(track, "wall_parts", ())
    parts = [part for part in all_parts if not part.built.weight]
    surfaces = [(part.built, part.surface()) for part in parts] if all_parts else [(None, track.wall_surface())]
    walls = [solid for part in parts for solid in part.solids()] if all_parts else track.walls
    for number, (built, surface) in enumerate(surfaces):
        if surface is None:
            continue
        vertices, faces = surface
        vertices = vertices if ground is None else ground.lifted(vertices)
        name = ("ducts" if built and built.kind == "duct" else "walls") + (f"_{number}" if number else "")
        _add_seen(spec, spec.worldbody, name, vertices, faces, built)
    hidden = 0 if surfaces and surfaces[0][1] is None else len(walls)
    for index, wall in enumerate((*walls, *getattr(track, "hall", ()))):
        _add_hull(spec, f"wall_{index}", _prism(wall, ground), _INVISIBLE if index < hidden else _WALL_COLOUR)


def _add_pieces(spec: Any, track: Course) -> None:
    """Add the walls that a car can push, each piece as a body."""
    pieces = [piece for part in getattr(track, "wall_parts", ()) if part.built.weight for piece in part.split()]
    if not pieces:
        return
    from .pieces import MOST, add_body

    if len(pieces) > MOST:
        said = f"{track.name!r} has {len(pieces)} pieces of walls that are pushed"
        raise TrackError(f"{said}; accepted: up to {MOST}, with a longer piece, or without weight")
    for index, piece in enumerate(pieces):
        body, centre = add_body(spec, index, piece)
        vertices, faces = piece.surface()
        name = f"piece_{index}"
        _add_seen(spec, body, name, vertices - (*centre, 0.0), faces, piece.built)
        for number, solid in enumerate(piece.solids()):
            _add_hull(spec, f"{name}_{number}", _prism(solid) - (*centre, 0.0), _INVISIBLE, body)


def _add_seen(spec: Any, body: Any, name: str, vertices: FloatArray, faces: Any, built: Any) -> None:
    """Add a mesh of walls to a body, which is seen and not hit."""
    spec.add_mesh(name=name, uservert=vertices.ravel(), userface=faces.ravel())
    geom = body.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0,
        rgba=_DUCT_COLOUR if built and built.kind == "duct" else _WALL_COLOUR,
    )  # fmt: skip
    if built and built.porosity:
        let_through(spec, geom, math.sqrt(built.porosity))  # a beam meets its front and its back


def _prism(solid: Obstacle, ground: Any = None) -> FloatArray:
    """Return the corners of a solid, _BELOW_GROUND and above it, or of a pipe, on a ground. Shape (n, 3) [m]."""
    if isinstance(solid, Pipe):
        vertices = solid.vertices()
    else:
        footprint = solid.corners()
        heights = np.repeat((-_BELOW_GROUND, solid.height), len(footprint))
        vertices = np.column_stack((np.tile(footprint, (2, 1)), heights))
    return vertices if ground is None else ground.lifted(vertices)


def _add_moving(spec: Any, name: str, obstacle: MovingObstacle) -> None:
    """Add a moving obstacle as a mocap body, whose frame keeps the world's axes, and its motion as numbers."""
    spec.add_numeric(name=name, data=obstacle.numbers())
    body = spec.worldbody.add_body(name=name, mocap=True, pos=(*obstacle.position(0.0), 0.0))
    solid = replace(obstacle.box(0.0), x=0.0, y=0.0)
    _add_hull(spec, name, _prism(solid), _OBSTACLE_COLOUR, body, PUSH_OF_MOVING)


def _add_hull(
    spec: Any, name: str, vertices: FloatArray, colour: tuple[float, ...], body: Any = None, *push: float
) -> None:
    """Add the hull of `vertices` (n, 3) [m] to `body`, or to the world, as a solid; rays see it unless invisible."""
    mesh = spec.add_mesh(name=name, uservert=vertices.ravel())
    mesh.needsdf = False
    geom = (body or spec.worldbody).add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, rgba=colour, contype=_WALL_CONTYPE, conaffinity=0,
        group=_COLLISION_GROUP if colour == _INVISIBLE else 0,
    )  # fmt: skip
    harden(geom, spec.option.timestep, *push)
