"""The command `fg-mujoco rollout`.

Exit codes: 0 all worlds were driven, however they ended; 1 a cluster failed, or the worker of a world died; 2 input
that cannot be used; 130 Ctrl-C. Chunks that are finished then stay in the folder of `--out`, and the same command goes
on with the others.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Callable, Sequence
from typing import Any

from ..errors import EngineError, SettingsError
from ..messages import require_whole
from ..racing.planners import bundled_names
from ..racing.setup import Setup
from ..rollouts.recording import RECORDS, Record
from ..rollouts.rollout_result import RolloutResult
from ..rollouts.rollouts import DEFAULT_WORLDS, EXECUTORS, Executor, RolloutProgress, rollout_setup
from ..rollouts.store import as_json
from ..simulation.settings import friction_text
from ..vehicle.tire_slip import sliding_rule
from .config import add_config
from .options import CAR, add_setup_options, add_trust_option, setup_of, whole
from .out import STUDY, add_out_options
from .progress import shown_as, to_go

_DONE, _NOT_DONE = 0, 1
_MIB = 2**20


def add_rollout(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "drive many worlds, each drawn from its own seed, on all cores or on a cluster"
    command = add_command(commands, "rollout", _rollout, text)
    add = command.add_argument
    add(
        "--track", action="append", metavar="TRACK",
        help="NAME, random:SEED[:tight] or file.csv, as often as wanted: the worlds take them in turn; default: oval",
    )  # fmt: skip
    add("--n", type=whole, metavar="N", help=f"worlds; default: {DEFAULT_WORLDS}")
    add(
        "--randomize", action="append", default=[], metavar="NAME=RANGE",
        help="as often as wanted; mu=0.6:1.2, max_speed=6|8, obstacles=0:4, planner.SETTING=LOW:HIGH, or one value",
    )  # fmt: skip
    add_setup_options(
        command, "controller", *CAR, "seed", "opponents", "grid", "obstacles", "obstacle_seed", "moving",
        "patches", "laps", "time_limit", "decision_limit", seed="of all that is drawn; default: 0",
        laps="default: 1, or as many as fit the time limit", decision_limit="of wall time for each decision; a planner "
        "that takes longer, or never answers, ends its world",
    )  # fmt: skip
    add("--workers", type=whole, metavar="N", help="threads, processes, or with Ray cores; default: all cores")
    add(
        "--record", default="summary", metavar="WHAT",
        help=f"{', '.join(RECORDS)}, or scans:STEP, every how many-th beam; default: summary",
    )  # fmt: skip
    add_out_options(command, STUDY, "keep the results here; the same command goes on with a folder left unfinished")
    add(
        "--memory-budget", type=whole, default=Executor.memory_budget // _MIB, metavar="MIB",
        help=f"of what is recorded and being driven; default: {Executor.memory_budget // _MIB}",
    )  # fmt: skip
    add(
        "--chunk", type=whole, default=Executor.chunk, metavar="N",
        help=f"worlds that a worker drives together; default: {Executor.chunk}",
    )  # fmt: skip
    add(
        "--executor", metavar="NAME",
        help=f"{', '.join(EXECUTORS)}; default: threads; processes where a planner is not bundled or has a limit",
    )  # fmt: skip
    add("--json", action="store_true", help="print one JSON object and nothing else")
    add_config(command)
    add_trust_option(add)


def _rollout(options: argparse.Namespace) -> int:
    if Record.of(options.record).what != "summary" and options.out is None:
        raise SettingsError(f"--record {options.record} is kept nowhere; accepted: with --out DIR")
    require_whole("memory_budget", options.memory_budget, 0)  # of MiB, as it was given
    setup = setup_of(options, lists=("track",))
    executor = Executor(
        kind=options.executor or _executor(setup), chunk=options.chunk, memory_budget=options.memory_budget * _MIB
    )
    with (
        contextlib.redirect_stdout(sys.stderr),
        shown_as(_progress, "preparing worlds", show=not options.json) as watch,
    ):
        try:
            result = rollout_setup(
                setup,
                options.track,
                n=options.n,
                randomize=_named_ranges(options.randomize),
                record=options.record,
                out=options.out,
                workers=options.workers,
                executor=executor,
                watch=watch,
            )
        except EngineError as error:
            print("fg-mujoco:", *str(error).split(), file=sys.stderr)
            return _NOT_DONE
        except KeyboardInterrupt:
            if options.out is not None:
                print(f"fg-mujoco: {options.out}: interrupted; the same command goes on", file=sys.stderr)
            raise
    print(as_json(result.summary()) if options.json else _table(result, options.out))
    return _NOT_DONE if (result["end_reason"] == "worker_died").any() else _DONE


def _executor(setup: Setup) -> str:
    """Return where worlds are driven unless it is said: a planner of somebody's own may hang, or end its process."""
    planners = (str(entry.controller).partition("[")[0] for entry in setup.entries)
    bundled = all(planner in bundled_names() for planner in planners)
    return "threads" if bundled and setup.decision_limit is None else "processes"


def _named_ranges(texts: Sequence[str]) -> dict[str, str]:
    ranges: dict[str, str] = {}
    for text in texts:
        name, equals, values = text.partition("=")
        if not equals or name in ranges:
            accepted = "NAME=RANGE, as mu=0.6:1.2" if not equals else f"{name} once"
            raise SettingsError(f"--randomize {text!r}; accepted: {accepted}")
        ranges[name] = values
    return ranges


def _progress(progress: RolloutProgress) -> str:
    done = progress.worlds_found + progress.worlds_driven
    left = to_go(progress.remaining_s)
    return f"{done}/{progress.worlds} worlds  {progress.rate:.0f} world-seconds/s{left}"


def _table(result: RolloutResult, out: str | None) -> str:
    summary = result.summary()
    reasons = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in summary["end_reasons"].items())
    low, high = summary["finished_interval"]
    rule = sliding_rule(result.base.tire_set.model)
    rows = [
        ("worlds", f"{len(result)}: {reasons}"),
        ("finished", f"{100.0 * summary['finished']:.1f} %; 95 % interval: {100.0 * low:.1f} to {100.0 * high:.1f} %"),
        ("first lap", _spread(summary["first_lap_s"], "s", len(result))),
        ("best lap", _spread(summary["best_lap_s"], "s", len(result))),
        ("greatest sliding", _spread(summary["max_slide_m_s"], f"m/s (a tire slides {rule})", len(result))),
        ("friction", _friction(result)),
        ("simulated", f"{summary['world_seconds']:.1f} s"),
    ]
    if "opponents" in summary:
        rows[2:2] = _among(summary)
    if result.worlds_driven:
        rows.append(("rate", f"{result.rate:.0f} world-seconds/s, {result.wall_time_s:.1f} s"))
    if result.worlds_driven < len(result):
        rows.append(("found there", f"{len(result) - result.worlds_driven} worlds of an earlier call"))
    if out is not None:
        rows.append(("written to", out))
    tracks = ", ".join(track.name for track in result.tracks)
    rows = [*summary["randomize"].items(), *rows]
    return "\n".join([f"{tracks}, {summary['controller']}", *(f"  {name:<18}{value}" for name, value in rows)])


def _friction(result: RolloutResult) -> str:
    drawn, base = result.randomization.ranges, result.base
    return friction_text(
        None if "mu" in drawn else base.tires_mu, None if "planner_mu" in drawn else base.assumed_mu,
        base.ground_name,
    )  # fmt: skip


def _among(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what the table says of a rollout with opponents."""
    position = summary["mean_position"]
    passes, passed = summary["overtakes_per_world"], summary["overtaken_per_world"]
    contacts, fault = summary["contacts_per_world"], summary["contacts_at_fault_per_world"]
    return [
        ("against", ", ".join(row["controller"] for row in summary["opponents"])),
        ("won", f"{100.0 * summary['wins']:.1f} %" + (f", mean position {position:.2f}" if position else "")),
        ("overtakes", f"{passes:.2f} a world, {passed:.2f} of car 0"),
        ("contacts", f"{contacts:.2f} a world, {fault:.2f} its fault"),
    ]


def _spread(quantiles: dict[str, float] | None, unit: str, worlds: int) -> str:
    """Return the median of some figure, where nine of ten worlds lie, and of how many worlds it is known."""
    if quantiles is None:
        return "none"
    spread = f"median {quantiles['q50']:.3f} {unit}; 5 to 95 %: {quantiles['q5']:.3f} to {quantiles['q95']:.3f}"
    return f"{spread}; {quantiles['count']} of {worlds} worlds"
