"""A page: one HTML file that loads nothing and needs no network, on light and on dark.

    write_page("page.html", "Title", html("<h1>{title}</h1>{table}", title="A < B", table=table.html()))

All parts are of `display.html` and `display.element`, which escape what is no Html.
"""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable, Sequence
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

from ...course.files import is_file
from ...course.writing import write_file, writing
from ...display import Html, element, html
from .bokeh_plots import library


def write_page(
    path: str | Path,
    title: str,
    body: object,
    plots: str | None = None,
    script: str = "",
    data: object = None,
    style: str = "",
) -> Path:
    """Write a page and return its path. It appears whole, in the place of one that may be there.

    Its policy lets it run its own scripts alone: it has their hashes.

    Args:
      path: of the page.
      title: of its window.
      body: its parts, as of `display.html`.
      plots: JavaScript of `bokeh_plots.embed`; None: the page has no plots.
      script: JavaScript of the page's own, after page.js. On a page with plots it waits for the event "plots".
      data: what the script finds as JSON in the element `report-data`.
      style: CSS, after that of all pages.

    Raises:
      RunFolderError: it cannot be written.
    """
    style = resource(__package__, "page.css") + style
    drawn = [] if plots is None else [library(), plots]
    own = [resource(__package__, "page.js"), script] if script or drawn else []
    scripts = [_as_parsed(each) for each in (*drawn, *own) if each]
    allowed = [f"'sha256-{b64encode(sha256(each.encode()).digest()).decode()}'" for each in scripts]
    policy = (
        f"default-src 'none'; script-src {' '.join(allowed) or _NONE}; style-src 'unsafe-inline'; "
        "img-src data: blob:; media-src data:; font-src data:; base-uri 'none'; form-action 'none'"
    )
    tags = []
    if data is not None:
        text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")  # no text in it ends it
        tags.append(element("script", Html(text), type="application/json", id="report-data"))
    tags += [element("script", Html(each)) for each in scripts]
    page = html(
        "{head}{policy}\n"
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}\n{tags}\n</body>\n</html>\n",
        head=Html(_HEAD), policy=Html(f'{_POLICY}"{policy}">'),
        title=title, style=Html(style), body=body, tags=tags,
    )  # fmt: skip
    with writing(path):
        write_file(Path(path), page.encode())
    return Path(path)


def is_page(path: str | Path) -> bool:
    """Return whether a file is a page that `write_page` wrote, of any content."""
    if not is_file(path):
        return False
    head = f"{_HEAD}{_POLICY}".encode()
    with open(path, "rb") as file:
        return file.read(len(head)) == head


_HEAD = '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
_POLICY = '<meta http-equiv="Content-Security-Policy" content='
_NONE = "'none'"  # of a policy that allows no script


def _as_parsed(script: str) -> str:
    """Return JavaScript as a browser reads it from a page, which is what it hashes: lines end in LF alone."""
    return script.replace("\r\n", "\n").replace("\r", "\n")


def resource(package: str, name: str) -> str:
    """Return the text of a file of a package."""
    return (files(package) / name).read_text(encoding="utf-8")


def data_url(kind: str, content: bytes) -> str:
    """Return a file of a media type as a page has it in itself."""
    return f"data:{kind};base64,{b64encode(content).decode()}"


def note(*parts: object) -> Html:
    """Return a paragraph in small type."""
    return element("p", *parts, class_="note")


def scroll(table: Html, kind: str = "") -> Html:
    """Return a table in a frame; `kind` "whole" shows all its height."""
    return element("div", table, class_=f"scroll {kind}".strip())


def result(word: str, good: bool, text: str) -> Html:
    """Return the line below the title: how it ended, on green or red, and more."""
    badge = element("span", word, class_=f"badge {'good' if good else 'bad'}")
    return element("p", badge, text, class_="result")


def boxes(figures: Iterable[tuple[str, str]]) -> Html:
    """Return the figures below the title, each a value and its name."""
    each = [html("<div><b>{value}</b><span>{name}</span></div>", value=value, name=name) for value, name in figures]
    return element("div", each, class_="figures")


def switch(name: str, choices: Sequence[tuple[object, str]], pressed: int = 0) -> Html:
    """Return buttons of which one is pressed: a value and its text each. The page's script acts on them."""
    buttons = [
        element("button", text, type="button", data_switch=name, value=value, aria_pressed=str(i == pressed).lower())
        for i, (value, text) in enumerate(choices)
    ]
    return element("div", buttons, class_="switch", role="group")


def names_and_values(pairs: Iterable[tuple[str, object]]) -> Html:
    """Return a table of two columns without a header."""
    rows = [html("<tr><td>{name}</td><td>{value}</td></tr>", name=name, value=value) for name, value in pairs]
    return html('<table class="settings"><tbody>{rows}</tbody></table>', rows=rows)
