"""The strip along a picture's lower edge: lap and time, speed and the law's limit, steering, tires; and the legend.

The law's limit is the speed at which the tires hold the car on the circle of its present steering angle,
v = sqrt(g mu b / tan|d|), with the mu that the planner assumes (the notes of the field's gap_finder_base).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import missing_extra
from ...messages import CarParameters
from ...simulation.telemetry import TELEMETRY
from ...vehicle.car import WHEELS
from ...vehicle.tire_slip import slides_above
from ...vehicle.tires import CONTACT
from .colours import STAGES, friction_colour
from .recorded_drive import Drive

_BACK = np.array((16.0, 20.0, 27.0))
_COVER = 0.80  # of the picture under the strip
_LEAST_TEXT = 9.0  # [px] height of a tire's bar that has room for its name
_WHITE, _GREY, _DIM = (245, 247, 250), (160, 168, 178), (72, 80, 92)
_BLUE, _AMBER, _RED, _GREEN = (92, 168, 255), (255, 188, 66), (255, 74, 64), (74, 208, 112)

Picture = NDArray[np.uint8]


def require_pillow() -> None:
    """Raise MissingExtraError, with the command that installs it, if there is no Pillow."""
    import importlib.util

    if importlib.util.find_spec("PIL") is None:
        raise missing_extra("3D pictures and videos need Pillow and ffmpeg", "render")


def strip_height(height: int) -> int:
    """Return the height of the strip in a picture [px]."""
    return min(max(round(0.105 * height), 30), height // 3)


def law_limit(steering_angle: float, mu: float, car: CarParameters) -> float:
    """Return the friction law's speed limit [m/s] at a steering angle [rad]; inf straight ahead."""
    slope = math.tan(abs(steering_angle))
    return math.sqrt(car.gravity * mu * car.wheelbase / slope) if slope > 0.0 else math.inf


def draw_strip(picture: Picture, drive: Drive, time: float, car: CarParameters) -> None:
    """Draw the strip of a time [s] onto a picture (height, width, 3)."""
    from PIL import Image, ImageDraw

    rows = strip_height(picture.shape[0])
    under = picture[-rows:].astype(np.float32)
    image = Image.fromarray((under * (1.0 - _COVER) + _BACK * _COVER).astype(np.uint8))
    if len(drive.telemetry):
        row = dict(zip(TELEMETRY, drive.telemetry[drive.tick_at(time)].tolist(), strict=True))
        assumed = drive.summary.get("planner_mu")
        mu = math.inf if assumed is None else float(assumed)
        limit = law_limit(row["steering_angle_rad"], mu, car)
        strip = _Strip(ImageDraw.Draw(image), image.width, rows)
        strip.draw(row, time, limit, drive.summary, car, _names_of(drive, time))
    picture[-rows:] = np.asarray(image)


def _names_of(drive: Drive, time: float) -> tuple[str, ...]:
    """Return the car's name among several with its place at a time [s], the longest first; empty for a single car."""
    if drive.standings is None:
        return ()
    positions = drive.standings.positions[:, drive.tick_at(time)]
    place = f"P{positions[drive.car]}/{len(positions)}"
    name = str(drive.summary["cars"][drive.car]["name"])
    return (f"{name}  {place}", f"CAR {drive.car}  {place}", place)


class _Strip:
    """Lays out panels from left to right; a narrow picture has fewer."""

    def __init__(self, pen: Any, width: int, rows: int) -> None:
        self._pen, self._width, self._rows = pen, width, rows
        self._small = _font(max(round(0.21 * rows), 9))
        self._large = _font(max(round(0.40 * rows), 13))
        self._pad = max(round(0.16 * rows), 4)

    def draw(
        self,
        row: dict[str, float],
        time: float,
        limit: float,
        summary: dict[str, Any],
        car: CarParameters,
        names: tuple[str, ...],
    ) -> None:
        width, pad = self._width, 2 * self._pad
        panels: list[tuple[float, Any]] = [(1.35, lambda x, w: self._lap(x, w, row, time, summary, names))]
        panels.append((2.6, lambda x, w: self._speed(x, w, row["speed_m_s"], limit, summary)))
        if width >= 420:
            panels.append((1.9, lambda x, w: self._steering(x, w, row["steering_angle_rad"], car)))
        slides = slides_above(str(summary.get("tires_model", CONTACT)))
        panels.append((2.6, lambda x, w: self._tires(x, w, row, slides)))
        total = sum(share for share, _ in panels)
        room = width - pad * (len(panels) + 1)
        x = float(pad)
        for share, panel in panels:
            panel(x, room * share / total)
            x += room * share / total + pad
            if panel is not panels[-1][1]:
                at = x - 0.5 * pad
                self._pen.line((at, 0.2 * self._rows, at, 0.8 * self._rows), fill=_DIM)

    def _title(self, x: float, text: str, value: str = "", width: float = 0.0, fill: Any = _GREY) -> None:
        self._pen.text((x, self._pad), text, font=self._small, fill=_GREY, anchor="lt")
        if value:
            self._pen.text((x + width, self._pad), value, font=self._small, fill=fill, anchor="rt")

    def _fits(self, text: str, width: float) -> bool:
        """Return whether a title and a value, set apart, are within a width [px]."""
        fits: bool = self._small.getlength(text) + self._small.size < width
        return fits

    def _lap(
        self,
        x: float,
        width: float,
        row: dict[str, float],
        time: float,
        summary: dict[str, Any],
        names: tuple[str, ...],
    ) -> None:
        laps = int(summary.get("laps_requested", 0))
        endless = "laps_requested" in summary and not laps
        name = next((name for name in names if self._fits(name, width)), "")
        self._title(x, name or ("TIME" if endless else "LAP"))
        text = f"{min(int(row['lap']), laps or 10**9)}/{laps}" if laps else f"{int(row['lap'])}"
        if endless:
            text = f"{time:.1f} s"
        below = self._rows - self._pad
        self._pen.text((x, below), text, font=self._large, fill=_WHITE, anchor="ls")
        if width > 3.2 * self._large.size and not endless:
            self._pen.text((x + width, below), f"{time:.1f} s", font=self._small, fill=_WHITE, anchor="rs")

    def _speed(self, x: float, width: float, speed: float, limit: float, summary: dict[str, Any]) -> None:
        top = max(float(summary.get("speed_limit_m_s", 8.0)), 1.0)
        whose = "law's limit" if limit < top else "top"  # where the law gives no limit, the greatest command
        limit = min(limit, top)
        title, shown = "SPEED m/s", f"{whose} {limit:.1f}"
        if not self._fits(title + shown, width):
            title, shown = "SPEED", f"{limit:.1f}"
        self._title(x, title, shown, width, _AMBER)
        below = self._rows - self._pad
        text = f"{speed:.1f}"
        self._pen.text((x, below), text, font=self._large, fill=_WHITE, anchor="ls")
        start = x + 2.5 * self._large.size
        if x + width - start > 20:
            self._bar(start, x + width, speed / top, _BLUE)
            self._tick(start + (x + width - start) * limit / top, _AMBER)

    def _steering(self, x: float, width: float, angle: float, car: CarParameters) -> None:
        self._title(x, "STEERING", f"{math.degrees(angle):+.0f}°", width, _WHITE)
        low, high = self._bar_rows()
        middle = x + 0.5 * width
        self._pen.rectangle((x, low, x + width, high), fill=_DIM)
        end = middle - 0.5 * width * max(-1.0, min(1.0, angle / car.max_steering_angle))  # to the left is left
        self._pen.rectangle((min(middle, end), low, max(middle, end), high), fill=_BLUE)
        self._tick(middle, _WHITE)

    def _tires(self, x: float, width: float, row: dict[str, float], least: float) -> None:
        """Draw a bar for each tire, where it is on the car from above, named; one that slides has a white frame."""
        use = [row[f"friction_utilisation_{wheel}"] for wheel in WHEELS]
        slide = [row[f"slide_{wheel}_m_s"] for wheel in WHEELS]
        greatest = max(slide, key=lambda v: -1.0 if math.isnan(v) else v)
        slides = greatest > least
        note = f"framed: slides, {greatest:.2f} m/s" if slides else "no tire slides"
        notes = (note, f"slides {greatest:.2f} m/s" if slides else "holds", "slides" if slides else "holds")
        if np.isnan(slide).all() and np.isfinite(use).any():
            notes = ("sliding not measured", "not measured", "-")
        titles = ("FRICTION UTILISATION", "FRICTION USE", "FRICTION")
        fitting = [(title, note) for note in notes for title in titles if self._fits(title + note, width)]
        title, note = fitting[0] if fitting else ("", notes[-1])
        self._title(x, title)
        self._pen.text((x + width, self._pad), note, font=self._small, fill=_RED if slides else _GREEN, anchor="rt")
        gap = max(round(0.035 * self._rows), 1)
        low, end = self._pad + 1.25 * self._small.size, self._rows - 0.4 * self._pad
        each, high = max(0.5 * (width - 2 * gap), 1.0), max(0.5 * (end - low - gap), 1.0)
        font = _font(max(round(0.86 * high), 8))
        for index, (wheel, share) in enumerate(zip(WHEELS, use, strict=True)):
            left, upper = x + (index % 2) * (each + 2 * gap), low + (index // 2) * (high + gap)
            box = (left, upper, left + each, upper + high - 1)
            self._pen.rectangle(box, fill=_DIM)
            value = "-"
            if math.isfinite(share):
                colour = tuple(int(255 * part) for part in friction_colour(share))
                self._pen.rectangle((left, upper, left + each * min(share, 1.0), upper + high - 1), fill=colour)
                value = f"{100.0 * share:.0f} %"
            if slide[index] > least:
                self._pen.rectangle(box, outline=_WHITE, width=max(round(0.1 * high), 1))
            if high < _LEAST_TEXT:
                continue
            short = "".join(word[0] for word in wheel.split("_")).upper()
            names = [
                name for name in (wheel.replace("_", " "), short) if font.getlength(f"{name} {value}") < 0.88 * each
            ]
            middle = upper + 0.5 * high - 0.5
            ink: Any = {"font": font, "fill": _WHITE, "stroke_fill": tuple(map(int, _BACK))}
            stroke = max(round(0.09 * font.size), 1)
            self._pen.text((left + 0.05 * each, middle), (names or [short])[0], anchor="lm", stroke_width=stroke, **ink)
            if names:
                self._pen.text((left + 0.95 * each, middle), value, anchor="rm", stroke_width=stroke, **ink)

    def _bar_rows(self) -> tuple[float, float]:
        return 0.56 * self._rows, self._rows - 1.15 * self._pad

    def _bar(self, start: float, end: float, share: float, colour: Any) -> None:
        low, high = self._bar_rows()
        self._pen.rectangle((start, low, end, high), fill=_DIM)
        self._pen.rectangle((start, low, start + (end - start) * max(0.0, min(share, 1.0)), high), fill=colour)

    def _tick(self, x: float, colour: Any) -> None:
        low, high = self._bar_rows()
        half = max(0.022 * self._rows, 1.0)
        self._pen.rectangle((x - half, low - 2, x + half, high + 2), fill=colour)


def draw_legend(picture: Picture, scans: tuple[str, ...], friction: bool) -> None:
    """Draw onto a picture's upper left corner what the colours of beams and trace mean."""
    legend, opacity = _legend(scans, friction, picture.shape[0])
    rows, columns = legend.shape[:2]
    margin = max(round(0.018 * picture.shape[0]), 3)
    if rows + margin > picture.shape[0] or columns + margin > picture.shape[1]:
        return
    place = picture[margin : margin + rows, margin : margin + columns]
    place[:] = (place * (1.0 - opacity) + legend * opacity).astype(np.uint8)


@lru_cache(maxsize=16)
def _legend(scans: tuple[str, ...], friction: bool, height: int) -> tuple[NDArray[np.float32], float]:
    from PIL import Image, ImageDraw

    font = _font(max(round(0.024 * height), 9))
    step, pad = round(1.5 * font.size), round(0.6 * font.size)
    texts = [{"raw": "beam", "extended": "cut off"}.get(name, name) for name in scans]
    wide = round(max([font.getlength(text) for text in texts] + [8.0 * font.size * friction], default=0.0))
    lines = len(scans) + 2 * friction
    image = Image.new("RGB", (wide + 3 * pad + 2 * font.size, lines * step + pad), tuple(int(c) for c in _BACK))
    pen = ImageDraw.Draw(image)
    for index, (name, text) in enumerate(zip(scans, texts, strict=True)):
        y = pad + index * step
        colour = tuple(int(255 * part) for part in STAGES[name])
        pen.rectangle((pad, y + 0.25 * font.size, pad + 1.5 * font.size, y + 0.75 * font.size), fill=colour)
        pen.text((2 * pad + 1.5 * font.size, y + 0.5 * font.size), text, font=font, fill=_WHITE, anchor="lm")
    if friction:
        y = pad + len(scans) * step
        pen.text((pad, y + 0.5 * font.size), "friction utilisation", font=font, fill=_WHITE, anchor="lm")
        y += step
        width = image.width - 2 * pad - 2 * font.size
        for column in range(width):
            colour = tuple(int(255 * part) for part in friction_colour(column / max(width - 1, 1)))
            pen.line(
                (pad + font.size + column, y + 0.2 * font.size, pad + font.size + column, y + 0.8 * font.size),
                fill=colour,
            )
        pen.text((pad, y + 0.5 * font.size), "0", font=font, fill=_WHITE, anchor="lm")
        pen.text((image.width - pad, y + 0.5 * font.size), "1", font=font, fill=_WHITE, anchor="rm")
    return np.asarray(image).astype(np.float32), 0.82


@lru_cache(maxsize=16)
def _font(size: int) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size)
