"""The record of a crash: into what, where, when and at what speed. It is read off the tick in which the race ended."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from ..course.moving_obstacles import PREFIX as MOVING_PREFIX
from ..messages import FloatArray
from ..simulation.engine import Engine
from ..simulation.world import OBSTACLE_PREFIX, World
from ..vehicle.motion import ground_speed

_ACROSS = 0.9  # cosine between a wall's normal and an open course: a dead end's wall has no side


@dataclass(frozen=True, kw_only=True)
class Crash:
    """The first contact of the chassis with something. Fields are as in the JSON.

    `into` is "left wall" or "right wall" as seen along the course, "wall across the course" at a dead end, "obstacle 2"
    or "moving obstacle 0". The text is for people: "hit the left wall at (3.10, -0.02) m, 12.3 m into lap 1,
    t = 2.60 s, 4.1 m/s".
    """

    into: str
    geom: str  # its name in scene.xml, whose numbers obstacles have here
    time_s: float
    x_m: float  # of the contact, which is on the chassis
    y_m: float
    speed_m_s: float  # of the car along its heading just before; negative in reverse
    lap: int  # from 1
    s_m: float  # progress of the rear axle in that lap

    def __str__(self) -> str:
        name = f"the {self.into}" if "wall" in self.into else self.into
        reverse = " in reverse" if self.speed_m_s < 0.0 else ""
        return (
            f"hit {name} at ({self.x_m:.2f}, {self.y_m:.2f}) m, {self.s_m:.1f} m into lap {self.lap}, "
            f"t = {self.time_s:.2f} s, {abs(self.speed_m_s):.1f} m/s{reverse}"
        )


def crash_of(
    world: World, states: FloatArray, ctrl: FloatArray, timer: Any, laps: int, period: float, row: int = 0
) -> Crash | None:
    """Return the crash in which a race ended; None where the chassis touches nothing in the last tick.

    Touching another car is no crash.

    The last tick is simulated again, step by step, until the chassis touches something.

    Args:
      world: that was raced.
      states: as in RaceResult, (ticks + 1, n).
      ctrl: as in RaceResult, (ticks, controls).
      timer: row of LAP_TIMER at the end.
      laps: of the race.
      period: of a tick [s].
      row: of the car.
    """
    model, engine = world.model, Engine(world, period=period)
    data, before = mujoco.MjData(model), [0.0, 0.0]  # time and speed
    engine.load(states[-2] if len(ctrl) else states[0])
    prefix, constants = world.cars[row].prefix, world.cars[row].constants
    chassis = model.geom(f"{prefix}chassis").id
    others = {model.geom(f"{car.prefix}chassis").id for car in world.cars if car.prefix != prefix}
    crashes: list[Crash] = []

    def note(engine: Engine, _: Any) -> None:
        before[:] = engine.time(0), ground_speed(engine.qpos(0), engine.qvel(0), constants)

    def look(engine: Engine, _: Any) -> None:
        if crashes:
            return
        engine.read(0, data)  # its contacts are those at the beginning of the step
        own = [contact for contact in data.contact if chassis in contact.geom]
        touching = [contact for contact in own if not others & set(contact.geom.tolist())]
        if touching:
            deepest = min(touching, key=lambda contact: float(contact.dist))
            other = int(deepest.geom[1] if deepest.geom[0] == chassis else deepest.geom[0])
            x, y = map(float, deepest.pos[:2])
            name, place = model.geom(other).name, float(timer["place"])
            done = min(int(timer["laps_completed"]), laps - 1)
            into = _described(name, world, (x, y), deepest.frame[:2], place)
            s = float(timer["progress"]) - done * world.track.length
            time, speed = map(float, before)
            crashes.append(Crash(into=into, geom=name, time_s=time, x_m=x, y_m=y, speed_m_s=speed, lap=done + 1, s_m=s))

    engine.before_substep.append(note)
    engine.after_substep.append(look)
    engine.drive(controls=ctrl[-1:] if len(ctrl) else engine.ctrl(0)[np.newaxis].copy())
    return crashes[0] if crashes else None


def _described(geom: str, world: World, point: tuple[float, float], normal: FloatArray, place: float) -> str:
    """Return the description of a geom of a world, for people.

    Args:
      geom: its name.
      world: the World.
      point: where it was hit [m].
      normal: x and y of the contact's.
      place: of the car on the course's line then [m].
    """
    for prefix, kind in ((OBSTACLE_PREFIX, "obstacle"), (MOVING_PREFIX, "moving obstacle")):
        if geom.startswith(prefix):
            return f"{kind} {geom.removeprefix(prefix)}"
    course = world.track
    along, offset = course.project(np.array([point]), near=place)
    if not course.closed:
        _, _, heading = course.start_pose(float(along[0]) - (course.origin or 0.0))
        if abs(normal @ (math.cos(heading), math.sin(heading))) > _ACROSS:
            return "wall across the course"
    return "left wall" if offset[0] > 0.0 else "right wall"
