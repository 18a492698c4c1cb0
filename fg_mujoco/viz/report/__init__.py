"""Reports: what there is to know of a run in one HTML page, to be zoomed into, without network. Needs bokeh.

    write_report("runs/oval", "runs/oval/report.html")

Modules: recorded_run (what is reported), tick_columns, lap_table, slide_events and map_shapes (what is worked out from
it), map_plot, time_plots and gg_plot (what is drawn of it), clip, page (all of it together), comparison_pages.
"""

from .page import write_report

__all__ = ["write_report"]
