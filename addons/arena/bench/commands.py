"""The command `fg-mujoco bench`: the card of a planner."""

from __future__ import annotations

import argparse
from pathlib import Path

from fg_mujoco.cli.command import FORCE, JSON, OUTPUT, WORKERS, command, option
from fg_mujoco.cli.out import new_files
from fg_mujoco.cli.progress import study
from fg_mujoco.course.writing import staged_folder, write_file, writing
from fg_mujoco.racing.planners import controller_names
from fg_mujoco.rollouts.store import as_json

from ..study.store import StudyProgress
from ..study.suite import read_suite
from .card import REACTIVE, bench
from .card_page import card_text, write_card_page

PAGE, DATA = "card.html", "card.json"


@command(
    option(
        "planner", "NAME, path/to/file.py or file.py:NAME, ros:path/to/node.py, or a policy's file", "PLANNER",
        names=controller_names,
    ),
    option("--suite", "a file of groups of runs; default: the bundled suite `reactive`", "FILE.toml", Path, REACTIVE),
    WORKERS,
    option("--out", f"folder of {PAGE} and {DATA}", "DIR", Path, title=OUTPUT),
    FORCE,
    JSON,
)  # fmt: skip
def bench_command(options: argparse.Namespace) -> int:
    """Drive a planner through a suite of courses and conditions, and write its card: one page, and one JSON."""
    suite = read_suite(options.suite)
    files = () if options.out is None else (options.out / PAGE, options.out / DATA)
    with new_files(options.out, *files, options=options):
        with study(options, "runs", StudyProgress.counts) as watch:
            card = bench(options.planner, suite, workers=options.workers, watch=watch)
        if options.out is not None:
            with writing(options.out), staged_folder(options.out, last=PAGE) as aside:
                write_file(aside / DATA, as_json(card.described()).encode())
                write_card_page(card, aside / PAGE)
    print(as_json(card.described()) if options.json else card_text(card))
    if options.out is not None and not options.json:
        print(f"page: {options.out / PAGE}")
    return int(card.failed)
