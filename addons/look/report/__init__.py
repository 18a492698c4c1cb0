"""Reports: a run as one HTML page with plots that can be zoomed, without network. Needs bokeh."""

from .report_page import write_report

__all__ = ["write_report"]
