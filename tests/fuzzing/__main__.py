"""The long run: every target many times, with what was found.

python -m fuzzing --tries 5000 --seed 1
python -m fuzzing --target track_csv --seed 1 --only 17      # that try again, with its files left where it says
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .harness import Tally, _captured, _generator, knock, tried
from .targets import TARGETS


def main() -> int:
    """Return 0 if nothing was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tries", type=int, default=1000, help="at each target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--target", choices=sorted(TARGETS), action="append", help="default: all; may be given again")
    parser.add_argument("--only", type=int, help="number of the one try")
    parser.add_argument("--workers", type=int, default=2, help="targets at once")
    parser.add_argument("--show", type=int, default=20, help="findings of each target at most")
    options = parser.parse_args()
    targets = options.target or list(TARGETS)
    if options.only is not None:
        return _once(targets[0], options.seed, options.only)
    print(f"{'target':<20} {'tries':>7} {'refused':>8} {'slowest [s]':>12} {'memory [MB]':>12} {'found':>6}")
    tallies: list[Tally] = []
    with ThreadPoolExecutor(options.workers) as pool:
        for tally in pool.map(lambda target: knock(target, options.tries, seed=options.seed), targets):
            tallies.append(tally)
            figures = f"{tally.tries:>7} {tally.refused:>8} {tally.slowest:>12.2f} {tally.memory / 1000:>12.0f}"
            print(f"{tally.target:<20} {figures} {len(tally.findings):>6}", flush=True)
            for finding in tally.findings[: options.show]:
                print(" ", finding, flush=True)
    print(f"{'all':<20} {sum(t.tries for t in tallies):>7} {sum(t.refused for t in tallies):>8}")
    return int(any(tally.findings for tally in tallies))


def _once(name: str, seed: int, number: int) -> int:
    folder = Path(tempfile.mkdtemp(prefix="fuzzing-"))
    (folder / "samples").mkdir()
    TARGETS[name].prepare(folder / "samples")
    with _captured(folder) as output:
        found = tried(TARGETS[name], folder / "samples", folder / "here", _generator(name, seed, number), output,
                      keep=True)  # fmt: skip
    seconds, refused, wrong = found
    print(f"{folder / 'here'}: {seconds:.2f} s, {'refused' if refused else 'not refused'}; {wrong or 'nothing found'}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
