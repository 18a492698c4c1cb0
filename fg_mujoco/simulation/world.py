"""A world: one track or scene, one car, one LiDAR and any obstacles, attached into one MjModel.

The model that is simulated is compiled from the very XML that a run folder keeps, so that a replay of the folder
starts from the same bits.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from ..course.formats import load_track
from ..course.moving_obstacles import PREFIX as MOVING_PREFIX
from ..course.moving_obstacles import MovingObstacle, moving_obstacles
from ..course.obstacles import Obstacle
from ..course.scene import Scene
from ..course.track import Track
from ..course.track_mesh import WALL_HEIGHT, wall_prisms, wall_surface
from ..errors import SettingsError
from ..lidar.lidar import LIDAR_BACKENDS, Lidar, lidar_spec, make_lidar
from ..messages import CarParameters, FloatArray
from ..vehicle.changes import CarChanges, change_spec
from ..vehicle.vehicle import Car, car_parameters, car_spec

_WALL_CONTYPE = 2  # contact roles are those of models/f1tenth.xml: the chassis meets walls and obstacles
_COLLISION_GROUP = 3  # viewers hide it, as the car's own collision geoms
_WALL_COLOUR = (0.86, 0.84, 0.80, 1.0)
_OBSTACLE_COLOUR = (0.85, 0.45, 0.15, 1.0)
_INVISIBLE = (0.0, 0.0, 0.0, 0.0)  # rays skip it too

CAR_PREFIX = "car/"
"""Of the names of everything that belongs to the car in a world's model."""
_LIDAR_IN_CAR = "lidar/"
LIDAR_PREFIX = CAR_PREFIX + _LIDAR_IN_CAR
"""Of the names of everything that belongs to its LiDAR."""


class World:
    """A compiled world.

    Args:
      track: a Track, a Scene, or what `load_track` makes one of.
      mu: friction coefficient of the tires; None is the car model's own.
      lidar: back end of the LiDAR, "raycast" or "rangefinder".
      obstacles: what stands on the track, besides what a scene has.
      changes: what else differs from the car of models/f1tenth.xml.

    Attributes:
      track: the Track or Scene.
      obstacles: all that stands there and the chassis can hit, but for the walls of a track: of a scene its walls too.
      moving: the moving obstacles, as they are in `model`.
      xml: the MJCF text that `model` was compiled from.
      model: the compiled mujoco.MjModel.
      car: the Car in it.

    Raises:
      TrackError: a track that cannot be read, or is narrower than the car.
      SettingsError: a friction that is not positive, or an unknown LiDAR back end.
    """

    def __init__(
        self,
        track: Track | Scene | str,
        *,
        mu: float | None = None,
        lidar: str = "raycast",
        obstacles: tuple[Obstacle, ...] = (),
        changes: CarChanges | None = None,
    ) -> None:
        car = car_spec(mu)
        change_spec(car, changes or CarChanges())
        self.track: Any = load_track(track, minimum_width=car_parameters(car.compile()).width)
        self.lidar_backend = lidar
        scene = self.track if isinstance(self.track, Scene) else None
        self.obstacles = (scene.walls + scene.obstacles if scene else ()) + tuple(obstacles)
        self.xml = _compose(self.track, car, lidar, obstacles).to_xml()
        self.model = mujoco.MjModel.from_xml_string(self.xml)
        self.moving = moving_obstacles(self.model)
        self.car = Car(self.model, CAR_PREFIX)

    @classmethod
    def from_xml(cls, xml: str, *, lidar: str = "raycast") -> World:
        """Return the world of the MJCF text that a run folder keeps: without a course, which the text does not say.

        Raises:
          ValueError: it does not compile.
          ModelError: it does not hold the car.
        """
        world = cls.__new__(cls)
        world.track, world.lidar_backend, world.obstacles, world.xml = None, lidar, (), xml
        world.model = mujoco.MjModel.from_xml_string(xml)
        world.moving = moving_obstacles(world.model)
        world.car = Car(world.model, CAR_PREFIX)
        return world

    @property
    def parameters(self) -> CarParameters:
        """What a planner is told of the car, read off `model`."""
        return self.car.parameters

    def make_lidar(self) -> Lidar:
        """Return the LiDAR of this world, with the back end it was built for."""
        return make_lidar(self.lidar_backend, self.model, LIDAR_PREFIX)


def _compose(track: Track | Scene, car: Any, lidar: str, obstacles: tuple[Obstacle, ...]) -> Any:
    """Return the spec of the whole world: walls, obstacles, and the car with its ground and its LiDAR."""
    if lidar not in LIDAR_BACKENDS:
        raise SettingsError(f"LiDAR back end {lidar!r}; accepted: {', '.join(LIDAR_BACKENDS)}")
    spec = mujoco.MjSpec()
    spec.modelname = f"fg_mujoco {track.name}"
    spec.option, spec.memory = car.option, car.memory  # the engine settings that the car was validated with
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)  # static geoms are placed once, not every step
    _add_light(spec, track)
    if isinstance(track, Scene):
        for index, wall in enumerate(track.walls):
            _add_hull(spec, f"wall_{index}", _prism(wall), _WALL_COLOUR)
        for index, moving in enumerate(track.moving):
            _add_moving(spec, f"{MOVING_PREFIX}{index}", moving)
        obstacles = track.obstacles + tuple(obstacles)
    else:
        _add_walls(spec, track)
    for index, obstacle in enumerate(obstacles):
        _add_hull(spec, f"obstacle_{index}", _prism(obstacle), _OBSTACLE_COLOUR)
    car.attach(lidar_spec(sensors=lidar == "rangefinder"), site=car.site("lidar_mount"), prefix=_LIDAR_IN_CAR)
    spec.attach(car, frame=spec.worldbody.add_frame(), prefix=CAR_PREFIX)
    return spec


def _add_light(spec: Any, track: Track | Scene) -> None:
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


def _add_walls(spec: Any, track: Track) -> None:
    """Add the walls: one mesh that is seen, and the convex pieces of the same walls that are hit."""
    vertices, faces = wall_surface(track, height=WALL_HEIGHT)
    spec.add_mesh(name="walls", uservert=vertices.ravel(), userface=faces.ravel())
    spec.worldbody.add_geom(
        name="walls", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="walls", rgba=_WALL_COLOUR, contype=0, conaffinity=0
    )
    for index, prism in enumerate(wall_prisms(track, height=WALL_HEIGHT)):
        _add_hull(spec, f"wall_{index}", prism, _INVISIBLE)


def _prism(solid: Obstacle) -> FloatArray:
    """Return the corners of a solid, below and above. Shape (n, 3) [m]."""
    footprint = solid.corners()
    heights = np.repeat((0.0, solid.height), len(footprint))
    return np.column_stack((np.tile(footprint, (2, 1)), heights))


def _add_moving(spec: Any, name: str, obstacle: MovingObstacle) -> None:
    """Add a moving obstacle as a mocap body, whose frame keeps the world's axes, and its motion as numbers."""
    spec.add_numeric(name=name, data=obstacle.numbers())
    body = spec.worldbody.add_body(name=name, mocap=True, pos=(*obstacle.position(0.0), 0.0))
    solid = replace(obstacle.box(0.0), x=0.0, y=0.0)
    _add_hull(spec, name, _prism(solid), _OBSTACLE_COLOUR, body)


def _add_hull(spec: Any, name: str, vertices: FloatArray, colour: tuple[float, ...], body: Any = None) -> None:
    """Add the convex hull of `vertices` (n, 3) [m] as a solid that the chassis hits; rays see it unless invisible.

    It belongs to `body`, or to the world.
    """
    mesh = spec.add_mesh(name=name, uservert=vertices.ravel())
    mesh.needsdf = False
    (body or spec.worldbody).add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, rgba=colour, contype=_WALL_CONTYPE, conaffinity=0,
        group=_COLLISION_GROUP if colour == _INVISIBLE else 0,
    )  # fmt: skip
