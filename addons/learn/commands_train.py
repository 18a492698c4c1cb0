"""The command `fg-mujoco train`: a policy by PPO."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fg_mujoco.cli.options import add_trust_option, names_in, whole
from fg_mujoco.cli.progress import clock, shown_as, to_go
from fg_mujoco.course.documents import read_toml, read_value
from fg_mujoco.course.files import is_file
from fg_mujoco.errors import SettingsError

_DONE, _NOT_DONE = 0, 1
_OWN = ("steps", "worlds", "seed", "threads", "checkpoints", "start_from", "estimate")


def add_train(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "train a policy by PPO of Stable-Baselines3; its folder is a planner"
    command = add_command(commands, "train", _train, text)
    add = command.add_argument
    add(
        "settings", metavar="SETTINGS.toml", nargs="?",
        help="a file with steps, worlds, seed and the tables [environment], [ppo], [teacher], [self_play]; options win",
    )  # fmt: skip
    add(
        "--track", type=names_in, metavar="LIST",
        help="of the environment; comma between two; default: random:0:100,random:0:100:tight",
    )  # fmt: skip
    add("--steps", type=whole, metavar="N", help="of all worlds together; default: 1000000")
    add("--worlds", type=whole, metavar="N", help="that are driven at once; default: 32")
    add("--seed", type=whole, metavar="K", help="of the worlds and of the network; default: 0")
    add("--threads", type=whole, metavar="N", help="that drive the worlds, and that torch has; default: 1")
    add("--start-from", metavar="PATH", help="begin with the weights of another training's folder, or of a policy.zip")
    add("--estimate", type=names_in, metavar="LIST", help="privileged terms that the actor gets estimates of, as mu")
    add("--checkpoints", type=whole, metavar="N", help="how many are written; default: 20")
    add(
        "--env", action="append", default=[], metavar="NAME=VALUE",
        help="a setting of the environment, as 'observation=beams:54,speed,flat', speed_range=[0.5,6]; again for each",
    )  # fmt: skip
    add(
        "--ppo", action="append", default=[], metavar="NAME=VALUE",
        help="a setting of PPO, as gamma=0.995 or net=[64,64]; again for each",
    )  # fmt: skip
    add(
        "--self-play", action="append", default=[], metavar="NAME=VALUE",
        help="race opponents drawn from earlier versions and planners: share=0.5, every=250000, kept=10, "
        "planners=[\"gap_finder\"]; again for each",
    )  # fmt: skip
    add(
        "--teacher", action="append", default=[], metavar="NAME=VALUE",
        help="a planner that is told the friction teaches the policy first: planner=gap_finder, steps=2000000; again "
        "for each",
    )  # fmt: skip
    add("--out", metavar="DIR", required=True, help="folder; the same command goes on with a training that is there")
    add("--json", action="store_true", help="print one JSON object and nothing else")
    add_trust_option(add, "go on with, or start from, a checkpoint that you did not write here, which runs its code")


def _train(options: argparse.Namespace) -> int:
    from .training import train
    from .training_settings import TrainingProgress

    settings = _settings(options)

    def text(progress: TrainingProgress) -> str:
        figures = progress.figures
        if "teacher/loss" in figures:
            done = f"taught {progress.steps}/{progress.total} steps, {progress.rate:.0f}/s"
            return f"{done}, loss {figures['teacher/loss']:.3f}" + to_go(progress.remaining_s)
        shown = [f"{figures[name]:.2f} {unit}" for name, unit in _SHOWN.items() if name in figures]
        done = f"{progress.steps}/{progress.total} steps, {progress.rate:.0f}/s"
        return ", ".join([done, *shown]) + to_go(progress.remaining_s)

    with (
        contextlib.redirect_stdout(sys.stderr),
        shown_as(text, "preparing worlds", show=not options.json) as watch,
    ):
        try:
            training = train(options.out, watch=watch, trust=options.trust, **settings)
        except KeyboardInterrupt:
            said = "interrupted; its policy races, and the same command goes on"
            print(f"fg-mujoco: {options.out}: {said}", file=sys.stderr)
            raise
    if options.json:
        print(json.dumps({"steps": training.steps, "seconds": training.seconds, **training.figures}, indent=2))
    else:
        print(f"{options.out}: {training.steps} steps, {clock(training.seconds)}")
        print(f"fg-mujoco race --controller {options.out}")
    return _DONE


_SHOWN = {"episode/return": "return", "episode/laps": "laps", "episode/speed_m_s": "m/s"}


def _settings(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of a training, of the file and of the options.

    Raises:
      SettingsError: what is none.
    """
    found: dict[str, Any] = {}
    if options.settings is not None:
        if not is_file(options.settings):
            raise SettingsError(f"{options.settings}: there is no such file; accepted: a TOML file")
        found = _with_underscores(read_toml(options.settings).values)
    found |= {name: value for name in _OWN if (value := getattr(options, name)) is not None}
    given = {"environment": ("--env", options.env), "ppo": ("--ppo", options.ppo)}
    optional = {"self_play": ("--self-play", options.self_play), "teacher": ("--teacher", options.teacher)}
    given |= {name: each for name, each in optional.items() if each[1] or name in found}
    for table, (option, texts) in given.items():
        own = found.get(table, {})
        if not isinstance(own, dict):
            raise SettingsError(f"{options.settings}: {table} is {own!r}; accepted: a table, [{table}]")
        found[table] = own | _values(texts, option)
    if options.track is not None:
        found["environment"]["track"] = options.track if len(options.track) > 1 else options.track[0]
    return found


def _with_underscores(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a file, whose names and those in its tables may have hyphens."""
    return {
        name.replace("-", "_"): {key.replace("-", "_"): each for key, each in value.items()}
        if isinstance(value, dict)
        else value
        for name, value in values.items()
    }


def _values(texts: Sequence[str], option: str) -> dict[str, Any]:
    """Return values by name of texts such as `gamma=0.995`; what is no value of TOML is a text."""
    found: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or name in found:
            accepted = "NAME=VALUE" if not equals else f"{name} once"
            raise SettingsError(f"{option} {text!r}; accepted: {accepted}")
        found[name.strip().replace("-", "_")] = read_value(value.strip())
    return found
