"""Figures of the lab as SVG text, in one style; and fit to stand in a page beside others."""

from __future__ import annotations

import base64
import io
import re

from .experiment import Figure
from .figure_style import STYLE, WIDTH

GREATEST_SVG = 300_000
"""[bytes] Of a figure that stands in the page as SVG; any other does as PNG."""

_DPI = 150
_ID = re.compile(r'\bid="([^"]+)"')
_REFERENCE = re.compile(r'(url\(#|href="#)')


def render(figure: Figure, kind: str = "svg") -> bytes:
    """Draw a figure as a file of that kind: the same rows, the same bytes."""
    import matplotlib as mpl
    from matplotlib.figure import Figure as Canvas

    with mpl.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH, figure.height), layout="constrained")
        figure.draw(canvas)
        file = io.BytesIO()
        metadata = {"Date": None} if kind == "svg" else {"Software": None}
        canvas.savefig(file, format=kind, dpi=_DPI, metadata=metadata)
    return file.getvalue()


def embedded(figure: Figure, svg: bytes, prefix: str) -> str:
    """Return a figure as HTML: inlined SVG, whose ids begin with `prefix`, or a PNG where that would be long.

    Args:
      figure: what is drawn.
      svg: as `render` made it.
      prefix: different for each figure of a page.
    """
    if len(svg) > GREATEST_SVG:
        data = base64.b64encode(render(figure, "png")).decode()
        return f'<img alt="" src="data:image/png;base64,{data}">'
    text = svg.decode()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r'\s(xmlns(:\w+)?|width|height)="[^"]*"', "", text, count=4)  # HTML knows; CSS says how wide
    text = _ID.sub(rf'id="{prefix}-\1"', text)
    return _REFERENCE.sub(rf"\g<1>{prefix}-", text)
