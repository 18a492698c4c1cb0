"""The command `fg-mujoco overtake`.

Exit codes: 0 all duels were driven, however they ended; 1 a duel could not be driven; 2 input that cannot be used; 130
Ctrl-C. Duels that are finished then stay in the folder of `--out`, and the same command goes on with the others.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable
from typing import Any

from ..errors import EngineError
from ..studies.overtaking.overtaking import (
    DEFAULT_RATIO,
    DEFAULT_SEEDS,
    DEFAULT_TRACKS,
    Overtaking,
    OvertakingProgress,
    overtake,
)
from ..studies.overtaking.slower_opponents import OPPONENTS
from ..studies.store import as_json
from .compare import names_in, seeds_in
from .config import add_config
from .options import add_setup_options, add_trust_option, can_draw, number, setup_of, whole
from .out import STUDY, add_out_options
from .progress import shown_as, to_go

_DONE, _NOT_DONE = 0, 1
_DRIVE = (
    "vehicle", "tires", "mu", "planner_mu", "max_speed", "mass", "cog_height", "steering_gain", "speed_gain",
    "command_delay",
)  # fmt: skip


def add_overtake(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "drive a planner behind slower opponents, and make a table of how often it overtakes"
    command = add_command(commands, "overtake", _overtake, text)
    add = command.add_argument
    add(
        "--controller", type=names_in, default=["overtaker"], metavar="LIST",
        help="NAME or path/to/file.py:ClassName, with settings in brackets, comma between two; default: overtaker",
    )  # fmt: skip
    add(
        "--track", type=names_in, default=DEFAULT_TRACKS, metavar="LIST",
        help=f"NAME, random:SEED[:tight] or file.csv; default: {','.join(DEFAULT_TRACKS)}",
    )  # fmt: skip
    add(
        "--opponents", type=names_in, default=OPPONENTS, metavar="LIST",
        help=f"of {','.join(OPPONENTS)}; default: all",
    )  # fmt: skip
    add(
        "--speed-ratio", type=_ratio, default=DEFAULT_RATIO, metavar="LOW:HIGH",
        help="of the opponent to the planner's own speed at the same place; default: .3:.9",
    )  # fmt: skip
    add(
        "--seed", type=seeds_in, default=DEFAULT_SEEDS, metavar="LIST",
        help="numbers, or FIRST:END without END; of start, distance and speed ratio; default: 0:50",
    )  # fmt: skip
    add_setup_options(add, "laps", *_DRIVE, laps="within which the planner is to overtake; default: 2")
    add("--workers", type=whole, metavar="N", help="processes; default: as many as there are cores")
    add_out_options(
        command,
        STUDY,
        "table, picture and finished duels; the same command goes on with a folder left unfinished, and a larger "
        "one drives only what is new",
        required=True,
    )  # fmt: skip
    add("--json", action="store_true", help="print one JSON object and nothing else")
    add_config(command)
    add_trust_option(add)


def _overtake(options: argparse.Namespace) -> int:
    setup = setup_of(options, lists=("controller", "track", "opponents", "seed"))
    with (
        contextlib.redirect_stdout(sys.stderr),
        shown_as(_progress, "preparing duels", show=not options.json) as watch,
    ):
        try:
            result = overtake(
                options.controller,
                track=options.track,
                opponents=options.opponents,
                speed_ratio=options.speed_ratio,
                seed=options.seed,
                setup=setup,
                workers=options.workers,
                out=options.out,
                pictures=can_draw("pictures"),
                watch=watch,
            )
        except EngineError as error:
            print("fg-mujoco:", *f"{error}; finished duels are kept".split(), file=sys.stderr)
            return _NOT_DONE
        except KeyboardInterrupt:
            print(f"fg-mujoco: {options.out}: interrupted; the same command goes on", file=sys.stderr)
            raise
    print(as_json(result.summary()) if options.json else _report(result, options.out, setup.first.friction))
    return _NOT_DONE if any(row.figures.outcome == "failed" for row in result.rows) else _DONE


def _ratio(text: str) -> tuple[float, float]:
    """Read `.3:.9`."""
    low, colon, high = text.partition(":")
    if not colon:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: LOW:HIGH")
    return number(low), number(high)


def _progress(progress: OvertakingProgress) -> str:
    done = progress.duels_found + progress.duels_driven
    return f"{done}/{progress.duels} duels{to_go(progress.remaining_s)}"


def _report(result: Overtaking, out: str, friction: str) -> str:
    found = len(result.rows) - result.duels_driven
    earlier = f", {found} of them by an earlier call" if found else ""
    return f"{result.markdown()}\n{len(result.rows)} duels{earlier}; written to {out}\n{friction}"
