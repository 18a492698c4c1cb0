"""Looking at runs: `report` makes the page of a run, `debug` the page of its decisions, `live` a race as it goes.

`notebook` has what results, courses and scans show in a notebook.
"""
