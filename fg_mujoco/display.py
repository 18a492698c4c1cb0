"""Representations of objects: one line as their repr, tables and pictures in a notebook, a page by `show()`.

    class Thing(Shown):
        def __repr__(self):
            return brief(self, f"{self.length:.1f} m")

        def _repr_html_(self):
            return table(("what", "how much"), [("length", f"{self.length:.1f} m")])

    thing.show()

Pictures are drawn by the add-on look. `html` and `element` escape all text that goes into HTML, on pages, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from html import escape
from pathlib import Path
from typing import Any

from . import from_addons
from .arguments import Suggesting
from .errors import FgMujocoError

LONGEST = 300
"""Characters of a repr."""

_LONGEST_NAME = 60  # characters of a name or a path in a repr
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


class Shown(Suggesting):
    """Base of objects with a picture or table in a notebook, by `_repr_html_`; `show()` opens the same elsewhere."""

    def _repr_html_(self) -> str | None:
        """Return the picture; None, which a notebook shows as the repr: the add-on look cannot be imported."""
        try:
            draw = from_addons.notebook_html
        except FgMujocoError:
            return None
        return draw(self)

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
        from_addons.show(self, path)
