"""What kills leave: each command is killed at random times, and the same command then has to end as one that was not.

    python benchmarks/kills.py 200 [--commands race,rollout] [--seed 0] [--json FILE]

Half of the kills come at any time, the others while the command writes. The folder must then hold the files of an
undisturbed run, byte for byte but for wall times, and nothing else. Last, each command is run twice at once.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from common import parser, report, table

SMALL = "--controller gap_finder --time-limit 0.5"
COMMANDS = {
    "race": f"race {SMALL} --out out",
    "rollout": "rollout --n 12 --chunk 3 --time-limit 0.5 --record states --workers 2 --out out",
    "compare": "compare --controller gap_finder --track oval --obstacles 1 --seed 0:3 --time-limit 0.5 --workers 1 "
    "--out out",
    "friction": "friction mismatch --planner-mu 0.5:1.2:3 --workers 1 --out out",
    "export": "export run --force --out run.mcap",
    "render": "render run --size 64x48 --fps 20 --out run.mp4",
}
WALL = {"wall_time_s", "realtime_factor", "decision_times", "worlds_driven", "world_seconds_driven", "rate", "sha256"}
WALL |= {"world_seconds_per_second"}  # in a summary: what another run has otherwise
PATIENCE = 300.0  # [s]


def start(command: str, folder: Path) -> int:
    """Run a command in a process of its own, which has all modules already, and return its id."""
    pid = os.fork()
    if pid == 0:
        code = 99
        try:
            os.chdir(folder)
            log = os.open(folder.parent / f"{folder.name}.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            os.dup2(log, 1)
            os.dup2(log, 2)
            from fg_mujoco.cli.main import main as fg_mujoco

            code = fg_mujoco(command.split())
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    return pid


def end(pid: int) -> int:
    """Wait for a process and return its exit code; that of a killed one is negative."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        found, status = os.waitpid(pid, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.001)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    raise TimeoutError(f"a command does not end within {PATIENCE:g} s")


def contents(folder: Path) -> dict[str, Any]:
    """Return what the files hold, by name, without wall times."""
    return {str(path.relative_to(folder)): content(path) for path in sorted(folder.rglob("*")) if path.is_file()}


def content(path: Path) -> Any:
    """Return what a file holds, without wall times."""
    if path.name == "summary.json":
        summary = json.loads(path.read_bytes())
        rows = [summary, *summary.get("cars", [])]
        return [{name: value for name, value in row.items() if name not in WALL | {"cars"}} for row in rows]
    if path.name == "report.html" and (path.parent / "telemetry.csv").exists():
        return path.read_text()[-20:]  # a page of a race has its wall times
    return path.read_bytes()


def make_place(folder: Path, run: Path) -> Path:
    """Return an empty folder, with the run that export and render take."""
    folder.mkdir()
    shutil.copytree(run, folder / "run")
    return folder


def changes(folder: Path, before: set[Path]) -> bool:
    """Say whether anything is written there."""
    try:
        return set(folder.rglob("*")) != before
    except FileNotFoundError:  # a folder that went while it was listed
        return True


def kill_once(command: str, folder: Path, chance: random.Random, span: tuple[float, float]) -> str:
    """Start a command and kill it, and say when it was.

    Args:
      command: to be run.
      folder: in which.
      chance: when.
      span: what the command takes to the first file, and from there to its end [s].
    """
    before = set(folder.rglob("*"))
    pid = start(command, folder)
    if chance.random() < 0.5:
        time.sleep(chance.uniform(0.0, sum(span)))
    else:
        while not changes(folder, before) and os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
            time.sleep(0.0005)
        time.sleep(chance.uniform(0.0, span[1]))
    os.kill(pid, signal.SIGKILL)
    if end(pid) >= 0:
        return "had ended"
    left = [path for path in folder.rglob("*") if re.fullmatch(r"\.fg_mujoco-.*\.partial", path.name)]
    return "left something aside" if left else "was writing" if changes(folder, before) else "before it wrote"


def is_complete(name: str, folder: Path) -> bool:
    """Say whether a race is done, which the same command then refuses to do again."""
    return name == "race" and (folder / "out" / "summary.json").exists()


def measure(name: str, kills: int, seed: int, place: Path, run: Path) -> dict[str, Any]:
    """Kill a command so often, and count what was found."""
    command, chance = COMMANDS[name], random.Random(f"{name} {seed}")
    whole = make_place(place / f"{name}-whole", run)
    before, began = set(whole.rglob("*")), time.monotonic()
    pid = start(command, whole)
    while not changes(whole, before) and os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        time.sleep(0.0005)
    first = time.monotonic()
    good = end(pid)
    span = first - began, time.monotonic() - first
    expected, moments, wrong = contents(whole), Counter(), []

    def check(folder: Path, codes: list[int], accepted: list[int], what: str) -> None:
        found = contents(folder)
        differ = sorted(name for name in {*found, *expected} if found.get(name) != expected.get(name))
        if differ or any(code not in accepted for code in codes) or good not in (0, 1):
            said = (folder.parent / f"{folder.name}.log").read_text(errors="replace").splitlines()[-3:]
            wrong.append({"kill": what, "files": differ, "exit codes": codes, "said": said})
        else:
            shutil.rmtree(folder)

    for number in range(kills):
        folder = make_place(place / f"{name}-{number}", run)
        moment = kill_once(command, folder, chance, span)
        moments[moment] += 1
        complete = is_complete(name, folder)
        check(folder, [end(start(command, folder))], [2 if complete else good], f"{number}, {moment}")
    folder = make_place(place / f"{name}-twice", run)
    codes = [end(pid) for pid in [start(command, folder), start(command, folder)]]
    check(folder, codes, [good, 2] if good in codes else [good], "two at once")
    return {"kills": kills, **moments, "wrong": wrong}


def main() -> None:
    """Kill each command in turn, and print the table; exit 1 if anything was left, lost or other than it should be."""
    options = parser(__doc__)
    options.add_argument("kills", type=int, help="of all commands together")
    options.add_argument("--commands", default=",".join(COMMANDS), help="which, a comma between two")
    options.add_argument("--seed", type=int, default=0, help="of the times")
    chosen = options.parse_args()
    names = chosen.commands.split(",")
    found: dict[str, Any] = {}
    from fg_mujoco.cli.main import main as fg_mujoco

    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        with contextlib.redirect_stdout(io.StringIO()):  # here, so that all processes have modules already
            fg_mujoco([*f"race {SMALL} --out".split(), str(place / "run")])
        for i, name in enumerate(names):
            kills = len(range(i, chosen.kills, len(names)))
            found[name] = measure(name, kills, chosen.seed, place, place / "run")
            for wrong in found[name]["wrong"]:
                print(f"{name}: {wrong}", file=sys.stderr)
    moments = ("before it wrote", "was writing", "left something aside", "had ended")
    rows = [
        (name, counts["kills"], *(counts.get(moment, 0) for moment in moments), len(counts["wrong"]))
        for name, counts in found.items()
    ]
    report(found, table(("command", "kills", *moments, "wrong after the same command"), rows), chosen.json)
    sys.exit(any(counts["wrong"] for counts in found.values()))


if __name__ == "__main__":
    main()
