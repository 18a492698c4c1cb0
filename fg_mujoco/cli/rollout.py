"""The command `fg-mujoco rollout`.

Exit codes: 0 all worlds were driven, however they ended; 1 a cluster failed, or the worker of a world died; 2 input
that cannot be used; 130 Ctrl-C. Chunks that are finished then stay in the folder of `--out`, and the same command goes
on with the others.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..course.writing import write_file
from ..errors import SettingsError
from ..messages import require_whole
from ..racing.planners import bundled_names
from ..racing.randomization import OF_ENVIRONMENTS, PARAMETERS
from ..racing.setup import Setup
from ..rollouts.recording import RECORDS, Record
from ..rollouts.rollout_result import RolloutResult
from ..rollouts.rollouts import DEFAULT_WORLDS, EXECUTORS, Executor, RolloutProgress, rollout_setup
from ..rollouts.store import as_json
from ..simulation.settings import friction_text
from ..vehicle.tire_slip import NO_PEAK, sliding_rule
from .command import CONFIG, JSON, can_draw, command, named_values, option, whole
from .options import NAMES, setup_of, setup_options
from .out import STUDY, out_options
from .progress import study

_DONE, _NOT_DONE = 0, 1
_MIB = 2**20

EXECUTOR = option(
    "--executor", "{names}; default: threads; processes where a planner is not bundled or has a limit", "NAME",
    names=lambda: EXECUTORS,
)  # fmt: skip


@command(
    option(
        "--track", "NAME, random:SEED[:tight] or file.csv, several may be given: the worlds take turns; default: "
        "oval", "TRACK", names=NAMES["track"], action="append",
    ),
    option("--n", f"worlds; default: {DEFAULT_WORLDS}", "N", whole),
    option(
        "--randomize", "several may be given; mu=0.6:1.2, max_speed=6|8, obstacles=0:4, planner.SETTING=LOW:HIGH, or "
        "one value", "NAME=RANGE", default=[], action="append",
        names=lambda: [f"{name}=" for name in PARAMETERS if name not in OF_ENVIRONMENTS],
    ),
    setup_options(
        but=("track", "lidar", "motion_distortion", "rules"), seed="seed of all random values; default: 0",
        laps="default: 1, or as many as fit the time limit", decision_limit="of wall time for each decision; a planner "
        "that takes longer, or never answers, ends its world",
    ),
    option("--workers", "threads, processes, or with Ray cores; default: all cores", "N", whole),
    option(
        "--record", "{names}, or scans:STEP for every STEP-th beam; default: summary", "WHAT", default="summary",
        names=lambda: RECORDS,
    ),
    out_options(STUDY, "keep the results here; the same command continues an unfinished folder"),
    option(
        "--memory-budget", f"memory of records and running worlds; default: {Executor.memory_budget // _MIB}", "MIB",
        whole, Executor.memory_budget // _MIB,
    ),
    option("--chunk", f"worlds that a worker drives together; default: {Executor.chunk}", "N", whole, Executor.chunk),
    EXECUTOR,
    option(
        "--by", "print the shares of worlds that finished, crashed and slid by a parameter, such as mu, and write them "
        "as by_NAME.md and by_NAME.svg with --out", "NAME",
    ),
    JSON,
    CONFIG,
)  # fmt: skip
def rollout_command(options: argparse.Namespace) -> int:
    """Drive many worlds, each drawn from its own seed, on all cores or on a cluster."""
    if Record.of(options.record).what != "summary" and options.out is None:
        raise SettingsError(f"--record {options.record} is kept nowhere; accepted: with --out DIR")
    require_whole("memory_budget", options.memory_budget, 0)  # of MiB, as it was given
    setup = setup_of(options, lists=("track",))
    executor = Executor(
        kind=options.executor or executor_for(setup), chunk=options.chunk, memory_budget=options.memory_budget * _MIB
    )
    with study(options, "worlds", rollout_progress) as watch:
        result = rollout_setup(
            setup, options.track, n=options.n, record=options.record, out=options.out, workers=options.workers,
            randomize=named_values(options.randomize, "--randomize", "NAME=RANGE, as mu=0.6:1.2"), executor=executor,
            watch=watch,
        )  # fmt: skip
    print(as_json(result.summary()) if options.json else _table(result, options.out))
    if options.by is not None and not options.json:
        _print_shares(result, options.by, options.out)
    return _NOT_DONE if (result["end_reason"] == "worker_died").any() else _DONE


def executor_for(setup: Setup) -> str:
    """Return where worlds are driven unless it is said: a planner of somebody's own may hang, or end its process."""
    planners = (str(entry.controller).partition("[")[0] for entry in setup.entries)
    bundled = all(planner in bundled_names() for planner in planners)
    return "threads" if bundled and setup.decision_limit is None else "processes"


def _print_shares(result: RolloutResult, name: str, out: str | None) -> None:
    shares = result.by(name)
    print(f"\n{shares.text()}", end="")
    if out is not None:
        write_file(Path(out) / f"by_{name}.md", shares.text().encode())
        if can_draw(f"by_{name}.svg", several=False):
            shares.picture(Path(out) / f"by_{name}.svg")


def rollout_progress(progress: RolloutProgress) -> tuple[int, int, float | None, str]:
    """Return how many worlds are driven by now, how many there will be, the time to the end [s], and the rate."""
    done = progress.worlds_found + progress.worlds_driven
    return done, progress.worlds, progress.remaining_s, f"  {progress.rate:.0f} world-seconds/s"


def _table(result: RolloutResult, out: str | None) -> str:
    summary = result.summary()
    reasons = ", ".join(f"{count} {reason.replace('_', ' ')}" for reason, count in summary["end_reasons"].items())
    low, high = summary["finished_interval"]
    rule = sliding_rule(result.base.tire_set.model)
    slid = _spread(summary["max_slide_m_s"], f"m/s (a tire slides {rule})", len(result))
    rows = [
        ("worlds", f"{len(result)}: {reasons}"),
        ("finished", f"{100.0 * summary['finished']:.1f} %; 95 % interval: {100.0 * low:.1f} to {100.0 * high:.1f} %"),
        *_lap_times(summary["lap_times"]),
        ("greatest sliding", slid if result.base.tire_set.slides or summary["max_slide_m_s"] else NO_PEAK),
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
    return "\n".join([f"{tracks}, {summary['controller']}", *(f"  {name:<17} {value}" for name, value in rows)])


def _lap_times(by_track: list[dict[str, Any]]) -> list[tuple[str, str]]:
    """Return what the table says of first and best laps: for each track, as those of several have nothing in common."""
    return [
        (what + (f", {row['track']}" if len(by_track) > 1 else ""), _spread(row[name], "s", row["worlds"]))
        for what, name in (("first lap", "first_lap_s"), ("best lap", "best_lap_s"))
        for row in by_track
    ]


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
