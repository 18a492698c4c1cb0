"""Cases of a test in a loop; where it fails, conftest.py says at which."""

import tempfile
from pathlib import Path

NOW = []
"""The cases that are being tried, of the outer loop first."""


def cases(*rows):
    """Yield one row after the other."""
    for row in rows:
        NOW.append(row)
        yield row
        NOW.pop()


def fresh(folder):
    """Return a new folder in a folder, for a case that writes files."""
    return Path(tempfile.mkdtemp(dir=folder))
