"""A drive without a planner: commands over time, or a manoeuvre, on open ground, with the result of a race."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..course.open_ground import OpenGround
from ..errors import SettingsError
from ..racing.race import RaceProgress, race_setup
from ..racing.result import RaceResult
from ..racing.setup import OF_A_CAR, Setup, SetupKeywords
from ..simulation.settings import GREATEST_SPEED, CarSettings, Start
from .commands import SUFFIX, CommandPlayer, Commands
from .manoeuvres import Manoeuvre, find_manoeuvre

if TYPE_CHECKING:
    from typing_extensions import Unpack


_USABLE = (*OF_A_CAR, "patches", "sensors", "start", "lidar", "name")
"""Fields of a Setup that mean something where no planner drives."""

_LEAST_LIMIT = 0.1  # [m/s] of `speed_limit_m_s`, which is the greatest command


def drive(
    commands: Commands | Manoeuvre | str | Path,
    *,
    speed: float | None = None,
    setup: Setup | None = None,
    watch: Callable[[RaceProgress], None] | None = None,
    **keywords: Unpack[SetupKeywords],
) -> RaceResult:
    """Drive commands over time on open ground, and return how it went.

    Args:
      commands: a manoeuvre's name, with settings in brackets where wanted, as `circle[radius=2,speed=3]`; the path of a
        CSV file with the columns time_s, steering_angle_rad and speed_m_s; Commands, or a Manoeuvre.
      speed: at which a manoeuvre is driven [m/s]; None: its own.
      setup: that the keywords change.
      watch: called once a tick.
      keywords: of a Setup, see there, that say which car drives: `vehicle`, `tires`, `mu`, `changes`; `patches` of
        the floor; and `start`: x (`s`), y (`offset`), heading and speed at which it starts, without it at the origin
        along x, wheels rolling at the first commanded speed.

    Returns:
      A RaceResult without laps, whose `controller` names the commands. `clamped_commands` counts those beyond the car's
      limits of steering angle and speed, which the car holds within them, as it does with a planner's.

    Raises:
      SettingsError: commands that cannot be read or driven, or settings of a planner or a course.
      ModelError: a file that is not that of a vehicle.
    """
    given = Setup.of(setup, caller="drive", **keywords)
    given.require_usable("drive", *_USABLE, alone=True)
    table = find_commands(commands, given.first, speed)
    fastest = min(max(float(np.abs(table.speed).max()), _LEAST_LIMIT), GREATEST_SPEED)
    start = given.first.start or Start(speed=float(table.speed[0]))
    raced = given.replace(
        track=OpenGround(seconds=table.seconds), controller=CommandPlayer(table), planner_mu=math.inf,
        max_speed=fastest, start=start,
    )  # fmt: skip
    result = race_setup(raced, watch=watch)
    nobody = dict.fromkeys(result.car.controller_origin) | {"commands": table.name}
    car = replace(result.car, controller=table.name, controller_origin=nobody, controller_source=None)
    return replace(result, cars=(car,))


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
