"""A few seconds of a run as a video that a page can hold in itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fg_mujoco.course.writing import temporary_folder
from fg_mujoco.errors import MissingExtraError
from fg_mujoco.pictures.pages.page import data_url
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.racing.run_folder import Run

from .laps_and_slides import SlideEvent

SIZE = (640, 360)  # [px]
FRAME_RATE = 20.0  # [1/s]
_BEFORE = 2.0  # [s] that are shown before the crash or slide


@dataclass(frozen=True, kw_only=True)
class Clip:
    """A video, or why there is none."""

    video: str = ""  # MP4, as a page has it in itself
    start: float = 0.0  # [s] in the race
    end: float = 0.0  # [s]
    missing: str = ""  # why there is none


def followed(contact: Mapping[str, Any]) -> str:
    """Return the name of the car that pictures of a contact follow: the one at fault, or the first of the two."""
    cars = contact.get("cars") or (contact["at_fault"],)
    return str(contact["at_fault"] if contact["at_fault"] in cars else cars[0])


def clip_of_several(
    seconds: float, end: float, contacts: Sequence[Mapping[str, Any]], overtakes: Sequence[Mapping[str, Any]]
) -> tuple[float, str] | None:
    """Return when a clip begins [s], and who is followed: at fault for the hardest contact, or first to overtake."""
    if contacts:
        hardest = max(contacts, key=lambda contact: float(contact["impulse_Ns"]))
        time, who = hardest["time_s"], followed(hardest)
    elif overtakes:
        time, who = overtakes[0]["time_s"], overtakes[0]["by"]
    else:
        return None
    return min(max(float(time) - _BEFORE, 0.0), max(end - seconds, 0.0)), str(who)


def clip_start(
    seconds: float, end: float, lap_times: tuple[float, ...], events: tuple[SlideEvent, ...], crashed: bool
) -> float:
    """Return when a clip of so many seconds begins [s]: before the crash, the worst slide, or with the best lap."""
    latest = max(end - seconds, 0.0)
    if crashed:
        return latest
    if events:
        worst = max(events, key=lambda event: event.greatest)
        return min(max(worst.start - _BEFORE, 0.0), latest)
    if lap_times:
        best = min(range(len(lap_times)), key=lap_times.__getitem__)
        return min(sum(lap_times[:best]), latest)
    return 0.0


def make_clip(
    source: RaceResult | Run | str | Path,
    start: float,
    end: float,
    watch: Callable[[int, int, str], None] | None = None,
    *,
    car: int = 0,
) -> Clip:
    """Draw a clip of a run from one time to another [s]; `car` is followed, and `watch` told how many frames are done.

    Where the extra `render` or OpenGL is missing, the Clip says what installs it, and has no video.
    """
    try:
        from fg_mujoco.pictures.rendering import Film, write_video

        with (
            temporary_folder("the clip of the page") as folder,
            Film(source, camera="chase", car=car, size=SIZE, quality="draft") as film,
        ):
            path = folder / "clip.mp4"

            count = len(film.times(FRAME_RATE, start, end))

            def frames() -> Iterator[Any]:
                for done, frame in enumerate(film.frames(FRAME_RATE, start, end), start=1):
                    yield frame
                    if watch is not None:
                        watch(done, count, "frame")

            write_video(path, frames(), size=film.size, fps=FRAME_RATE, quality="draft")
            video = data_url("video/mp4", path.read_bytes())
    except MissingExtraError as error:
        return Clip(missing=str(error))
    return Clip(video=video, start=start, end=end)
