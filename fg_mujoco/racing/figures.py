"""The figures of a race that follow from what was driven: a race takes them, and a replay takes them again.

    trajectory = history.arrays()
    figures = {**driven_figures(engine, trajectory["telemetry"]), **course_figures(engine, trajectory)}

Names are those of CarResult and RaceResult, and of the summary.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

from ..messages import FloatArray
from ..simulation.engine import Engine
from ..simulation.telemetry import StatisticsFigures, column_index, statistics_figures
from ..simulation.termination import END_REASONS, WrongWay
from ..simulation.world import OBSTACLE_PREFIX
from .result import Trajectory, clamped_commands, trajectory_sha256

if TYPE_CHECKING:
    from .crash import Crash


class DrivenFigures(StatisticsFigures):
    """Figures of a car from the trajectory and the world's model alone."""

    collisions_wall: int
    clamped_commands: int
    mu: float


class CourseFigures(TypedDict):
    """Figures of a car from the trajectory, the course and the rules of the race."""

    laps_completed: int
    lap_times_s: tuple[float, ...]
    finished: bool
    end_reason: str
    wrong_way: WrongWay | None
    crash: Crash | None


class WorldFigures(TypedDict):
    """Figures of all cars together, from the trajectory and the world."""

    sim_time_s: float
    trajectory_sha256: str


class TrackFigures(TypedDict):
    """Figures of the course, from the world."""

    track: str
    obstacles: int


def driven_figures(engine: Engine, telemetry: FloatArray, row: int = 0, put_back: int = 0) -> DrivenFigures:
    """Return the figures of a car of world 0 that need no course.

    Args:
      engine: at the end of the race.
      telemetry: of the car (ticks, len(TELEMETRY)).
      row: of the car.
      put_back: how often race control has put it back after it had touched a wall.
    """
    car = engine.world.cars[row]
    return {
        **statistics_figures(engine.statistics[row]),
        "collisions_wall": put_back + int(engine.crashed[row]),
        "clamped_commands": clamped_commands(telemetry, car.parameters),
        "mu": car.mu,
    }


def world_figures(trajectory: Trajectory) -> WorldFigures:
    """Return the figures of all cars together."""
    states = trajectory["states"]
    return {
        "sim_time_s": float(states[-1, 0]),  # mjSTATE_TIME comes first in a state
        "trajectory_sha256": trajectory_sha256(states, trajectory["ctrl"]),
    }


def track_figures(engine: Engine) -> TrackFigures:
    """Return the name of the course, and how many obstacles stand on it besides its own."""
    model, course = engine.world.model, engine.world.track
    geoms = (model.geom(i).name for i in range(model.ngeom))
    placed = sum(name.startswith(OBSTACLE_PREFIX) for name in geoms) - len(course.obstacles)
    return {"track": course.name, "obstacles": placed}


def course_figures(engine: Engine, trajectory: Trajectory, row: int = 0) -> CourseFigures:
    """Return the figures of the race of a car of world 0 on its course, as its monitor has judged it.

    The trajectory ends with the tick in which that car's race was over.
    """
    world, monitor = engine.world, engine.monitor
    course, timer, laps = world.track, monitor.timers[row], monitor.laps
    reason = END_REASONS[monitor.reasons[row]]
    crash = None
    if reason == "crash":
        from .crash import crash_of

        crash = crash_of(world, **trajectory, timer=timer, laps=laps, period=engine.period, row=row)
    wrong_way = None
    if reason == "wrong_way":
        time, speed = (trajectory["telemetry"][:, column_index(name)] for name in ("time_s", "vx_m_s"))
        wrong_way = WrongWay.of(timer, course.length, laps, float(speed[time >= timer["furthest_time"]].mean()))
    lap_times = tuple(monitor.lap_times[row, : int(timer["laps_completed"])].tolist())
    return {
        "laps_completed": len(lap_times),
        "lap_times_s": lap_times,
        "finished": reason == "finished",
        "end_reason": reason,
        "wrong_way": wrong_way,
        "crash": crash,
    }
