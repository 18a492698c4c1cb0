"""Representations of objects: one line as their repr, tables and pictures in a notebook, a page by `show()`.

    class Thing(Shown):
        def __repr__(self):
            return brief(self, f"{self.length:.1f} m")

        def _repr_html_(self):
            return table(("what", "how much"), [("length", f"{self.length:.1f} m")])

    thing.show()

Pictures are SVG and need no extra. `html` and `element` escape all text that goes into HTML, on pages, too.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import fields
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arguments import Suggesting
from .errors import SettingsError

LONGEST = 300
"""Characters of a repr."""

_LONGEST_NAME = 60  # characters of a name or a path in a repr
_SIZE = (560.0, 420.0)  # [px] greatest width and height of a drawing, without its strip
_STRIP = 26.0  # [px] below a drawing, for its scale and its legend
_MOST_POINTS = 4000  # of one line; more are not seen at this size
_FONT = 'font-family="sans-serif" font-size="11"'
_CELL = "text-align:left;padding:2px 10px"


def brief(thing: object, *parts: str) -> str:
    """Return the repr of a thing: its class and what is said of it, in one line of at most LONGEST characters."""
    name, text = type(thing).__name__, " ".join(", ".join(parts).split())
    room = LONGEST - len(name) - 2
    return f"{name}({text if len(text) <= room else text[: room - 3] + '...'})"


def quoted(name: object) -> str:
    """Return a name or a path in quotes; of a long one the beginning and the end."""
    text, half = str(name), _LONGEST_NAME // 2 - 2
    return repr(text if len(text) <= _LONGEST_NAME else f"{text[:half]}...{text[-half:]}")


def changed(settings: Any, plain: Any) -> list[str]:
    """Return `name=value` for each field of a dataclass that is not as in the plain one of the same class."""
    pairs = ((f.name, getattr(settings, f.name), getattr(plain, f.name)) for f in fields(settings))
    return [f"{name}={value!r}" for name, value, default in pairs if value is not default and value != default]


class Html(str):
    """HTML, which `html` and `element` do not escape."""

    __slots__ = ()


def html(template: str, /, **parts: object) -> Html:
    """Return HTML with parts in its braces: `html("<p>{text}</p>", text="a < b")`.

    A part that is no Html is escaped. All parts of a list or tuple follow each other, and None is nothing.
    """
    return Html(template.format_map({name: escaped(part) for name, part in parts.items()}))


def escaped(part: object) -> Html:
    """Return a part of a page as HTML, as in `html`."""
    if isinstance(part, (list, tuple)):
        return Html("".join(map(escaped, part)))
    return part if isinstance(part, Html) else Html("" if part is None else escape(str(part)))


def element(name: str, *parts: object, **attributes: object) -> Html:
    """Return an HTML element with these parts in it: `element("td", "a < b", class_="left")`.

    Parts are as in `html`. An attribute that is True stands without a value, and one that is None or False is left out.
    """
    given = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items()}
    inside = "".join(
        f" {key}" if value is True else f' {key}="{escape(str(value))}"'
        for key, value in given.items()
        if value is not None and value is not False
    )
    return Html(f"<{name}{inside}>" if name in _EMPTY else f"<{name}{inside}>{escaped(parts)}</{name}>")


_EMPTY = ("img", "input", "meta")  # elements that have no end


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> Html:
    """Return a table for a notebook; an empty header is none."""
    head = element("thead", element("tr", [element("th", name, style=_CELL) for name in header])) if header else None
    body = [element("tr", [element("td", cell, style=_CELL) for cell in row]) for row in rows]
    return element("table", head, element("tbody", body))


def paragraph(text: str) -> Html:
    """Return a paragraph as HTML."""
    return element("p", text)


class Drawing:
    """A drawing to scale, as SVG. Positions are in metres, x to the right and y up.

    Args:
      low: least x and y that are shown.
      high: greatest x and y that are shown.
    """

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


class Shown(Suggesting):
    """Base of objects with a picture or table in a notebook, by `_repr_html_`; `show()` opens the same elsewhere."""

    def _repr_html_(self) -> str:
        raise NotImplementedError

    def show(self, path: str | Path | None = None) -> None:
        """Show the picture: in a notebook below the cell, elsewhere as a page of which the place is printed.

        The page is one file that needs no network. In a terminal with a display it is opened in the browser, which is
        not waited for.

        Args:
          path: where the page is written, an .html file; None: to the folder of temporary files, and in a notebook
            nowhere.

        Raises:
          SettingsError: a path that does not end in .html.
          OSError: the file cannot be written.
        """
        if path is not None and Path(path).suffix.lower() not in (".html", ".htm"):
            raise SettingsError(f"show: path is {str(path)!r}; accepted: a file that ends in .html")
        in_notebook = _in_notebook()
        if in_notebook:
            from IPython.display import display

            display(self)
        if path is None and in_notebook:
            return
        page = (
            f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(repr(self))}</title></head>\n'
            f'<body style="font-family:sans-serif">\n{self._repr_html_()}\n</body></html>\n'
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
