"""Random settings of an environment: `randomize`, read and checked before anything is driven."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..course.course import Course, laps_to_drive
from ..errors import SettingsError
from ..messages import shown
from ..racing.entries import Entry
from ..racing.randomization import OF_OPPONENTS, OF_PLANNERS, PLANNER, Randomization, course_range
from ..simulation.course_loading import load_track
from ..simulation.settings import CarSettings
from ..vehicle.vehicle import Vehicle


def read_randomization(
    given: Any, track: Course | str | Sequence[Course | str], settings: CarSettings, *, laps: int, opponents: int
) -> Randomization:
    """Return what an environment draws; a list of tracks is the range of the track.

    Raises:
      SettingsError: a name that environments do not draw, a value given for all episodes, too, or that cannot be had.
      TrackError: a course of the range, other than a random circuit, that cannot be built or does not fit the car.
    """
    if not isinstance(given, (Mapping, Randomization)):
        raise SettingsError(f'randomize is {shown(given)}; accepted: ranges by name, such as {{"mu": (0.5, 1.1)}}')
    made = given if isinstance(given, Randomization) else Randomization.of(given)
    if isinstance(track, (list, tuple)):
        courses = course_range(track)
        if made.ranges.get("track", courses) != courses:
            raise SettingsError("track is a list, and in randomize; accepted: one of them")
        made = Randomization({**made.ranges, "track": courses})
    elif "track" in made.ranges and track != "oval":
        raise SettingsError("track is given for all worlds and in randomize; accepted: one of them")
    if "opponents" not in made.ranges and opponents == 0:
        made.require_usable("an environment", OF_OPPONENTS, "it has no opponents")
    if made.ranges and made != given:
        check_randomization(made, settings, laps=laps)
    return made


def check_randomization(randomization: Randomization, settings: CarSettings, *, laps: int) -> None:
    """Refuse what an environment of some settings cannot draw; arguments and errors as of `read_randomization`."""
    ranges = randomization.ranges
    randomization.require_usable("an environment", (*OF_PLANNERS, PLANNER), "a policy drives in the planner's place")
    if "patches" in ranges and "patch_mu" not in ranges:
        raise SettingsError("randomize patches without patch_mu; accepted: the range of their friction, too")
    if "patch_mu" in ranges and settings.patches:
        raise SettingsError("patches is given for all worlds and patch_mu in randomize; accepted: one of them")
    randomization.check_base(settings, besides=("track", "opponents"))
    drawn = ranges["vehicle"].extremes if "vehicle" in ranges else (settings.car,)
    vehicles = [Vehicle.load(vehicle) for vehicle in drawn]  # type: ignore[arg-type]
    for vehicle in vehicles[1:]:
        if vehicle.lidar.beams.geometry != vehicles[0].lidar.beams.geometry:
            names = f"{vehicles[0].name!r} and {vehicle.name!r}"
            raise SettingsError(f"randomize vehicle: {names} have LiDARs with other beams; accepted: the same in all")
    for source in dict.fromkeys(ranges["track"].extremes if "track" in ranges else ()):
        if not str(source).startswith("random:"):
            for vehicle in vehicles:
                course = load_track(str(source), car=vehicle.parameters)
                course.check_car(vehicle.parameters)
                laps_to_drive(course, laps)


def all_opponents(randomization: Randomization, given: Sequence[Entry]) -> tuple[Any, ...]:
    """Return the opponents of each world, of which as many take part in an episode as it draws."""
    ranges = randomization.ranges
    if "opponents" not in ranges:
        return tuple(given)
    most = max(int(number) for number in ranges["opponents"].extremes)
    who = ranges["opponent"].extremes[0] if "opponent" in ranges else "gap_finder"
    return (*given, *[who] * (most - len(given)))
