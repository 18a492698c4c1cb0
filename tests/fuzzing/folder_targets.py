"""Targets of folders: of a race, a rollout and a comparison, as others send them or disks damage them."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.random import Generator

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.racing.run_folder import write_run
from forging import without_checksums

from .mutations import WORDS, mutated, mutated_binary, one_of
from .target import SHORT, Attempt, Target, command

QUICK = ("--n", "3", "--time-limit", "0.05", "--chunk", "1", "--workers", "1")
COMPARED = ("--controller", "gap_finder", "--track", "oval", "--seed", "0:1", "--laps", "1", "--time-limit", "0.05")


def run(samples: Path) -> None:
    result = fg.race("oval", laps=1, time_limit=0.2)
    without_checksums(write_run(result, samples / "run"))  # what is read is checked for itself


def read(here: Path, rng: Generator) -> Attempt:
    readers = (
        ("replay", "run"), ("export", "run", "--out", "run.mcap"), ("race", "--config", "run", *SHORT),
        ("report", "run", "--no-clip"),
    )  # fmt: skip
    return command(*one_of(rng, (*readers[:3], readers[0], *readers)))


def _run_file(name: str) -> Callable[[Path, Path, Generator], Attempt]:
    def attempt(samples: Path, here: Path, rng: Generator) -> Attempt:
        shutil.copytree(samples / "run", here / "run")
        path = here / "run" / name
        path.write_bytes(mutated(path.read_bytes(), rng))
        return read(here, rng)

    return attempt


def any_json(value: Any, rng: Generator) -> Any:
    """Return a JSON value with one of its leaves or branches replaced."""
    if isinstance(value, dict) and value and rng.random() < 0.85:
        key = one_of(rng, list(value))
        return {**value, key: any_json(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.7:
        place = int(rng.integers(len(value)))
        return [*value[:place], any_json(value[place], rng), *value[place + 1 :]]
    deep: Any = 1
    for _ in range(200):
        deep = [deep]
    return one_of(
        rng,
        (
            None, True, 0, -1, 1e308, float("inf"), 10**12, 2**63, 10**30, 10**400, "", *WORDS[:12], [], {}, [1], [[1]],
            {"a": 1}, deep, [[]] * 9999, "x" * 9999, 0.5,
        ),
    )


def _summary(samples: Path, here: Path, rng: Generator) -> Attempt:
    shutil.copytree(samples / "run", here / "run")
    any_json_file(here / "run" / "summary.json", rng)
    return read(here, rng)


def any_json_file(path: Path, rng: Generator) -> None:
    """Change a file of JSON: its text, one of its values, or which names it has."""
    content = json.loads(path.read_text(encoding="utf-8"))
    change = rng.random()
    if change < 0.3:
        path.write_bytes(mutated(path.read_bytes(), rng))
        return
    if change < 0.6:
        del content[one_of(rng, list(content))]
    if change > 0.5:
        content = any_json(content, rng)
    path.write_text(json.dumps(content), encoding="utf-8")


def changed_arrays(path: Path, rng: Generator) -> None:
    """Change a file of arrays: its bytes, or one of its arrays."""
    if rng.random() < 0.3:
        path.write_bytes(mutated_binary(path.read_bytes(), rng))
        return
    with np.load(path) as file:
        arrays = dict(file)
    name = one_of(rng, list(arrays))
    array = np.atleast_1d(arrays[name])
    first, second = (array.flat[int(rng.integers(max(1, array.size)))] if array.size else 0 for _ in range(2))
    changes: tuple[Callable[[], Any], ...] = (
        lambda: array[:-1], lambda: array[:0], lambda: array.T, lambda: array.reshape(-1), lambda: np.zeros(()),
        lambda: array.astype(str),
        lambda: array.astype(np.complex64), lambda: array.astype(np.float16),
        lambda: np.where(array == first, np.nan, array),
        lambda: np.where(array == first, 1e300, array), lambda: np.where(array == first, second, array),
        lambda: array[::-1],
        lambda: np.zeros((0, *array.shape)), lambda: np.tile(array, (2,) * max(1, array.ndim)),
        lambda: np.zeros(3_000_000),
    )  # fmt: skip
    with np.errstate(all="ignore"), contextlib.suppress(TypeError, ValueError):
        arrays[name] = one_of(rng, changes)()
    if rng.random() < 0.1:
        del arrays[name]
    if rng.random() < 0.05:
        arrays["more"] = np.zeros(3)
    np.savez_compressed(path, **arrays)
    if rng.random() < 0.1:  # a member that says of itself what is not so
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
        with zipfile.ZipFile(path, "a") as file:
            file.writestr(f"{name}.npy", header.getvalue())


def _states(samples: Path, here: Path, rng: Generator) -> Attempt:
    shutil.copytree(samples / "run", here / "run")
    changed_arrays(here / "run" / "states.npz", rng)
    return read(here, rng)


def _study(samples: Path, here: Path, rng: Generator, again: tuple[str, ...]) -> Attempt:
    """Change one file of a study's folder, or lose it, or put another in its place; then do the study again."""
    shutil.copytree(samples / "study", here / "study")
    parts = sorted(path for path in (here / "study").rglob("*") if path.is_file() and path.suffix != ".png")
    path = one_of(rng, parts)
    change = rng.random()
    if change < 0.1:
        path.unlink()
    elif change < 0.25:
        shutil.copy(one_of(rng, parts), path.parent / "copied")
        (path.parent / "copied").replace(path)
    elif path.suffix in (".npz",):
        changed_arrays(path, rng)
    elif path.suffix in (".npy",):
        path.write_bytes(mutated_binary(path.read_bytes(), rng))
    else:
        path.write_bytes(mutated(path.read_bytes(), rng))
    return command(*again, "--out", "study")


def _rollout(samples: Path) -> None:
    main(["rollout", *QUICK, "--record", "states", "--out", str(samples / "study"), "--json"])


def _rollout_folder(samples: Path, here: Path, rng: Generator) -> Attempt:
    return _study(samples, here, rng, ("rollout", *QUICK, "--record", "states"))


def _comparison(samples: Path) -> None:
    main(["compare", *COMPARED, "--workers", "1", "--out", str(samples / "study")])


def _comparison_folder(samples: Path, here: Path, rng: Generator) -> Attempt:
    attempt = _study(samples, here, rng, ("compare", *COMPARED, "--workers", "1"))
    return attempt if rng.random() < 0.1 else _undrawn(attempt)


def _undrawn(attempt: Attempt) -> Attempt:
    """Return a comparison without its pictures, which take most of its time; its tables are written."""

    def call() -> object:
        module = "fg_mujoco.addons.arena.study.pictures"
        with patch(f"{module}.table_picture"), patch(f"{module}.trace_pictures"):
            return attempt()

    return call


TARGETS = {
    "run_summary": Target(attempt=_summary, prepare=run),
    "run_states": Target(attempt=_states, prepare=run),
    "run_telemetry": Target(attempt=_run_file("telemetry.csv"), prepare=run),
    "run_scene": Target(attempt=_run_file("scene.xml"), prepare=run),
    "rollout_folder": Target(attempt=_rollout_folder, prepare=_rollout),
    "comparison_folder": Target(attempt=_comparison_folder, prepare=_comparison),
}
