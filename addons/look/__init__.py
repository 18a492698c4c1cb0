"""Looking at runs: `report` makes the page of a run, `debug` that of its decisions, `live` shows a race as it goes."""
