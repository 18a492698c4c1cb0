"""Tries a target again and again in a process of its own, and tells every try that went wrong.

That process is a fork of one which has imported the targets and driven a race, so that each target is not charged for
it.

Wrong is: a traceback, a death, more than 10 s, more than 1.5 GB; of a command that refuses its input, too: more than
one line, anything on its standard output, and anything written.
"""

import contextlib
import importlib
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
from dataclasses import dataclass
from functools import cache
from multiprocessing import forkserver
from pathlib import Path
from unittest.mock import patch
from zlib import crc32

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a try may take."""

    time: float = 10.0  # [s]
    memory: int = 1_500_000  # [kB] of the process, imports and all


_TESTS = Path(__file__).parents[1]
READY = "ready"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A try that went wrong. `python -m fuzzing --target TARGET --seed SEED --only TRY` does it again."""

    target: str
    seed: int
    number: int
    wrong: str

    def __str__(self):
        return f"{self.target}, seed {self.seed}, try {self.number}: {self.wrong}"


@dataclass(frozen=True, kw_only=True)
class Tally:
    """What came of many tries at one target."""

    target: str
    tries: int
    refused: int
    findings: tuple[Finding, ...]
    slowest: float  # [s]
    memory: int  # [kB] the greatest of all processes


def knock(target, tries, *, seed, first=0, targets="fuzzing.targets:TARGETS", limits=None):
    """Try a target; after a death or a hang, go on with the next try in a new process.

    Args:
      target: its name in `targets`.
      tries: how many.
      seed: of the whole; a try is drawn from it, the target's name and the try's number, and from nothing else.
      first: number of the first try.
      targets: the module that has them, and their name in it behind a colon.
      limits: of a try; None: the usual ones.
    """
    findings = []
    refused = memory = 0
    slowest, number = 0.0, first
    with tempfile.TemporaryDirectory(prefix="fuzzing-") as folder:
        while number < first + tries:
            with _Knocker(targets, target, seed, number, first + tries, Path(folder), limits or Limits()) as knocker:
                for told in knocker:
                    number = told.number + 1
                    refused += told.refused
                    slowest = max(slowest, told.seconds)
                    if told.wrong:
                        findings.append(Finding(target=target, seed=seed, number=told.number, wrong=told.wrong))
                memory = max(memory, knocker.memory)
    return Tally(target=target, tries=tries, refused=refused, findings=tuple(findings), slowest=slowest, memory=memory)


@dataclass(frozen=True, kw_only=True)
class _Told:
    number: int
    seconds: float = 0.0
    refused: bool = False
    wrong: str = ""


class _Knocker:
    """The process that tries, watched."""

    def __init__(self, targets: str, target: str, seed: int, number: int, end: int, folder: Path,
                 limits: Limits) -> None:  # fmt: skip
        self._log = folder / "log"
        self._told, telling = _forks().Pipe(duplex=False)
        arguments = (targets, target, seed, number, end, folder, telling)
        self._process = _forks().Process(target=_try_target, args=arguments)
        self._process.start()
        telling.close()
        self._next, self._end, self._limits = number, end, limits
        self.memory = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)  # and what it has started
        self._process.kill()
        self._process.join()
        self._told.close()

    def __iter__(self):
        begun = time.monotonic() + 300.0  # for what it prepares
        while True:
            try:
                told = self._told.recv() if self._told.poll(0.01) else None
            except (EOFError, OSError):  # it has ended, maybe while it told something
                break
            self._measure()
            if told is not None:
                begun = time.monotonic()
                if told != READY:
                    seconds, refused, wrong = told
                    yield _Told(number=self._next, seconds=seconds, refused=refused, wrong=wrong)
                    self._next += 1
            if self.memory > self._limits.memory:
                yield _Told(number=self._next, wrong=f"more than {self._limits.memory} kB of memory")
                return
            if time.monotonic() - begun > self._limits.time:
                yield _Told(number=self._next, seconds=self._limits.time, wrong=f"more than {self._limits.time:g} s")
                return
        self._process.join()
        if self._next < self._end:
            last = self._log.read_bytes()[-2000:].decode(errors="replace")
            code = self._process.exitcode
            yield _Told(number=self._next,
                        wrong=f"the process ended with {code} before it was through: {' '.join(last.split())[-300:]}")

    def _measure(self):
        with contextlib.suppress(OSError, ValueError, IndexError):
            status = Path(f"/proc/{self._process.pid}/status").read_text(encoding="utf-8")
            self.memory = max(self.memory, int(status.split("VmHWM:")[1].split()[0]))


@cache
def _forks():
    """Start the process of which those that try are forks: it has loaded what every target needs, and waits."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["fuzzing.warm"])
    paths = os.pathsep.join(map(str, (_TESTS, _TESTS / "worlds")))
    with patch.dict(os.environ, {"FG_MUJOCO_COMPILING": "in tests", "PYTHONPATH": paths}):
        forkserver.ensure_running()
    return context


# -- in the process that tries


def _try_target(targets, name, seed, number, end, folder, telling):
    os.setsid()
    os.chdir(folder)
    log = os.open("log", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    for stream in (1, 2):
        os.dup2(log, stream)
    importlib.import_module("fuzzing.warm")
    module, _, catalogue = targets.partition(":")
    made = getattr(importlib.import_module(module), catalogue)[name]
    samples = folder / "samples"
    if not samples.exists():
        samples.mkdir()
        made.prepare(samples)
    with telling, _captured(folder) as output:
        telling.send(READY)
        for i in range(number, end):
            telling.send(tried(made, samples, folder / f"here-{i}", _generator(name, seed, i), output))


def _generator(name, seed, number):
    return np.random.default_rng([seed, crc32(name.encode()), number])


def tried(target, samples, here, rng, output, *, keep=False):
    """Return how long one try took [s], whether it was refused, and what went wrong, in one line."""
    here.mkdir()
    os.chdir(here)
    code = None
    said = wrong = ""
    try:
        attempt = target.attempt(samples, here, rng)
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


def _wrong(code, said, before, here):
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
    changed = [str(path.relative_to(here)) for path in before.keys() | after.keys()
               if before.get(path) != after.get(path)]  # fmt: skip
    return f"refused, but wrote {', '.join(sorted(changed)[:3])}: {said[:200]}" if changed else ""


def _contents(folder):
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@contextlib.contextmanager
def _captured(folder):
    """Send what this process and its C libraries print to a file; give a function that returns and forgets it."""
    with open(folder / "output", "w+b") as file:
        kept = os.dup(1), os.dup(2)
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)

        def output():
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
