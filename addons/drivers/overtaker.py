"""Overtaker: the gap finder among other cars, from the scan and odometry alone.

Cars are what has moved in the scan (other_cars), with `knows=opponents` those whose odometry is told, as far as they
are in sight. The course ahead of a car is where it is expected to go, with the room to both sides (corridor). Each is
followed or passed, by the room that there is (passing). While it follows, the planner's car drives as the gap finder
does in the scan without cars, so slowly that it could stop behind the car ahead. While it passes, it keeps a lane,
which guidance does not change. The safety filter simulates its stops in the scan without cars, and compares each place
of a stop with the places where the others may be then. A car that has stood for two seconds is an obstacle. So is, once
a car has been met, a thing that stands and is as large as the box on a car: it is drawn into the scan as large as a
car.
Limits: cars are taken to keep their share of the course's width. One that comes up from behind is not seen; nor is one
that is hidden. Without a car that has moved in sight this is the gap finder, to the last bit.

The work is done in native/addons/drivers/overtaker.cpp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fg_mujoco.controllers.control.planner_settings import FROM_ZERO, POSITIVE, record_type, setting
from fg_mujoco.controllers.control.stages import SAFE, NativeStep
from fg_mujoco.controllers.gap_finder import GapFinder, GapFinderSettings
from fg_mujoco.messages import Reading
from fg_mujoco.native import core

from .other_cars import read_told
from .passing import RACING


@dataclass(frozen=True, kw_only=True)
class OvertakerSettings(GapFinderSettings):
    """Parameters of the gap finder, and of the cars that it meets."""

    braking: float = setting(5.0, "m/s^2", "with which another car may stop", POSITIVE)
    car_margin: float = setting(0.06, "m", "round another car", FROM_ZERO)
    least_lead: float = setting(0.2, "s", "for which a car goes on at least", FROM_ZERO)
    closing: float = setting(2.5, "m/s", "faster than a car that it passes, at most", POSITIVE)
    slowing: float = setting(3.0, "m/s^2", "with which the car can slow behind another, in a bend, too", POSITIVE)
    behind: float = setting(0.2, "m", "from a car that it follows, beside what braking takes", FROM_ZERO)
    look_at: float = setting(4.0, "m", "from a car that it may pass", POSITIVE)
    aside: float = setting(0.6, "m", "from a car that it passes, at most", FROM_ZERO)
    beside_wall: float = setting(0.2, "m", "from a wall beside another car, where there is more room", FROM_ZERO)
    patience: float = setting(0.6, "s", "from giving up a pass to the next one", FROM_ZERO)
    clear: float = setting(0.08, "m", "from side to side, from which on it goes faster than a car ahead", FROM_ZERO)
    clear_by_speed: float = setting(0.02, "s", "the same, more for each m/s of the other car", FROM_ZERO)
    room_to_pass: float = setting(0.5, "m", "to a side of another car, for a pass to begin", POSITIVE)
    room_by_speed: float = setting(0.03, "s", "the same, more for each m/s of the other car", FROM_ZERO)
    room_to_go_on: float = setting(0.45, "m", "the same, for it to go on", POSITIVE)


record_type(OvertakerSettings, native=True)  # compared with that of the native core


class Overtaker(GapFinder):
    """The gap finder among other cars."""

    Settings = OvertakerSettings
    assists = {"full": (*SAFE, "guidance")}  # noqa: RUF012 - on a remembered line it would not look out for other cars
    memory_type = RACING
    hides_cars = True
    refer = NativeStep("overtake")

    @staticmethod
    def read(memory: Any, readings: Mapping[str, Reading]) -> None:
        """Put the odometry of the other cars, where the planner is told of it, into its memory."""
        if "opponents" in readings:
            read_told(memory["told"], readings["opponents"])


hide_cars = core.hide_cars
