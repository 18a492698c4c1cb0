"""Pictures and tables of scans, courses and races in a notebook, as SVG and HTML, which need no extra."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from html import escape
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fg_mujoco.course.course import Course, describe_course, wall_outlines
from fg_mujoco.course.moving_obstacles import MovingObstacle
from fg_mujoco.course.obstacles import Obstacle
from fg_mujoco.display import Shown, paragraph, table
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import FloatArray, LaserScan
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.simulation.cars import car_colour_hex
from fg_mujoco.simulation.settings import friction_text
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.tire_slip import share_text, sliding_text

_SIZE = (560.0, 420.0)  # [px] greatest width and height of a drawing, without its strip
_STRIP = 26.0  # [px] below a drawing, for its scale and its legend
_MOST_POINTS = 4000  # of one line; more are not seen at this size
_FONT = 'font-family="sans-serif" font-size="11"'
_MARGIN = 0.5  # [m] round the walls
_FLOOR, _WALL, _EDGE, _OBSTACLE, _LINE = "#f2f2f2", "#777777", "#404040", "#d9732b", "#8c8c8c"
_COLOURS = ("#440154", "#46327e", "#365c8d", "#277f8e", "#1fa187", "#4ac16d", "#a0da39", "#fde725")  # viridis
_ALERT = "#d00000"
_MOST_TICKS = 8000  # of the line, 200 s: more would cover each other, and make the picture slow
_SCAN_DOT, _SCAN_CAR = "#0072b2", "#d55e00"


def notebook_html(thing: Shown) -> str:
    """Return what a notebook shows of a scan, a course or the result of a race."""
    if isinstance(thing, LaserScan):
        return _scan_html(thing)
    if isinstance(thing, RaceResult):
        return _race_html(thing)
    return _course_html(cast(Course, thing))


def show(thing: Shown, path: str | Path | None = None) -> None:
    """Show what `_repr_html_` returns; arguments and errors are those of `Shown.show`."""
    if path is not None and Path(path).suffix.lower() not in (".html", ".htm"):
        raise SettingsError(f"show: path is {str(path)!r}; accepted: a file that ends in .html")
    in_notebook = _in_notebook()
    if in_notebook:
        from IPython.display import display

        display(thing)
    if path is None and in_notebook:
        return
    page = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(repr(thing))}</title></head>\n'
        f'<body style="font-family:sans-serif">\n{thing._repr_html_()}\n</body></html>\n'
    )
    if path is None:
        import tempfile

        descriptor, name = tempfile.mkstemp(prefix="fg_mujoco-", suffix=".html")
        os.close(descriptor)
        written = Path(name)
    else:
        written = Path(path)
    try:
        written.write_text(page, encoding="utf-8", errors="backslashreplace")
    except OSError:  # half a page is of no use
        with suppress(OSError):
            written.unlink()
        raise
    print(f"picture: {written}")
    if path is None and _has_display():
        _open(written)


def _in_notebook() -> bool:
    """Return whether this is a cell of a notebook. IPython in a terminal has no kernel."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


def _has_display() -> bool:
    """Return whether a person sits in front of this terminal, at a machine with a display."""
    graphical = sys.platform in ("darwin", "win32") or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )
    return graphical and sys.stdout.isatty()


def _open(page: Path) -> None:
    """Open a page in the browser, unless that is one that would take over the terminal."""
    import webbrowser

    try:
        browser = webbrowser.get()
        if type(browser) is not webbrowser.GenericBrowser:  # a text browser, which runs until it is left
            browser.open(page.absolute().as_uri())
    except webbrowser.Error:
        pass  # the place of the page is printed


def _scan_html(scan: LaserScan) -> str:
    """Return a scan from above, one dot for each beam that ended."""
    found = np.isfinite(scan.ranges) & (scan.ranges < scan.range_max)
    distances, bearings = scan.ranges[found], scan.bearings[found]
    points = distances[:, np.newaxis] * np.column_stack((np.cos(bearings), np.sin(bearings)))
    corners = np.concatenate((points, [[-1.0, -1.0], [1.0, 1.0]]))
    drawing = Drawing(corners.min(axis=0) - 0.3, corners.max(axis=0) + 0.3)
    drawing.points(points, _SCAN_DOT)
    drawing.arrow((0.0, 0.0), 0.0, _SCAN_CAR)
    drawing.scale()
    said = "Each dot is where a beam ended. The arrow is at the LiDAR and points ahead."
    return paragraph(repr(scan)) + drawing.svg(said) + paragraph(said)


def _race_html(result: RaceResult) -> str:
    """Return what a notebook shows of a race: its figures, and the line of the car."""
    if len(result.cars) > 1:
        return _html_of_several(result)
    car = result.car
    rows = [
        ("planner, track, car", f"{car.controller}, {result.track}, {car.vehicle}"),
        ("assist", car.assist),
        ("end", f"{car.end_reason.replace('_', ' ')}: {car.end}"),
        *(_lap_rows(result) if result.laps_requested else [("time", f"{result.sim_time_s:.2f} s")]),
        ("speed", f"mean {car.mean_speed_m_s:.2f} m/s, greatest {car.max_speed_m_s:.2f} m/s"),
        ("greatest sliding", sliding_text(car.max_slide_m_s, 3)),
        ("time sliding", share_text(car.slide_time_fraction)),
        *([("fastest sliding", car.max_slide_place)] if car.max_slide_place else []),
        ("friction coefficient", friction_text(car.mu, car.planner_mu, car.floor)),
    ]
    ends = (("crashed here", car.crash), ("turned here", car.wrong_way), ("rolled over here", car.rollover))
    marks = [(text, (place.x_m, place.y_m)) for text, place in ends if place is not None]
    line = np.column_stack((car.column("x_m"), car.column("y_m")))
    place, speed = (result.world.track, result.world.obstacles), car.column("speed_m_s")
    picture = driven_line(*place, line, speed, time=result.sim_time_s, marks=marks, title=repr(result))
    return table((), rows) + picture


def _html_of_several(result: RaceResult) -> str:
    """Return what a notebook shows of several cars: a row for each, and the lines of all."""
    head = [
        ("track, laps", f"{result.track}, {result.laps_requested}"),
        ("winner", result.winner or "nobody finished"),
        ("overtakes, contacts", f"{len(result.overtakes)}, {len(result.contacts)}"),
    ]
    rows = []
    for index in sorted(range(len(result.cars)), key=lambda index: result.cars[index].position):
        car = result.cars[index]
        best = f"{min(car.lap_times_s):.2f} s" if car.lap_times_s else "-"
        end = f"{car.end_reason.replace('_', ' ')} at {car.end_time_s:.2f} s"
        rows.append((
            f"{car.position}.", index, car.name, f"{car.controller}, {car.vehicle}", car.laps_completed, best, end,
            car.collisions_car, sliding_text(car.max_slide_m_s, 3),
        ))  # fmt: skip
    header = ("", "car", "name", "planner, vehicle", "laps", "best lap", "end", "contacts", "greatest sliding")
    lines = []
    for car in result.cars:
        raced = car.column("time_s") < car.end_time_s - 1e-9  # one that has finished is taken off the course
        lines.append(np.column_stack((car.column("x_m"), car.column("y_m")))[raced])
    contacts = [(contact.x_m, contact.y_m) for contact in result.contacts]
    picture = driven_lines(result.world, lines, time=result.sim_time_s, contacts=contacts, title=repr(result))
    return table((), head) + table(header, rows) + picture


def _lap_rows(result: RaceResult) -> list[tuple[str, str]]:
    """Return what a notebook shows of the laps."""
    car = result.car
    laps = ", ".join(f"{time:.2f}" for time in car.lap_times_s[:10])
    more = f" and {len(car.lap_times_s) - 10} more" if len(car.lap_times_s) > 10 else ""
    return [
        ("laps", f"{car.laps_completed} of {result.laps_requested} in {result.sim_time_s:.2f} s"),
        ("lap times", f"{laps}{more} s" if laps else "no lap completed"),
    ]


def plan(
    course: Course,
    *,
    obstacles: Iterable[Obstacle] | None = None,
    moving: Iterable[MovingObstacle] | None = None,
    time: float = 0.0,
    line: bool = True,
    around: FloatArray | None = None,
) -> Drawing:
    """Return a drawing of a course: walls, line, start with its direction, goal, obstacles, and a scale in metres.

    Obstacles that are None are the course's own; moving ones are drawn at `time` [s]. There is room for the points
    `around` (n, 2) [m].
    """
    outlines = wall_outlines(course)
    points = np.concatenate((course.bounds, *outlines, *([] if around is None else [around])))
    drawing = Drawing(points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN)
    if course.edges:
        drawing.area(course.edges[:2], _FLOOR, _EDGE)
    solid = course.edges[2:] if course.edges else outlines
    for outline in solid:
        drawing.area([outline], _WALL, _EDGE)
    if line and math.isfinite(course.length):
        drawing.line(course.map_line.points, _LINE, width=0.8, closed=course.closed, dashes="6 4")
    for obstacle in course.obstacles if obstacles is None else obstacles:
        drawing.area([obstacle.corners()], _OBSTACLE, _OBSTACLE)
    for mover in course.moving if moving is None else moving:
        drawing.line([mover.start, mover.end], _OBSTACLE, width=0.8, dashes="3 3")
        drawing.area([mover.corners(time)], _OBSTACLE, "black")
    for ends in course.ground_lines:
        drawing.line(ends, "black", width=1.8)
    x, y, heading = course.start_pose()
    drawing.arrow((x, y), heading, "black")
    drawing.scale()
    return drawing


def _course_html(course: Course) -> str:
    """Return a course from above, with its description."""
    said = describe_course(course)
    return paragraph(said) + plan(course).svg(said)


def driven_line(
    course: Course,
    obstacles: Sequence[Obstacle],
    line: FloatArray,
    speed: FloatArray,
    *,
    time: float,
    marks: Iterable[tuple[str, tuple[float, float]]],
    title: str,
) -> str:
    """Return the picture of a drive as SVG.

    `line` (ticks, 2) [m] and `speed` (ticks,) [m/s] are of the start of each tick; of a longer drive the last 8000
    ticks are drawn. Moving obstacles are drawn at `time` [s]. `marks` are texts, and the places that they are written
    at [m].
    """
    drawing = plan(course, obstacles=obstacles, time=time, line=False, around=line)
    line, speed = line[-_MOST_TICKS:], speed[-_MOST_TICKS:]
    speed = np.where(np.isfinite(speed), speed, 0.0)
    fastest = max(float(speed.max(initial=0.0)), 1.0)
    bands = (speed.clip(0.0) / fastest * (len(_COLOURS) - 1e-9)).astype(int)
    starts = np.flatnonzero(np.diff(bands, prepend=-1))  # where the colour changes
    for start, end in zip(starts, (*starts, len(bands))[1:], strict=True):
        drawing.line(line[start : end + 1], _COLOURS[bands[start]], width=2.2)
    for text, place in marks:
        drawing.cross(place, text, _ALERT)
    drawing.legend(_COLOURS, "0", f"{fastest:.1f} m/s")
    return drawing.svg(title)


def driven_lines(
    world: World, lines: Sequence[FloatArray], *, time: float, contacts: Iterable[tuple[float, float]], title: str
) -> str:
    """Return the picture of a race of several cars as SVG, the line (ticks, 2) [m] of each in its colour.

    Of longer ones the last 8000 ticks are drawn. `time` [s] is that of moving obstacles, `contacts` are where two cars
    touched [m].
    """
    around = np.concatenate(lines)
    drawing = plan(world.track, obstacles=world.obstacles, moving=world.moving, time=time, line=False, around=around)
    for index, line in enumerate(lines):
        drawing.line(line[-_MOST_TICKS:], car_colour_hex(index), width=1.8)
    for place in contacts:
        drawing.cross(place, "", _ALERT)
    drawing.legend([car_colour_hex(index) for index in range(len(lines))], "car 0", f"car {len(lines) - 1}")
    return drawing.svg(title)


class Drawing:
    """A drawing to scale, as SVG, from `low` to `high`. Positions are in metres, x to the right and y up."""

    def __init__(self, low: ArrayLike, high: ArrayLike) -> None:
        self._low, self._high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        span = np.maximum(self._high - self._low, 1e-3)
        self._scale = float(np.min(np.array(_SIZE) / span))  # [px/m]
        self._size = (max(self._scale * float(span[0]), 240.0), self._scale * float(span[1]))  # [px]
        self._parts: list[str] = []

    def line(
        self, points: ArrayLike, colour: str, *, width: float = 1.2, closed: bool = False, dashes: str = ""
    ) -> None:
        """Draw a line through points (n, 2) [m], `width` [px] wide."""
        path = self._path(points) + ("Z" if closed else "")
        dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
        style = f'stroke-width="{width:g}" stroke-linejoin="round" stroke-linecap="round"{dashed}'
        self._parts.append(f'<path d="{path}" fill="none" stroke="{colour}" {style}/>')

    def area(self, outlines: Iterable[ArrayLike], fill: str, edge: str) -> None:
        """Fill what is inside of an odd number of closed outlines (n, 2) [m]."""
        path = "".join(self._path(outline) + "Z" for outline in outlines)
        self._parts.append(f'<path d="{path}" fill="{fill}" fill-rule="evenodd" stroke="{edge}" stroke-width="0.8"/>')

    def points(self, points: ArrayLike, colour: str) -> None:
        """Draw dots at points (n, 2) [m]."""
        dots = "".join(f"M{x:g} {y:g}h0" for x, y in self._pixels(points).tolist())
        self._parts.append(f'<path d="{dots}" stroke="{colour}" stroke-width="2" stroke-linecap="round"/>')

    def arrow(self, tail: ArrayLike, heading: float, colour: str) -> None:
        """Draw an arrow from a point (2,) [m] in a direction [rad]."""
        ahead = np.array([math.cos(heading), math.sin(heading)]) / self._scale
        aside = np.array([-ahead[1], ahead[0]])
        start = np.asarray(tail, np.float64)
        self.line([start, start + 16.0 * ahead], colour)
        head = (start + 26.0 * ahead, start + 15.0 * ahead + 4.0 * aside, start + 15.0 * ahead - 4.0 * aside)
        self.area([head], colour, colour)

    def cross(self, point: tuple[float, float], text: str, colour: str) -> None:
        """Mark a point [m] with a cross, and write a text next to it."""
        (found,) = [self._pixels([point])]
        for x, y in found.tolist():
            self._parts.append(
                f'<path d="M{x - 5:g} {y - 5:g}l10 10m0 -10l-10 10" stroke="{colour}" stroke-width="2.4"/>'
            )
            right = x > 0.5 * self._size[0]  # where the drawing has room
            self._write(text, x - 9 if right else x + 9, max(y - 8, 12.0), "end" if right else "start", colour)

    def scale(self) -> None:
        """Draw a line of a round number of metres below the drawing."""
        wanted = 0.2 * self._size[0] / self._scale
        power = 10.0 ** math.floor(math.log10(wanted))
        metres = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted)
        y, end = self._size[1] + 0.5 * _STRIP, 8.0 + metres * self._scale
        self._parts.append(f'<path d="M8 {y - 4:.1f}v8m0 -4H{end:.1f}m0 -4v8" fill="none" stroke="black"/>')
        self._write(f"{metres:g} m", end + 6.0, y + 4.0, "start", "black")

    def legend(self, colours: Sequence[str], least: str, greatest: str) -> None:
        """Draw a bar of colours below the drawing, with what its ends are."""
        y, step = self._size[1] + 0.5 * _STRIP, 10.0
        right = self._size[0] - 62.0
        left = right - step * len(colours)
        for place, colour in enumerate(colours):
            at = f'x="{left + place * step:.1f}" y="{y - 5:.1f}" width="{step:g}" height="10"'
            self._parts.append(f'<rect {at} fill="{colour}"/>')
        self._write(least, left - 5.0, y + 4.0, "end", "black")
        self._write(greatest, right + 5.0, y + 4.0, "start", "black")

    def svg(self, title: str) -> str:
        """Return the drawing; the title is for screen readers."""
        width, height = self._size[0], self._size[1] + _STRIP
        frame = f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.1f} {height:.1f}"'
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" role="img" {frame} style="max-width:100%;background:white">'
            f"<title>{escape(title)}</title>{''.join(self._parts)}</svg>"
        )

    def _write(self, text: str, x: float, y: float, anchor: str, colour: str) -> None:
        place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"'
        self._parts.append(f'<text {place} fill="{colour}" {_FONT}>{escape(text)}</text>')

    def _path(self, points: ArrayLike) -> str:
        return "M" + "L".join(f"{x:g} {y:g}" for x, y in self._pixels(points).tolist())

    def _pixels(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the places of points in the picture, without those that are not finite. Shape (k, 2) [px]."""
        found = np.asarray(points, np.float64).reshape(-1, 2)
        found = found[np.isfinite(found).all(axis=1)]
        found = np.concatenate((found[: -1 : max(1, math.ceil(len(found) / _MOST_POINTS))], found[-1:]))
        shown: NDArray[np.float64] = np.round((found - (self._low[0], self._high[1])) * (self._scale, -self._scale), 1)
        return shown
