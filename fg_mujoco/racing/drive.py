"""A drive without a planner: commands over time, or a manoeuvre, on open ground.

    result = drive("circle[radius=2,speed=3]", mu=0.7)
    print(handling(result))

Commands are sampled once a tick, 25 ms, as a planner's are, and held until the next. The result is that of a race
without laps, and is written, replayed, reported and rendered like one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..course.open_ground import OpenGround
from ..errors import SettingsError
from ..simulation.settings import GREATEST_SPEED, CarSettings, Start
from ..vehicle.changes import CarChanges
from ..vehicle.tires import Tires
from ..vehicle.vehicle import DEFAULT_VEHICLE, Vehicle
from .commands import SUFFIX, CommandPlayer, Commands
from .manoeuvres import Manoeuvre, find_manoeuvre
from .race import RaceProgress, race
from .result import RaceResult

_LEAST_LIMIT = 0.1  # [m/s] of `speed_limit_m_s`, which is the greatest command


def drive(
    commands: Commands | Manoeuvre | str | Path,
    *,
    speed: float | None = None,
    vehicle: Vehicle | str | Path = DEFAULT_VEHICLE,
    tires: Tires | str | Path | None = None,
    mu: float | None = None,
    changes: CarChanges | None = None,
    start: Start | None = None,
    watch: Callable[[RaceProgress], None] | None = None,
) -> RaceResult:
    """Drive commands over time on open ground, and return how it went.

    Args:
      commands: a manoeuvre's name, with settings in brackets where wanted, as `circle[radius=2,speed=3]`; the path of a
        CSV file with the columns time_s, steering_angle_rad and speed_m_s; Commands, or a Manoeuvre.
      speed: at which a manoeuvre is driven [m/s]; None: its own.
      vehicle: a bundled name, the path of a vehicle's MJCF file, or a Vehicle.
      tires: a bundled set, the path of a TOML file, or Tires; None: the vehicle's.
      mu: friction coefficient of the tires, or the greatest peak of those with a curve; None: as in their file.
      changes: what else differs from the vehicle's MJCF.
      start: x (`s`), y (`offset`), heading and speed at which it starts; None: at the origin along x, wheels rolling at
        the first commanded speed.
      watch: called once a tick.

    Returns:
      A RaceResult without laps, whose `controller` names the commands. `clamped_commands` counts those beyond the car's
      limits of steering angle and speed, which the car holds within them, as it does with a planner's.

    Raises:
      SettingsError: commands that cannot be read or driven.
      ModelError: a file that is not that of a vehicle.
    """
    settings = CarSettings(vehicle=vehicle, tires=tires, mu=mu, changes=changes or CarChanges())
    table = find_commands(commands, settings, speed)
    fastest = min(max(float(np.abs(table.speed).max()), _LEAST_LIMIT), GREATEST_SPEED)
    ground = OpenGround(seconds=table.seconds)
    result = race(
        ground, CommandPlayer(table), vehicle=settings.car, tires=tires, mu=mu, changes=changes,
        planner_mu=math.inf, max_speed=fastest, start=start or Start(speed=float(table.speed[0])), watch=watch,
    )  # fmt: skip
    nobody = dict.fromkeys(result.controller_origin)
    return replace(result, controller=table.name, controller_origin=nobody, controller_source=None)


def find_commands(
    commands: Commands | Manoeuvre | str | Path, settings: CarSettings, speed: float | None = None
) -> Commands:
    """Return the commands that `drive` means; arguments and errors as there."""
    if isinstance(commands, str) and not commands.lower().endswith(SUFFIX):
        commands = find_manoeuvre(commands, speed)
    elif speed is not None:
        raise SettingsError(f"speed is {speed!r}, and the commands have their own; accepted: with a manoeuvre's name")
    if isinstance(commands, Commands):
        return commands
    if isinstance(commands, Manoeuvre):
        mu = settings.all_changes.mu
        return commands.commands(settings.car.parameters, settings.car.nominal_mu if mu is None else mu)
    return Commands.read(commands)
