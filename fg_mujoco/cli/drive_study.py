"""The commands of studies that drive a grid, `fg-mujoco compare` and `fg-mujoco overtake`: their options and their end.

Exit codes: 0 all runs were driven, however they ended; 1 a run could not be driven; 2 input that cannot be used; 130
Ctrl-C. Runs that are finished then stay in the folder of `--out`, and the same command goes on with the others.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Sequence
from typing import Any

from ..errors import EngineError
from ..racing.setup import Setup
from ..rollouts.grid_study import Study, StudyProgress
from ..rollouts.store import as_json
from .config import add_config
from .options import add_trust_option, can_draw, number, whole
from .out import STUDY, add_out_options
from .progress import shown_as, to_go

_DONE, _NOT_DONE = 0, 1


def add_study_options(command: argparse.ArgumentParser, wrote: str) -> None:
    """Add the options that all studies have; `wrote` is what they leave in their folder."""
    command.add_argument("--workers", type=whole, metavar="N", help="processes; default: as many as there are cores")
    text = f"{wrote}; the same command goes on with a folder left unfinished, and a larger one drives only what is new"
    add_out_options(command, STUDY, text, required=True)
    command.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    add_config(command)
    add_trust_option(command.add_argument)


def drive_study(
    drive: Callable[..., Study[Any, Any]],
    kind: type[Study[Any, Any]],
    options: argparse.Namespace,
    controllers: Sequence[str],
    *,
    setup: Setup,
    failed: Callable[[Any], bool],
    pictures: bool = True,
    **axes: Any,
) -> int:
    """Drive a study, print its tables or its JSON, and return the exit code.

    Args:
      drive: the function.
      kind: class of its results.
      options: of the command.
      controllers: which.
      setup: that all runs have in common.
      failed: says of the figures of a run whether it could not be driven.
      pictures: whether the study has pictures, which need matplotlib.
      axes: the other axes and settings of the function.
    """
    noun, seeds = kind.noun, {"seed": options.seed} if hasattr(options, "seed") else {}
    if pictures:
        axes["pictures"] = can_draw("pictures")

    def text(progress: StudyProgress) -> str:
        done = progress.runs_found + progress.runs_driven
        return f"{done}/{progress.runs} {noun}{to_go(progress.remaining_s)}"

    with (
        contextlib.redirect_stdout(sys.stderr),
        shown_as(text, f"preparing {noun}", show=not options.json) as watch,
    ):
        try:
            study = drive(
                controllers, **axes, **seeds, setup=setup, workers=options.workers, out=options.out,
                watch=watch,
            )  # fmt: skip
        except EngineError as error:
            print("fg-mujoco:", *f"{error}; finished {noun} are kept".split(), file=sys.stderr)
            return _NOT_DONE
        except KeyboardInterrupt:
            print(f"fg-mujoco: {options.out}: interrupted; the same command goes on", file=sys.stderr)
            raise
    found = len(study.rows) - study.runs_driven
    earlier = f", {found} of them by an earlier call" if found else ""
    written = f"{len(study.rows)} {noun}{earlier}; written to {options.out}\n{setup.first.friction}"
    print(as_json(study.summary()) if options.json else f"{study.markdown()}\n{written}")
    return _NOT_DONE if any(failed(row.figures) for row in study.rows) else _DONE


def seeds_in(text: str) -> Sequence[int]:
    """Read `0:10` or `1,4,7`."""
    first, colon, end = text.partition(":")
    try:
        return range(int(first), int(end)) if colon else [int(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; accepted: FIRST:END, or whole numbers as 1,4,7") from None


def numbers_in(text: str) -> list[float]:
    """Read `4,6.5`."""
    return [number(part.strip()) for part in text.split(",")]
