"""Reports: a run as one HTML page with plots that can be zoomed, without network. Needs bokeh.

    write_report("runs/oval", "runs/oval/report.html")

`recorded` reads a run and its columns. `laps_and_slides` and `map_shapes` compute what is shown of it.
`map_plot` and `time_plots` draw it, `clip` makes the video, `sections` and `field` the text and tables, and
`report_page` puts all of it together by the kit of `pictures.pages`.
"""

from .report_page import write_report

__all__ = ["write_report"]
