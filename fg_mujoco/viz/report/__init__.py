"""Reports: a run as one HTML page with plots that can be zoomed, without network. Needs bokeh.

    write_report("runs/oval", "runs/oval/report.html")

`recorded_run` reads a run. `tick_columns`, `lap_table`, `slide_events` and `map_shapes` compute what is shown of it.
`map_plot`, `time_plots` and `gg_plot` draw it, in the style of `plot_style`. `clip` makes the video, `sections` the
text and tables, and `page` puts all of it together. The pages of a comparison are made by `studies.comparison.pages`.
"""

from .page import write_report

__all__ = ["write_report"]
