"""Tries a door again and again in a process of its own, and tells every try that went wrong.

Wrong is: a traceback, a death, more than 10 s, more than 1.5 GB; of a command that refuses its input, too: more than
one line, anything on its standard output, and anything written.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a try may take."""

    time: float = 10.0  # [s]
    memory: int = 1_500_000  # [kB] of the process, imports and all


_TESTS = Path(__file__).parents[1]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A try that went wrong. `python -m fuzzing --door DOOR --seed SEED --only TRY` does it again."""

    door: str
    seed: int
    number: int
    wrong: str

    def __str__(self) -> str:
        return f"{self.door}, seed {self.seed}, try {self.number}: {self.wrong}"


@dataclass(frozen=True, kw_only=True)
class Tally:
    """What came of many tries at one door."""

    door: str
    tries: int
    refused: int
    findings: tuple[Finding, ...]
    slowest: float  # [s]
    memory: int  # [kB] the greatest of all processes


def knock(
    door: str,
    tries: int,
    *,
    seed: int,
    first: int = 0,
    doors: str = "fuzzing.doors:DOORS",
    limits: Limits | None = None,
) -> Tally:
    """Try a door; after a death or a hang, go on with the next try in a new process.

    Args:
      door: its name in `doors`.
      tries: how many.
      seed: of the whole; a try is drawn from it, the door's name and the try's number, and from nothing else.
      first: number of the first try.
      doors: the module that has them, and their name in it behind a colon.
      limits: of a try; None: the usual ones.
    """
    findings: list[Finding] = []
    refused = memory = 0
    slowest, number = 0.0, first
    with tempfile.TemporaryDirectory(prefix="fuzzing-") as folder:
        while number < first + tries:
            with _Knocker(doors, door, seed, number, first + tries, Path(folder), limits or Limits()) as knocker:
                for told in knocker:
                    number = told.number + 1
                    refused += told.refused
                    slowest = max(slowest, told.seconds)
                    if told.wrong:
                        findings.append(Finding(door=door, seed=seed, number=told.number, wrong=told.wrong))
                memory = max(memory, knocker.memory)
    return Tally(door=door, tries=tries, refused=refused, findings=tuple(findings), slowest=slowest, memory=memory)


@dataclass(frozen=True, kw_only=True)
class _Told:
    number: int
    seconds: float = 0.0
    refused: bool = False
    wrong: str = ""


class _Knocker:
    """The process that tries, watched."""

    def __init__(self, doors: str, door: str, seed: int, number: int, end: int, folder: Path, limits: Limits) -> None:
        reading, writing = os.pipe()
        command = [
            sys.executable,
            "-m",
            "fuzzing.harness",
            doors,
            door,
            *map(str, (seed, number, end, folder, writing)),
        ]
        environment = os.environ | {"FG_MUJOCO_COMPILING": "in tests", "PYTHONPATH": str(_TESTS)}
        self._log = open(folder / "log", "wb+")  # noqa: SIM115
        self._process = subprocess.Popen(
            command, env=environment, pass_fds=[writing], stdin=subprocess.DEVNULL, stdout=self._log, stderr=self._log,
            start_new_session=True, cwd=folder,
        )  # fmt: skip
        os.close(writing)
        self._lines = open(reading, "rb", buffering=0)  # noqa: SIM115
        self._next, self._end, self._limits = number, end, limits
        self.memory = 0

    def __enter__(self) -> _Knocker:
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._lines.close()
        self._log.close()

    def __iter__(self) -> Any:
        os.set_blocking(self._lines.fileno(), False)
        text, begun = b"", time.monotonic() + 300.0  # for what it prepares
        while True:
            chunk = self._lines.read(65536)
            if chunk == b"":
                break
            self._measure()
            *lines, text = (text + (chunk or b"")).split(b"\n")
            for line in lines:
                if line:
                    seconds, refused, wrong = line.decode().split(" ", 2)
                    yield _Told(number=self._next, seconds=float(seconds), refused=refused == "1", wrong=wrong)
                    self._next += 1
                begun = time.monotonic()
            if self.memory > self._limits.memory:
                yield _Told(number=self._next, wrong=f"more than {self._limits.memory} kB of memory")
                return
            if time.monotonic() - begun > self._limits.time:
                yield _Told(number=self._next, seconds=self._limits.time, wrong=f"more than {self._limits.time:g} s")
                return
            if chunk is None:
                time.sleep(0.01)
        code = self._process.wait()
        if self._next < self._end:
            self._log.seek(0)
            last = self._log.read()[-2000:].decode(errors="replace")
            yield _Told(
                number=self._next,
                wrong=f"the process ended with {code} before it was through: {' '.join(last.split())[-300:]}",
            )

    def _measure(self) -> None:
        with contextlib.suppress(OSError, ValueError, IndexError):
            status = Path(f"/proc/{self._process.pid}/status").read_text(encoding="utf-8")
            self.memory = max(self.memory, int(status.split("VmHWM:")[1].split()[0]))


# -- in the process that tries


def main(arguments: list[str]) -> None:
    """Try a door in this process."""
    doors, name, seed, number, end, folder, pipe = arguments
    module, _, catalogue = doors.partition(":")
    made = getattr(importlib.import_module(module), catalogue)[name]
    samples = Path(folder) / "samples"
    if not samples.exists():
        samples.mkdir()
        made.prepare(samples)
    with open(int(pipe), "w", encoding="utf-8", buffering=1) as told, _captured(Path(folder)) as output:
        warm_up()
        told.write("\n")  # ready
        for i in range(int(number), int(end)):
            seconds, refused, wrong = tried(
                made, samples, Path(folder) / f"here-{i}", _generator(name, int(seed), i), output
            )
            told.write(f"{seconds:.4f} {int(refused)} {wrong}\n")


def warm_up() -> None:
    """Load, or compile, what every race needs, so that no try is charged for it."""
    import fg_mujoco as fg

    fg.race("oval", time_limit=0.03)


def _generator(name: str, seed: int, number: int) -> np.random.Generator:
    return np.random.default_rng([seed, crc32(name.encode()), number])


def tried(
    door: Any, samples: Path, here: Path, rng: np.random.Generator, output: Callable[[], str], *, keep: bool = False
) -> tuple[float, bool, str]:
    """Return how long one try took [s], whether it was refused, and what went wrong, in one line."""
    here.mkdir()
    os.chdir(here)
    code: object = None
    said = wrong = ""
    try:
        attempt = door.attempt(samples, here, rng)
        before = _contents(here)
        output()
        begun = time.perf_counter()
        try:
            code = attempt()
        except SystemExit as end:
            code = end.code
        except BaseException as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            wrong = f"{type(error).__name__}: {str(error)[:200]} at {Path(where.filename).name}:{where.lineno}"
        seconds = time.perf_counter() - begun
        said = output()
        wrong = wrong or _wrong(code, said, before, here)
    finally:
        os.chdir(here.parent)
        if not keep:
            shutil.rmtree(here, ignore_errors=True)
    return seconds, code == 2, " ".join(wrong.split())[:600].encode(errors="replace").decode()


def _wrong(code: object, said: str, before: dict[Path, bytes | None], here: Path) -> str:
    if "Traceback (most" in said:
        return f"a traceback: {said[-300:]}"
    if code not in (0, 1, 2, None):
        return f"exit code {code}: {said[-300:]}"
    if code != 2:
        return ""
    lines = [line for line in said.splitlines() if not line.startswith("fg-mujoco: warning")]
    if len(lines) != 1 or not lines[0].startswith("fg-mujoco"):
        return f"{len(lines)} lines for a refusal: {said[-400:]}"
    if len(said) > 5000:
        return f"a refusal of {len(said)} characters"
    after = _contents(here)
    changed = [
        str(path.relative_to(here)) for path in before.keys() | after.keys() if before.get(path) != after.get(path)
    ]
    return f"refused, but wrote {', '.join(sorted(changed)[:3])}: {said[:200]}" if changed else ""


def _contents(folder: Path) -> dict[Path, bytes | None]:
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@contextlib.contextmanager
def _captured(folder: Path) -> Any:
    """Send what this process and its C libraries print to a file; give a function that returns and forgets it."""
    with open(folder / "output", "w+b") as file:
        kept = os.dup(1), os.dup(2)
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)

        def output() -> str:
            sys.stdout.flush()
            sys.stderr.flush()
            file.seek(0)
            text = file.read().decode(errors="replace")
            os.truncate(file.fileno(), 0)
            file.seek(0)
            return text

        try:
            yield output
        finally:
            for number, old in enumerate(kept, start=1):
                os.dup2(old, number)
                os.close(old)


if __name__ == "__main__":
    main(sys.argv[1:])
