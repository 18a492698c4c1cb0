"""The command `fg-mujoco race`."""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import time
from pathlib import Path

from ..display import quoted
from ..errors import FgMujocoError, RunFolderError
from ..racing.decision_times import decision_limit_text, late_hint
from ..racing.entries import NO_FAULT
from ..racing.planners import with_settings
from ..racing.race import RaceProgress, race_setup
from ..racing.result import RaceResult, clamped_hint
from ..racing.rules import find_rules
from ..simulation.settings import friction_text
from ..vehicle.tire_slip import share_text, sliding_rule, sliding_text
from .command import CONFIG, JSON, OUTPUT, can_draw, command, option
from .options import in_one_line, setup_of, setup_options
from .out import RUN, out_options, write_page, written_rows
from .progress import ProgressLine

_DONE, _NOT_DONE = 0, 1


@command(
    setup_options(),
    out_options(RUN, "write a run folder here"),
    option("--video", "write a video of the best lap, .mp4 or .gif; see render", "FILE", Path, title=OUTPUT),
    JSON,
    option("--traceback", "print the whole traceback of a planner that fails"),
    CONFIG,
)
def race_command(options: argparse.Namespace) -> int:
    """Race a controller from a standing start."""
    setup = setup_of(options)
    picture = options.out is not None and check_out(options.out)
    if options.video is not None:
        from .render import check_film, film_race

        check_film(options.video, options)
    # what a planner prints is not our output
    with contextlib.redirect_stdout(sys.stderr), RaceWatch(show=not options.json) as watch:
        result = race_setup(setup, watch=watch)
    failures = [car.planner_failure for car in result.cars if car.planner_failure is not None]
    for failure in failures:
        print(failure.whole_traceback if options.traceback else failure.traceback, end="", file=sys.stderr)
    try:
        if options.out is not None:
            from ..pictures.plots import write_run

            write_run(result, options.out, picture=picture, add=write_page)
    except RunFolderError:  # of a race that is driven already; `main` says why
        _print(result, options, None)
        raise
    code = _DONE if result.car.finished and not failures else _NOT_DONE
    if options.video is not None:
        try:
            with contextlib.redirect_stdout(sys.stderr):  # stdout is the table's, or the JSON object's
                film_race(result, options.video)
        except FgMujocoError as error:
            if options.out is None:
                raise
            print("fg-mujoco:", in_one_line(str(error)), file=sys.stderr)  # the run folder is written, and stays
            code = _NOT_DONE
    _print(result, options, options.out)
    for car, own in zip(result.cars, result.world.cars, strict=True):
        driven = car.telemetry[: round(car.end_time_s / car.decision_times.period_s)]
        whose = "" if len(result.cars) == 1 else f"{quoted(car.name)}: "
        for hint in filter(None, (clamped_hint(driven, own.parameters), late_hint(vars(car.decision_times)))):
            print(f"fg-mujoco: hint: {whose}{in_one_line(hint)}", file=sys.stderr)
    return code


def _print(result: RaceResult, options: argparse.Namespace, out: str | None) -> None:
    """Print a race as JSON or as a table; `out` is as of `race_table`."""
    if options.json:
        from ..racing.summary import summary_json

    print(summary_json(result) if options.json else race_table(result, out))


def check_out(folder: str) -> bool:
    """Refuse a folder that cannot be written, before the race and not after it; answer whether to draw a picture."""
    from ..racing.run_folder import check_run_folder

    check_run_folder(folder)
    return can_draw("trace.png", several=False)


class RaceWatch:
    """Shows how a race goes, and on Ctrl-C ends it between two ticks, so that what was driven is whole.

    The first Ctrl-C says what it waits for. A second one ends a planner that never answers.
    """

    def __init__(self, *, show: bool) -> None:
        self._line, self._show = ProgressLine("preparing the race", show=show), show
        self._time: float | None = None  # [s] simulated; None: no tick is done
        self._started = time.perf_counter()
        self._interrupted = False

    def __enter__(self) -> RaceWatch:
        self._before = signal.signal(signal.SIGINT, self._interrupt)
        self._line.__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        signal.signal(signal.SIGINT, self._before)
        self._line.__exit__(*exception)

    def _interrupt(self, *signal_and_frame: object) -> None:
        self._interrupted = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
        first = "the first tick: the world, and the planner's first command"
        waits_for = first if self._time is None else f"a command of the planner after t = {self._time:.3f} s"
        said = f"fg-mujoco: interrupted; waiting for {waits_for}. Ctrl-C once more ends the race at once.\n"
        clear = "\r\x1b[K" if self._show and self._line.terminal else ""
        with contextlib.suppress(OSError):
            os.write(2, (clear + said).encode())  # print may be interrupted in the midst of printing

    def __call__(self, progress: RaceProgress) -> None:
        """Show how far the race is; after Ctrl-C, end it."""
        self._time = progress.time
        if self._interrupted:
            raise KeyboardInterrupt
        if self._line.due:
            lap = min(progress.laps_completed + 1, progress.laps_requested)
            self._line.write(
                f"lap {lap}/{progress.laps_requested}  {progress.time:6.1f} s  {progress.speed:5.2f} m/s  "
                f"{progress.time / (time.perf_counter() - self._started):.0f} x real time"
            )


def race_table(result: RaceResult, out: str | None) -> str:
    """Return the table of a race that the command prints; `out` is the run folder, None: there is none."""
    car = result.car
    laps = [(f"lap {lap}", f"{seconds:.3f} s") for lap, seconds in enumerate(car.lap_times_s, start=1)]
    rows = [
        ("laps", f"{car.laps_completed} of {result.laps_requested}, {car.end_reason.replace('_', ' ')}"),
        *laps,
        ("collisions", _collisions(result)),
        ("greatest sliding", sliding_text(car.max_slide_m_s, more=f" (a tire slides {sliding_rule(car.tires_model)})")),
        *([("fastest sliding", car.max_slide_place)] if car.max_slide_place else []),
        ("sliding sideways", sliding_text(car.max_lateral_slide_m_s, more=" at most")),
        ("time sliding", share_text(car.slide_time_fraction)),
        ("friction", friction_text(car.mu, car.planner_mu, car.floor)),
        ("assist", car.assist),
        ("top speed", f"{car.max_speed_m_s:.2f} m/s"),
        ("mean speed", f"{car.mean_speed_m_s:.2f} m/s"),
        ("clamped commands", f"{car.clamped_commands} of {len(car.telemetry)}"),
        ("decisions", str(car.decision_times)),
        ("simulated", f"{result.sim_time_s:.2f} s in {result.wall_time_s:.2f} s"),
        ("real-time factor", f"{result.realtime_factor:.1f}"),
    ]
    if result.obstacles:
        rows.insert(1, ("obstacles", f"{result.obstacles}, seed {result.obstacle_seed}"))
    if result.moving:
        rows.insert(1, ("moving", f"{result.moving}, seed {result.obstacle_seed}"))
    if car.wrong_way is not None:
        rows.insert(1, ("wrong way", str(car.wrong_way)))
    if car.planner_failure is not None:
        rows.insert(1, ("planner failed", str(car.planner_failure)))
    if car.crash is not None:
        rows.insert(1, ("crash", str(car.crash)))
    if car.rollover is not None:
        rows.insert(1, ("rolled over", str(car.rollover)))
    if car.stuck is not None:
        rows.insert(1, ("stuck", str(car.stuck)))
    if car.jumps:
        longest = max(car.jumps, key=lambda jump: jump.lasted_s)
        count = f"{len(car.jumps)} times, the longest " if len(car.jumps) > 1 else ""
        rows.insert(1, ("jumped", f"{count}{longest}"))
    if car.end_reason == "decision_limit":
        rows.insert(1, ("decision limit", decision_limit_text(result.setup.decision_limit, result.sim_time_s)))
    rows += written_rows(out)
    if len(result.cars) > 1:
        rows.append(("winner", result.winner or "nobody finished"))
    controller = with_settings(car.controller, car.planner_settings)
    heading = f"{result.track}, {controller}, {car.vehicle}"
    return "\n".join([heading, *(f"  {name:<17} {value}" for name, value in rows), *_field_table(result)])


def _collisions(result: RaceResult) -> str:
    """Return how often car 0 touched a wall, and its time with the penalties of the rules."""
    count, penalty = result.car.collisions_wall, find_rules(result.setup.rules).wall_penalty
    if not penalty or not count:
        return str(count)
    return f"{count}: {count * penalty:g} s of penalties, {result.car.end_time_s + count * penalty:.2f} s in all"


def _field_table(result: RaceResult) -> list[str]:
    """Return the lines about all cars of a race of several, and what happened between them."""
    lines: list[str] = []
    if len(result.cars) == 1:
        return lines
    for car in sorted(result.cars, key=lambda car: car.position):
        best = f"best {min(car.lap_times_s):.2f} s" if car.lap_times_s else "no lap"
        said = str(car.crash or car.wrong_way or car.planner_failure or car.stuck or car.end_reason.replace("_", " "))
        touched = f"{car.collisions_car} contact{'s' if car.collisions_car != 1 else ''}"
        name = with_settings(car.controller, car.planner_settings)
        lines.append(f"  {car.position}. {car.name:<8} {name}: {car.laps_completed} laps, {best}, {touched}, {said}")
    lines += [f"  {lap.time_s:7.2f} s  {lap.by} overtakes {lap.of}" for lap in result.overtakes]
    for contact in result.contacts:
        cars = " and ".join(contact.cars)
        hit = f"{contact.impulse_Ns:.2f} N s at {contact.closing_speed_m_s:.1f} m/s"
        fault = contact.at_fault if contact.at_fault == NO_FAULT else f"at fault {contact.at_fault}"
        lines.append(f"  {contact.time_s:7.2f} s  {cars} touch: {hit}, {fault}: {contact.reason}")
    return lines + [f"  {warned.time_s:7.2f} s  warning to {warned.car}: {warned.reason}" for warned in result.warnings]
