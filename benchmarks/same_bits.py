"""Shows that the same commands give the same bits in two checkouts, from before and after a refactoring.

    python benchmarks/same_bits.py BEFORE AFTER [--quick] [--only GROUP ...] [--save FILE]
    .venv/bin/python benchmarks/same_bits.py --collect FILE [--quick] [--only GROUP ...]

BEFORE and AFTER are each the folder of a checkout, whose `.venv/bin/python` is used unless `--python-before` or
`--python-after` names another, or a JSON file that `--collect` or `--save` wrote. `--collect` writes that file for the
checkout whose interpreter runs it.

The cases are those of `same_bits_cases.py`, next to this file: it runs in both checkouts, each case in the same order,
under the checkout's own interpreter, in an empty folder, with nothing kept from before.

One line for each group says how many cases are equal and how many differ. One line for each case that differs says
where. Of a list only the first entry that differs is shown: `states_by_second[20]` says that the trajectories part in
second 20, `states[17]` that world 17 of a rollout is the first to differ. If the states differ and `telemetry` does
not, only the layout of the state changed. An entry that only AFTER has, such as a new column of the telemetry, is noted
and is not a difference. A case that fails is a difference, also if it fails in both.

Exit codes: 0 all bits are the same; 1 some are not; 2 a checkout or file that cannot be used.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

CASES = Path(__file__).resolve().with_name("same_bits_cases.py")
SHOWN = 4  # differing entries of a case
DIGITS = 24  # of a value
GROUPS = ("circuits", "scenes", "random", "lidar", "cars", "rollouts", "environments", "folders", "friction")

Figures = dict[str, Any]


class InputError(Exception):
    """A checkout or file that cannot be used."""


def interpreter(checkout: Path, given: Path | None) -> Path:
    """Return the interpreter of a checkout; links are kept, because a virtual environment is found by its own path."""
    python = given or checkout / ".venv" / "bin" / "python"
    if not python.is_file():
        raise InputError(
            f"{python} does not exist; accepted: a checkout with .venv/bin/python, or the option --python-..."
        )
    return Path(os.path.abspath(python))


def collect(python: Path, checkout: Path | None, label: str, options: argparse.Namespace) -> Figures:
    """Run the cases under an interpreter, which must import fg_mujoco from the checkout, and return what they found."""
    with tempfile.TemporaryDirectory(prefix="same_bits-") as folder:
        work, cache, out = Path(folder, "work"), Path(folder, "cache"), Path(folder, "figures.json")
        work.mkdir()
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        environment["XDG_CACHE_HOME"] = str(cache)
        command = [str(python), str(CASES), str(out), "--label", label]
        command += ["--within", str(checkout)] if checkout else []
        command += ["--quick"] if options.quick else []
        command += [part for group in options.only or () for part in ("--only", group)]
        code = subprocess.run(command, cwd=work, env=environment, stdout=subprocess.DEVNULL).returncode
        if code or not out.is_file():
            raise InputError(f"the cases of {label} ended with exit code {code}")
        return read(out)


def read(path: Path) -> Figures:
    """Return what an earlier call wrote."""
    try:
        figures = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(figures["cases"], dict) or not isinstance(figures["made_with"], dict):
            raise TypeError("its parts are of other types")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: {error}; accepted: a file that --collect or --save wrote") from error
    return dict(figures)


def write(figures: Figures, path: Path) -> None:
    """Write them."""
    try:
        path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; accepted: a file that can be written") from error


def entries(facts: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield each number, word and digest in some facts: its path, and the value as JSON, in which NaN equals NaN."""
    if isinstance(facts, dict):
        for name, part in facts.items():
            yield from entries(part, f"{path}.{name}" if path else name)
    elif isinstance(facts, list):
        yield f"{path}.length", str(len(facts))
        for i, part in enumerate(facts):
            yield from entries(part, f"{path}[{i}]")
    else:
        yield path, json.dumps(facts)


def compare(before: Figures | None, after: Figures) -> tuple[list[str], list[str]]:
    """Return the differences between the facts of a case, as text, and the paths of the entries that only AFTER has."""
    if before is None:
        return ["is not in BEFORE"], []
    sides = {"before": before, "after": after}
    if failures := [f"failed {when}: {facts['error']}" for when, facts in sides.items() if "error" in facts]:
        return failures, []
    old, new = dict(entries(before)), dict(entries(after))
    differences: dict[str, str] = {}  # the first of each list, by the path of the list
    for path, value in old.items():
        if new.get(path) != value:
            found = shortened(new[path]) if path in new else "missing"
            differences.setdefault(path.partition("[")[0], f"{path} {shortened(value)} -> {found}")
    # entries behind the end of a list are left out: its length says it
    return list(differences.values()), [path for path in new if path not in old and "[" not in path]


def shortened(value: str) -> str:
    """Return the beginning of a value that is long."""
    return value if len(value) <= DIGITS else f"{value[:DIGITS]}..."


def report(before: Figures, after: Figures) -> int:
    """Print how two collections compare, and return how many cases differ."""
    for when, figures in (("before", before), ("after", after)):
        print(f"{when:7} {figures.get('checkout')} {figures.get('commit')}".rstrip())
    for name, value in after["made_with"].items():
        if before["made_with"].get(name) != value:
            print(f"note: {name} is {before['made_with'].get(name)!r} before and {value!r} after")
    groups: dict[str, list[bool]] = {}
    lines: list[str] = []
    new: dict[str, None] = {}
    for name, facts in after["cases"].items():
        differences, added = compare(before["cases"].get(name), facts)
        new |= dict.fromkeys(added)
        groups.setdefault(name.partition("/")[0], []).append(not differences)
        if differences:
            more = len(differences) - SHOWN
            lines.append(f"{name}: {'; '.join(differences[:SHOWN])}{f'; and {more} more' if more > 0 else ''}")
    print()
    for group, equal in (*groups.items(), ("all", [same for cases in groups.values() for same in cases])):
        print(f"{group:14}{sum(equal):5} equal{len(equal) - sum(equal):5} different")
    if new:
        print(f"\nnote: only in AFTER, and not compared: {', '.join(new)}")
    if left := [name for name in before["cases"] if name not in after["cases"]]:
        print(f"\nnote: {len(left)} cases of BEFORE were not asked of AFTER")
    if lines:
        print("\n" + "\n".join(lines))
    return len(lines)


def failed(figures: Figures) -> int:
    """Print the cases that failed, and return how many they are."""
    failures = {name: facts["error"] for name, facts in figures["cases"].items() if "error" in facts}
    for name, error in failures.items():
        print(f"{name}: failed: {error}")
    return len(failures)


def parsed() -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("before", type=Path, nargs="?", metavar="BEFORE", help="a checkout, or a file of --collect or --save")
    add("after", type=Path, nargs="?", metavar="AFTER", help="the same")
    add("--python-before", type=Path, metavar="PYTHON", help="interpreter of BEFORE; default: its .venv/bin/python")
    add("--python-after", type=Path, metavar="PYTHON", help="interpreter of AFTER")
    add("--quick", action="store_true", help="a part of the cases; less than a minute each")
    add("--only", action="append", choices=GROUPS, metavar="GROUP", help=f"may be repeated: {', '.join(GROUPS)}")
    add("--save", type=Path, metavar="FILE", help="keep what was collected of AFTER: the BEFORE of a later call")
    add("--collect", type=Path, metavar="FILE", help="compare nothing: collect in this interpreter's checkout")
    options = parser.parse_args()
    if (options.collect is None) != (options.after is not None) or (options.collect and options.before):
        parser.error("accepted: BEFORE and AFTER, or --collect FILE")
    return options


def side(path: Path, python: Path | None, label: str, options: argparse.Namespace) -> Figures:
    """Return what was collected of BEFORE or AFTER: now, or by an earlier call."""
    if path.is_dir():
        return collect(interpreter(path, python), path.resolve(), label, options)
    return read(path)


def main() -> int:
    """Compare, or collect; return the exit code."""
    options = parsed()
    try:
        if options.collect:
            figures = collect(Path(sys.executable), None, "collect", options)
            write(figures, options.collect)
            print(f"{len(figures['cases'])} cases of {figures['checkout']} {figures['commit']}: {options.collect}")
            return 1 if failed(figures) else 0
        before = side(options.before, options.python_before, "before", options)
        after = side(options.after, options.python_after, "after", options)
        if options.save:
            write(after, options.save)
        return 1 if report(before, after) else 0
    except InputError as error:
        print(f"same_bits: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
