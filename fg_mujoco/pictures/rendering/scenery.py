"""The model that is drawn of a world: the cars' looks, painted walls, road, start line, sky and daylight.

It is a second model, compiled for pictures from the very scene.xml of a world: the bodies, joints and actuators are
those of the first, so it takes its states. So the model that is raced, and the scene.xml of a run folder, have nothing
that is only for pictures: the meshes would add 32 ms to writing and reading a world's MJCF, which take 71 ms without.
"""

from __future__ import annotations

from importlib.resources import as_file, files
from typing import Any

import mujoco
import numpy as np

from ...course.files import is_file, read_text
from ...course.mjcf import MOST_MJCF, checked_mjcf
from ...course.moving_obstacles import PREFIX as MOVING_PREFIX
from ...errors import ModelError
from ...messages import FloatArray
from ...simulation.cars import (
    BOX,
    BOX_HEIGHTS,
    BOX_SIDE,
    CAR_PREFIX,
    car_colour,
    car_prefix,
    car_prefixes,
    lidar_prefix,
)
from ...simulation.terrain import SEEN
from ...simulation.world import compiled_model
from .ribbons import Surface, box_faces, nearest_on, road, strip_across, wall_chains, wall_faces, wall_tops
from .textures import asphalt, car_number, chequers, hall_floor, wall_face, wall_top

LOOK_PREFIX = "look/"
"""Of the names of what is added for pictures."""
WALL_TOPS = f"{LOOK_PREFIX}wall_tops_"
"""Of the names of the tops of walls."""

_CAR_GROUP = 2  # of the plain shapes of a vehicle
_PAINT = "paint"  # the material of a look that has the colour of a car among several
_TILES = 0.5  # a metre, of ground with heights
_LINE_WIDTH, _LINE_FIELD = 0.30, 0.10  # [m]
_FLOOR_BELOW, _LINE_ABOVE = -0.012, 0.0015  # [m] so that surfaces do not fight for a pixel
SUN = (-0.42, 0.30, -1.0)  # where its light goes
OBSTACLE_COLOUR, MOVING_COLOUR, _WALL = (0.93, 0.45, 0.10, 1.0), (0.80, 0.16, 0.14, 1.0), (0.90, 0.89, 0.86, 1.0)


def compile_scenery(xml: str, start: tuple[float, float] | None = None) -> mujoco.MjModel:
    """Return the model of a world's MJCF text for pictures, with a start line at a point (2,) [m]; None: without.

    Raises:
      ModelError: the text is not of such a world, or the model would not take its states.
    """
    try:
        spec = mujoco.MjSpec.from_string(xml)
        states = _state_size(compiled_model(xml))
        _dress_cars(spec)
        _dress_course(spec, start)
        _light(spec)
        model = spec.compile()
    except (ValueError, AttributeError, KeyError) as error:
        reason = " ".join(str(error).split())
        raise ModelError(f"a world that cannot be drawn: {reason}; accepted: one that World made") from error
    if _state_size(model) != states:
        raise ModelError("the model for pictures does not take the states of the world")
    return model


def _state_size(model: mujoco.MjModel) -> int:
    return int(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))


def _dress_cars(spec: Any) -> None:
    """Give each car its look; where there are several, each has its colour, and its number on its box."""
    count = 0
    while spec.body(f"{car_prefix(count)}base_link") is not None:
        count += 1
    for index in range(count):
        _dress_car(spec, index, alone=count == 1)
        if count > 1:
            _number_box(spec, index)


def _dress_car(spec: Any, index: int, *, alone: bool) -> None:
    """Put the frames of a vehicle's look on the bodies of their names, in place of the plain shapes there."""
    prefix = car_prefix(index)
    look = _load_look(spec, prefix)
    if look is None:
        return
    if not alone and look.material(_PAINT) is not None:
        look.material(_PAINT).rgba = car_colour(index)
    own = [geom for geom in spec.geoms if geom.name.startswith(prefix) and geom.group == _CAR_GROUP]
    hidden = {geom.name for geom in own if geom.name != prefix + BOX}
    for pair in list(spec.pairs):  # a picture's contacts do not count
        if {pair.geomname1, pair.geomname2} & hidden:
            spec.delete(pair)
    for geom in own:
        if geom.name in hidden:
            spec.delete(geom)
    for frame in list(look.frames):
        body = spec.body(prefix + frame.name) or spec.body(lidar_prefix(index) + frame.name)
        if frame.name and body is not None:
            body.attach_frame(frame, LOOK_PREFIX + (prefix if index else ""), "")


def _number_box(spec: Any, index: int) -> None:
    """Draw the box that makes a car visible with the car's number on each side, and on top."""
    box = spec.geom(car_prefix(index) + BOX)
    if box is None:
        return
    name = f"box_{index}"
    low, high = BOX_HEIGHTS
    material = _paint(spec, name, car_number(index, car_colour(index)), specular=0.3)
    body = spec.body(f"{car_prefix(index)}base_link")
    _add(spec, name, box_faces(BOX_SIDE, high - low), material, place=tuple(box.pos), body=body)
    box.rgba = (0.0, 0.0, 0.0, 0.0)  # it stays, as a solid, in whose place the faces are seen


def _load_look(spec: Any, prefix: str) -> Any:
    """Return the look that a car of a world names; None where it names none, or one that is not on this machine."""
    text = spec.text(f"{prefix}look")
    if text is None:
        return None
    with as_file(files("fg_mujoco.models")) as folder:  # a bundled name, or an absolute path
        path = folder / text.data
        if not is_file(path):
            return None
        try:
            look = checked_mjcf(read_text(path, MOST_MJCF), folder=path.parent)
            spec.assets.update(look.files)  # which is what compiles them
            return mujoco.MjSpec.from_string(look.text, assets=dict(look.files))
        except (OSError, ValueError) as error:
            raise ModelError(f"look {path}: {' '.join(str(error).split())}; accepted: as f1tenth_look.xml") from error


def _dress_course(spec: Any, start: tuple[float, float] | None) -> None:
    """Paint walls, obstacles and ground; lay the road and its start line."""
    materials = {
        "road": _paint(spec, "road", asphalt(), specular=0.05),
        "floor": _paint(spec, "floor", hall_floor(), repeat=0.5, specular=0.05),
        "wall_faces": _paint(spec, "wall_faces", wall_face(), specular=0.1),
        "wall_tops": _paint(spec, "wall_tops", wall_top(), specular=0.1),
        "line": _paint(spec, "line", chequers(), specular=0.1),
    }
    ground = spec.geom(f"{CAR_PREFIX}ground")
    ground.rgba, ground.material = (0.0, 0.0, 0.0, 0.0), ""
    walls = spec.mesh("walls")
    chains = [] if walls is None else wall_chains(np.array(walls.uservert, dtype=np.float64).reshape(-1, 8, 3))
    if chains:
        spec.delete(spec.geom("walls"))
    for index, chain in enumerate(chains):
        _add(spec, f"wall_faces_{index}", wall_faces(chain), materials["wall_faces"])
        _add(spec, f"{WALL_TOPS.removeprefix(LOOK_PREFIX)}{index}", wall_tops(chain), materials["wall_tops"])
    left, right = (chain[:, 0, :2] for chain in chains[:2]) if len(chains) > 1 else (None, None)
    uneven = spec.geom(SEEN) is not None
    if uneven:
        mesh = spec.mesh(SEEN)
        mesh.usertexcoord = (np.array(mesh.uservert).reshape(-1, 3)[:, :2] * _TILES).ravel()
        spec.geom(SEEN).material, spec.geom(SEEN).rgba = materials["road"], (1.0, 1.0, 1.0, 1.0)
    surface = road(left, right) if left is not None and right is not None and not uneven else None
    if uneven:
        start = None
    elif surface is None:  # one floor for all
        _add_floor(spec, _paint(spec, "ground", asphalt(), repeat=0.5, specular=0.05), 0.0)
    else:
        _add_floor(spec, materials["floor"], _FLOOR_BELOW)
        _add(spec, "road", surface, materials["road"])
    if left is not None and right is not None and start is not None:
        on_left, on_right = (nearest_on(line, np.array(start)) for line in (left, right))
        line = strip_across(on_left, on_right, _LINE_WIDTH, _LINE_FIELD)
        _add(spec, "start_line", line, materials["line"], place=(0.0, 0.0, _LINE_ABOVE))
    for geom in spec.geoms:
        if geom.name.startswith(("obstacle_", MOVING_PREFIX)):
            geom.rgba = MOVING_COLOUR if geom.name.startswith(MOVING_PREFIX) else OBSTACLE_COLOUR
        elif geom.name.startswith("wall_") and geom.rgba[3] > 0.0:
            geom.rgba = _WALL


def _add_floor(spec: Any, material: str, height: float) -> None:
    spec.worldbody.add_geom(
        name=f"{LOOK_PREFIX}ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 0.1), pos=(0.0, 0.0, height),
        material=material, contype=0, conaffinity=0,
    )  # fmt: skip


def _paint(spec: Any, name: str, image: Any, *, repeat: float = 1.0, specular: float) -> str:
    """Add a material with a texture and return its name."""
    name = LOOK_PREFIX + name
    texture = spec.add_texture(
        name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=image.shape[1], height=image.shape[0], nchannel=3
    )
    texture.data = image.tobytes()
    material = spec.add_material(
        name=name, specular=specular, shininess=0.3, texuniform=repeat != 1.0, texrepeat=(repeat, repeat)
    )
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    return name


def _add(
    spec: Any,
    name: str,
    surface: Surface,
    material: str,
    *,
    place: tuple[float, float, float] = (0.0, 0.0, 0.0),
    body: Any = None,
) -> None:
    """Add a surface that is seen and nothing else, to `body`, or to the world."""
    name = LOOK_PREFIX + name
    mesh = spec.add_mesh(
        name=name, uservert=surface.vertices.ravel(), usernormal=surface.normals.ravel(),
        usertexcoord=surface.texture.ravel(), userface=surface.faces.ravel(),
    )  # fmt: skip
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # it has no volume
    mesh.needsdf = False
    (body or spec.worldbody).add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, material=material, pos=place, mass=0.0, contype=0,
        conaffinity=0,
    )  # fmt: skip


def _light(spec: Any) -> None:
    """Give it a clear day: a sun that throws shadows, a sky that lights what it leaves dark, haze at the horizon."""
    for light in list(spec.lights):
        spec.delete(light)
    for texture in [texture for texture in spec.textures if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX]:
        spec.delete(texture)
    spec.add_texture(
        name=f"{LOOK_PREFIX}sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.33, 0.55, 0.83), rgb2=(0.86, 0.91, 0.95), width=256, height=1536,
    )  # fmt: skip
    sun = np.array(SUN)
    directional = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_light(
        name=f"{LOOK_PREFIX}sun", type=directional, pos=-10.0 * sun, dir=sun, castshadow=True,
        diffuse=(0.62, 0.60, 0.56), ambient=(0.0, 0.0, 0.0), specular=(0.45, 0.45, 0.43),
    )  # fmt: skip
    spec.worldbody.add_light(
        name=f"{LOOK_PREFIX}sky_light", type=directional, pos=10.0 * sun, dir=(-sun[0], -sun[1], sun[2]),
        castshadow=False, diffuse=(0.16, 0.18, 0.22), ambient=(0.0, 0.0, 0.0), specular=(0.05, 0.05, 0.06),
    )  # fmt: skip
    visual = spec.visual
    visual.headlight.active = 1  # without a direction: what reaches into shadows
    visual.headlight.ambient = (0.40, 0.42, 0.45)
    visual.headlight.diffuse = visual.headlight.specular = (0, 0, 0)
    visual.quality.numslices, visual.quality.numstacks = 10, 6  # of the rods, which 28 would make a fifth of the work
    visual.rgba.haze = (0.86, 0.91, 0.95, 1.0)
    visual.map.haze = 0.25


def semantic_labels(model: mujoco.MjModel, labels: tuple[str, ...]) -> FloatArray:
    """Return for each geom of the model its place in `labels`. Shape (ngeom,) int."""
    place = {label: index for index, label in enumerate(labels)}
    result = np.zeros(model.ngeom, dtype=np.int32)
    cars = {int(model.body_rootid[model.body(f"{prefix}base_link").id]) for prefix in car_prefixes(model)}
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        if int(model.body_rootid[model.geom_bodyid[geom]]) in cars:
            result[geom] = place["car"]
        elif name.startswith(("obstacle_", MOVING_PREFIX)):
            result[geom] = place["obstacle"]
        elif name.startswith(("wall", f"{LOOK_PREFIX}wall")):
            result[geom] = place["wall"]
        elif name == f"{LOOK_PREFIX}start_line":
            result[geom] = place["start line"]
        elif name == f"{LOOK_PREFIX}road" or (name == f"{LOOK_PREFIX}ground" and model.geom_pos[geom, 2] == 0.0):
            result[geom] = place["road"]
        else:
            result[geom] = place["ground"]
    return result
