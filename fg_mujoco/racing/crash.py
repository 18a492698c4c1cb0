"""The records of a crash and of a rollover: where, when and at what speed, and what was hit.

They are read off the last tick of a car's race, and this module is imported where one ended so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from ..course.moving_obstacles import PREFIX as MOVING_PREFIX
from ..messages import FloatArray
from ..simulation.engine import Engine
from ..simulation.telemetry import TELEMETRY
from ..simulation.world import OBSTACLE_PREFIX, World
from ..vehicle.car import WHEELS
from ..vehicle.motion import body_velocity, sideslip_angle
from ..vehicle.tire_slip import slides_above
from ..vehicle.tires import tires_of

_SLIDE, _TIME = TELEMETRY.index(f"slide_{WHEELS[0]}_m_s"), TELEMETRY.index("time_s")
_LAP, _X, _VX = (TELEMETRY.index(name) for name in ("lap", "x_m", "vx_m_s"))
_TOLD = 0.25  # [rad] of sideslip, from which the text has it: a little more than any car has that rolls round a bend
_TOGETHER = {
    WHEELS: "all tires", WHEELS[:2]: "the front tires", WHEELS[2:]: "the rear tires", WHEELS[::2]: "the left tires",
    WHEELS[1::2]: "the right tires",
}  # fmt: skip

_ACROSS = 0.9  # cosine between a wall's normal and an open course: a dead end's wall has no side


@dataclass(frozen=True, kw_only=True)
class Crash:
    """The first contact of the chassis with something. Fields are as in the JSON.

    `into` is "left wall" or "right wall" as seen along the course, "wall across the course" at a dead end, "obstacle 2"
    or "moving obstacle 0". The text is for people: "hit the left wall at (3.10, -0.02) m, 12.3 m into lap 1,
    t = 2.60 s, 4.1 m/s, 62 degrees of sideslip; had slid: the rear tires for 0.45 s".
    """

    into: str
    geom: str  # its name in scene.xml, whose numbers obstacles have here
    time_s: float
    x_m: float  # of the contact, which is on the chassis
    y_m: float
    speed_m_s: float  # of the rear axle over the ground just before
    sideslip_rad: float  # of the centre of gravity then, left positive; 0 where the car stands
    slid_front_left_s: float  # for how long the tire had slid then, without a break; 0: it had not; NaN: has no peak
    slid_front_right_s: float
    slid_rear_left_s: float
    slid_rear_right_s: float
    lap: int  # from 1
    s_m: float  # progress of the rear axle in that lap

    def __str__(self) -> str:
        name = f"the {self.into}" if "wall" in self.into else self.into
        angle = abs(self.sideslip_rad)
        way = " in reverse" if angle > 0.5 * math.pi else ""
        if _TOLD < angle < math.pi - _TOLD:
            way = f", {math.degrees(angle):.0f} degrees of sideslip"
        return (
            f"hit {name} at ({self.x_m:.2f}, {self.y_m:.2f}) m, {self.s_m:.1f} m into lap {self.lap}, "
            f"t = {self.time_s:.2f} s, {self.speed_m_s:.1f} m/s{way}{self._slid()}"
        )

    def _slid(self) -> str:
        """Return which tires had slid for how long, the longest first; an empty text where none had."""
        times: dict[str, list[str]] = {}
        for wheel in WHEELS:
            times.setdefault(f"{getattr(self, f'slid_{wheel}_s'):.2f} s", []).append(wheel)
        for nothing in ("0.00 s", "nan s"):
            times.pop(nothing, None)
        told = []
        for time, wheels in sorted(times.items(), key=lambda each: float(each[0][:-2]), reverse=True):
            names = " and ".join(wheel.replace("_", " ") for wheel in wheels)
            told.append(f"{_TOGETHER.get(tuple(wheels), names)} for {time}")
        return f"; had slid: {', '.join(told)}" if told else ""


def crash_of(
    world: World,
    states: FloatArray,
    ctrl: FloatArray,
    telemetry: FloatArray,
    timer: Any,
    laps: int,
    period: float,
    row: int = 0,
) -> Crash | None:
    """Return the crash in which a race ended; None where the chassis touches nothing in the last tick.

    Touching another car is no crash.

    The last tick is simulated again, step by step, until the chassis touches something.

    Args:
      world: that was raced.
      states: as in RaceResult, (ticks + 1, n).
      ctrl: as in RaceResult, (ticks, controls).
      telemetry: of the car, (ticks, len(TELEMETRY)).
      timer: row of LAP_TIMER at the end.
      laps: of the race.
      period: of a tick [s].
      row: of the car.
    """
    model, engine = world.model, Engine(world, period=period)
    data, before = mujoco.MjData(model), [0.0, 0.0, 0.0]  # time, speed and sideslip
    engine.load(states[-2] if len(ctrl) else states[0])
    prefix, constants = world.cars[row].prefix, world.cars[row].constants
    chassis = model.geom(f"{prefix}chassis").id
    others = {model.geom(f"{car.prefix}chassis").id for car in world.cars if car.prefix != prefix}
    crashes: list[Crash] = []

    def note(engine: Engine, _: Any) -> None:
        ahead, left = body_velocity(engine.qpos(0), engine.qvel(0), constants)
        angle = sideslip_angle(ahead, left, engine.qvel(0)[constants[0]["free_dof"] + 5], constants)
        before[:] = engine.time(0), math.hypot(ahead, left), 0.0 if math.isnan(angle) else angle

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
            time, speed, angle = map(float, before)
            slid = _slid(telemetry, time, slides_above(tires_of(model, prefix).model))
            crashes.append(
                Crash(
                    into=into, geom=name, time_s=time, x_m=x, y_m=y, speed_m_s=speed, sideslip_rad=angle, lap=done + 1,
                    s_m=s, **{f"slid_{wheel}_s": value for wheel, value in zip(WHEELS, slid, strict=True)},
                )
            )  # fmt: skip

    engine.before_substep.append(note)
    engine.after_substep.append(look)
    engine.drive(controls=ctrl[-1:] if len(ctrl) else engine.ctrl(0)[np.newaxis].copy())
    return crashes[0] if crashes else None


def _slid(telemetry: FloatArray, time: float, above: float) -> list[float]:
    """Return for how long each tire had slid at a time of the last tick [s], faster than `above` [m/s]."""
    speeds = telemetry[:, _SLIDE : _SLIDE + len(WHEELS)]
    if len(speeds) and np.isnan(speeds).all():
        return [math.nan] * len(WHEELS)
    slides = speeds > above
    found = []
    for tire in slides[:-1].T:  # not by the last tick alone, in which the touch itself may slide it
        begin = len(tire) - int(np.argmin(np.append(tire[::-1], False)))
        found.append(time - float(telemetry[begin, _TIME]) if begin < len(tire) else 0.0)
    return found or [0.0] * len(WHEELS)


def _described(geom: str, world: World, point: tuple[float, float], normal: FloatArray, place: float) -> str:
    """Return the description of a geom of a world, for people."""
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


@dataclass(frozen=True, kw_only=True)
class Rollover:
    """The last tick of a car that has rolled over: at its end the car lies on its side or its roof.

    The text is for people: "at (3.10, -0.02) m, in lap 1, t = 2.60 s, 4.1 m/s".
    """

    time_s: float
    x_m: float  # of the rear axle
    y_m: float
    speed_m_s: float  # of the rear axle over the ground; NaN in telemetry without it
    lap: int  # from 1

    @classmethod
    def of(cls, end_reason: object, telemetry: FloatArray) -> Rollover | None:
        """Return the rollover in which a race ended; None: it ended otherwise, or before its first tick.

        Args:
          end_reason: of END_REASONS.
          telemetry: (ticks, len(TELEMETRY)).
        """
        if end_reason != "rolled_over" or len(telemetry) == 0:
            return None
        row = telemetry[-1]
        return cls(
            time_s=float(row[_TIME]), x_m=float(row[_X]), y_m=float(row[_X + 1]), lap=int(row[_LAP]),
            speed_m_s=math.hypot(row[_VX], row[_VX + 1]),
        )  # fmt: skip

    def __str__(self) -> str:
        place = f"at ({self.x_m:.2f}, {self.y_m:.2f}) m, in lap {self.lap}"
        return f"{place}, t = {self.time_s:.2f} s, {self.speed_m_s:.1f} m/s"
