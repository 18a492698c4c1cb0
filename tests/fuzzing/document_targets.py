"""Targets of documents in JSON and TOML: policies, trainings, labs, suites, columns of drives.

A document that is right is changed at one of its leaves or branches, or in its text.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numpy.random import Generator

from fg_mujoco.addons.learn.policy_files import save_policy
from fg_mujoco.addons.learn.training_settings import TrainingSettings
from fg_mujoco.course.documents import read_toml, toml_text
from fg_mujoco.simulation.settings import known_settings
from small_policies import FLAT, PARTS, interface_of, network_for

from .folder_targets import any_json
from .mutations import mutated, one_of
from .other_targets import drives
from .target import SHORT, Attempt, Target, command, ignore_refusal

# -- policies


def _policies(samples: Path) -> None:
    residual = PARTS | {"observation": "speed,beams:54,planner_command", "residual": {"planner": "gap_finder"}}
    for name, settings in {"flat": FLAT, "parts": PARTS, "residual": residual}.items():
        interface = interface_of(**settings)
        save_policy(network_for(interface, normalised=True), samples / f"{name}.json", interface, trained={"steps": 3})


def _policy(samples: Path, here: Path, rng: Generator) -> Attempt:
    text = (samples / one_of(rng, ("flat.json", "parts.json", "residual.json"))).read_text(encoding="utf-8")
    content = json.loads(text)
    part = one_of(rng, ("interface", "interface", "interface", "network", None))
    if part is None:
        (here / "policy.json").write_bytes(mutated(text.encode(), rng))
    else:
        content[part] = any_json(content[part], rng)
        (here / "policy.json").write_text(json.dumps(content), encoding="utf-8")
    return command("race", "--controller", "policy.json", *SHORT)


# -- documents in TOML

_TRAINING: dict[str, Any] = {
    "steps": 128, "worlds": 2, "seed": 0, "checkpoints": 1,
    "environment": {
        "track": "oval", "observation": "beams:5,speed,normalised,flat", "privileged": "mu", "time_limit": 1.0,
        "laps": 1, "opponents": ["gap_finder"], "speed_range": [0.5, 8.0], "builds": 1,
        "randomize": {"mu": "0.5:1.1"}, "rewards": {"preset": "race"},
    },
    "ppo": {"net": [4], "n_steps": 32, "minibatches": 2, "n_epochs": 1},
    "self_play": {"share": 0.5, "every": 100, "kept": 2, "planners": ["gap_finder"]},
}  # fmt: skip
_LAB: dict[str, Any] = {
    "name": "a lab", "track": "oval", "laps": 1, "time_limit": 0.05, "passing": 10, "obstacles": 1,
    "checks": [
        {"check": "finishes", "points": 10}, {"check": "no_crash", "points": 5.5, "least_progress_m": 0.1, "mu": 0.9},
        {"check": "follows_wall", "side": "left", "distance_m": 1.0, "within_m": 0.2, "points": 2, "name": "wall"},
    ],
}  # fmt: skip
_SUITE: dict[str, Any] = {
    "time_limit": 0.1, "name": "duels", "version": 1, "assists": ["none"],
    "groups": [
        {"name": "a", "track": ["oval"], "starts": 1, "opponent": ["right"], "speed": [0.5], "headway": 3.0,
         "offset": 0.0},
        {"name": "b", "track": "hairpins", "starts": [1.0], "opponent": "left", "speed": 0.8, "mu": [0.8, 0.9]},
    ],
}  # fmt: skip
_COLUMNS: dict[str, Any] = {
    "time": {"column": "t", "unit": "s", "scale": "measured"}, "speed": {"column": "v", "scale": 1.01},
    "yaw_rate": {"column": "r", "unit": "rad/s", "delay": 0.02}, "steering": "d", "steering_is": "command",
    "x": "x", "y": "y", "yaw": {"column": "yaw", "unit": "rad"}, "pose_ahead": 0.0,
    "beams": {"columns": "beam_{}", "count": 1081, "field_of_view": 270.0, "nothing": 65.5},
}  # fmt: skip


def _toml(document: dict[str, Any], use: Callable[[Path, Path], Attempt]) -> Callable[[Path, Path, Generator], Attempt]:
    def attempt(samples: Path, here: Path, rng: Generator) -> Attempt:
        key, changed = one_of(rng, list(document)), dict(document)
        if rng.random() < 0.1:
            del changed[key]
        else:
            changed[key] = any_json(document[key], rng)
        content = toml_text(changed).encode(errors="surrogateescape")
        (here / "document.toml").write_bytes(mutated(content, rng) if rng.random() < 0.3 else content)
        return use(samples, here)

    return attempt


def _read_training() -> TrainingSettings:
    return TrainingSettings(**known_settings(read_toml("document.toml").values, TrainingSettings, "a training"))


TARGETS = {
    "policy": Target(attempt=_policy, prepare=_policies),
    "training": Target(
        attempt=_toml(_TRAINING, lambda samples, here: ignore_refusal(_read_training)),
    ),
    "lab": Target(
        attempt=_toml(_LAB, lambda samples, here: command("study", "document.toml", "wall_follow", "--workers", "1")),
    ),
    "suite": Target(
        attempt=_toml(
            _SUITE,
            lambda samples, here: command("study", "document.toml", "gap_finder", "--out", "suite", "--workers", "1"),
        ),
    ),
    "columns": Target(
        attempt=_toml(
            _COLUMNS,
            lambda samples, here: command("validate", samples / "drive.csv", "--columns", "document.toml"),
        ),
        prepare=drives,
    ),
}
