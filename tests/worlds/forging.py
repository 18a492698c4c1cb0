"""Run folders that somebody has changed."""

import json


def without_checksums(folder):
    """Take the checksums out of a run's summary, as whoever forges a folder can; return the folder."""
    path = folder / "summary.json"
    summary = json.loads(path.read_text("utf-8"))
    summary.pop("files", None)
    path.write_text(json.dumps(summary), "utf-8")
    return folder
