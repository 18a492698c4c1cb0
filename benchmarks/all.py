"""Runs every benchmark; writes their output and their figures to docs/journal/benchmarks.md and benchmarks.json.

python benchmarks/all.py [--quick]
"""

from __future__ import annotations

import argparse
import datetime
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from common import machine

HERE = Path(__file__).parent
JOURNAL = HERE.parent / "docs" / "journal"
BENCHMARKS = {  # title, script, options, options when quick
    "1. The closed loop, one world": ("race_loop.py", [], ["--laps", "1"]),
    "2. Rollouts": ("rollouts.py", [], ["--most", "64", "--time-limit", "1"]),
    "3. Starting up": ("startup.py", [], ["--repeats", "3"]),
    "4. Environments": ("environments.py", [], ["--worlds", "16", "--rounds", "1"]),
}


def main() -> None:
    """Run them, one after the other."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="shorter, and nothing is written")
    options = parser.parse_args()
    sections, figures = [], {}
    for title, (script, full, quick) in BENCHMARKS.items():
        print(f"\n## {title}\n", flush=True)
        text, figures[Path(script).stem] = run(script, quick if options.quick else full)
        sections.append(f"## {title}\n\n`python benchmarks/{script}`\n\n{text.strip()}\n")
    if options.quick:
        return
    described = machine()
    intro = (
        f"# Benchmarks\n\nWritten by `make bench` on {datetime.date.today()}: "
        + ", ".join(f"{name} {value}" for name, value in described.items())
        + ". Medians; each ratio is to a baseline measured in the same run.\n"
    )
    (JOURNAL / "benchmarks.md").write_text("\n".join([intro, *sections]), encoding="utf-8")
    (JOURNAL / "benchmarks.json").write_text(json.dumps({"machine": described, **figures}, indent=1) + "\n")


def run(script: str, options: list[str]) -> tuple[str, Any]:
    """Run one, show what it prints, and return that and its figures."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "figures.json"
        command = [sys.executable, str(HERE / script), *options, "--json", str(path)]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        print(done.stdout, flush=True)
        written = json.loads(path.read_text())
    written.pop("machine", None)
    return done.stdout, written


if __name__ == "__main__":
    main()
