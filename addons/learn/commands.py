"""The command `fg-mujoco train`: a policy by PPO."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from typing import Any

from fg_mujoco.arguments import with_underscores
from fg_mujoco.cli.command import JSON, Part, command, named_values, names_in, option, whole
from fg_mujoco.cli.options import NAMES
from fg_mujoco.cli.progress import clock, shown_as, to_go
from fg_mujoco.course.documents import read_toml, read_value
from fg_mujoco.course.files import is_file
from fg_mujoco.errors import SettingsError

_OWN = ("steps", "worlds", "seed", "threads", "checkpoints", "start_from")


def _settings_of(name: str, text: str) -> Part:
    """Return the option of the settings of a table of the file, each given by itself."""
    return option(name, f"{text}; again for each", "NAME=VALUE", default=[], action="append")


@command(
    option(
        "settings", "a file with steps, worlds, seed and the tables [environment] and [ppo]; options win",
        "SETTINGS.toml", nargs="?",
    ),
    option(
        "--track", "of the environment; comma between two; default: random:0:100,random:0:100:tight", "LIST", names_in,
        names=NAMES["track"],
    ),
    option("--steps", "of all worlds together; default: 1000000", "N", whole),
    option("--worlds", "worlds that drive at once; default: 32", "N", whole),
    option("--seed", "seed of the worlds and of the network; default: 0", "K", whole),
    option("--threads", "threads of the worlds and of torch; default: 1", "N", whole),
    option("--start-from", "begin with the weights of another training's folder, or of a policy.zip", "PATH"),
    option("--checkpoints", "number of checkpoints; default: 20", "N", whole),
    _settings_of(
        "--env", "a setting of the environment, as 'observation=beams:54,speed,flat', speed_range=[0.5,6]"
    ),
    _settings_of("--ppo", "a setting of PPO, as gamma=0.995 or net=[64,64]"),
    option("--out", "folder; the same command continues a training in it", "DIR", required=True),
    JSON,
)  # fmt: skip
def train_command(options: argparse.Namespace) -> int:
    """Train a policy by PPO of Stable-Baselines3; its folder is a planner."""
    from .training import train
    from .training_settings import TrainingProgress

    settings = _settings(options)

    def text(progress: TrainingProgress) -> str:
        figures = progress.figures
        shown = [f"{figures[name]:.2f} {unit}" for name, unit in _SHOWN.items() if name in figures]
        done = f"{progress.steps}/{progress.total} steps, {progress.rate:.0f}/s"
        return ", ".join([done, *shown]) + to_go(progress.remaining_s)

    with (
        contextlib.redirect_stdout(sys.stderr),
        shown_as(text, "preparing worlds", show=not options.json) as watch,
    ):
        try:
            training = train(options.out, watch=watch, **settings)
        except KeyboardInterrupt:
            said = "interrupted; its policy races, and the same command goes on"
            print(f"fg-mujoco: {options.out}: {said}", file=sys.stderr)
            raise
    if options.json:
        print(json.dumps({"steps": training.steps, "seconds": training.seconds, **training.figures}, indent=2))
    else:
        print(f"{options.out}: {training.steps} steps, {clock(training.seconds)}")
        print(f"fg-mujoco race --controller {options.out}")
    return 0


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
        found = {
            name: with_underscores(value) if isinstance(value, dict) else value
            for name, value in with_underscores(read_toml(options.settings).values).items()
        }
    found |= {name: value for name in _OWN if (value := getattr(options, name)) is not None}
    for table, name, texts in (("environment", "--env", options.env), ("ppo", "--ppo", options.ppo)):
        own = found.get(table, {})
        if not isinstance(own, dict):
            raise SettingsError(f"{options.settings}: {table} is {own!r}; accepted: a table, [{table}]")
        given_here = named_values(texts, name, "NAME=VALUE")
        found[table] = own | {
            key.strip().replace("-", "_"): read_value(value.strip()) for key, value in given_here.items()
        }
    if options.track is not None:
        found["environment"]["track"] = options.track if len(options.track) > 1 else options.track[0]
    return found
