"""The command `fg-mujoco`: race, replay, make and show tracks; `rollout` is in rollout_cli.

Exit codes: 0 all went well, 1 a race that was not driven to its end or a replay that differs, 2 input that cannot be
used, or a file that cannot be written (one line on stderr, nothing written).
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from ..course.course import USUAL_LAPS
from ..course.formats import track_names
from ..errors import FgMujocoError, PlannerError, RunFolderError, accepted_names, nearest
from ..lidar.effects import LidarEffects
from ..lidar.lidar import LIDAR_BACKENDS
from ..racing.decision_times import decision_limit_text
from ..racing.entries import Entry
from ..racing.field import FieldProgress
from ..racing.hints import race_hints
from ..racing.planner_choice import with_settings
from ..racing.planner_sources import controller_names
from ..racing.race import RaceProgress, race
from ..racing.race_control import RULES, find_rules
from ..racing.replay import replay
from ..racing.result import RaceResult
from ..racing.run_folder import check_run_folder, summary_json
from ..simulation.planner_failure import whole_traceback
from ..simulation.settings import friction_text
from ..vehicle.tire_slip import sliding_rule
from ..viz.plots import write_run
from .config import add_config, parse, settings_of
from .options import (
    add_controller_option,
    add_drive_options,
    add_opponent_options,
    add_trust_option,
    can_draw,
    drive_options,
    in_one_line,
    in_options,
    number,
    opponents_of,
    whole,
)
from .out import RUN, add_out_options, chosen_folder
from .progress import ProgressLine
from .render import check_film, film_race
from .report import PAGE, report_race
from .words import command_for

_DONE, _NOT_DONE, _BAD_INPUT = 0, 1, 2
_INTERRUPTED, _TERMINATED = 130, 143  # what shells call a command that Ctrl-C, and one that SIGTERM has ended


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    options = None
    terminated = threading.Event()
    try:
        with _warnings_in_a_line(), _ended_in_order(terminated):
            parser = _parser(_first(arguments))
            if "_ARGCOMPLETE" in os.environ:
                from .completion import complete

                complete(parser)
            options = parse(parser, arguments)
            with chosen_folder(options, getattr(options, "folder_kind", None)):
                code: int = options.run(options)
        sys.stdout.flush()
    except FgMujocoError as error:
        said = str(error) if options is None else in_options(str(error), options.command)
        print("fg-mujoco:", in_one_line(said), file=sys.stderr)
        return _BAD_INPUT
    except KeyboardInterrupt:
        return _TERMINATED if terminated.is_set() else _INTERRUPTED
    except BrokenPipeError:  # the reader of our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _NOT_DONE
    return code


@contextlib.contextmanager
def _ended_in_order(terminated: threading.Event) -> Iterator[None]:
    """Let SIGTERM end a command as Ctrl-C does, so that temporary folders are removed; set `terminated` when it comes.

    Processes that the command forks, and a program that has a handler of its own, end as they would.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return
    process = os.getpid()

    def end(number: int, frame: Any) -> None:
        if os.getpid() != process:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            os.kill(os.getpid(), signal.SIGTERM)
        terminated.set()
        signal.default_int_handler(number, frame)

    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextlib.contextmanager
def _warnings_in_a_line() -> Iterator[None]:
    """Print each warning that is meant for users once, in one line on stderr."""
    shown: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if category is not UserWarning:
            usual(message, category, *place, **more)
        elif str(message) not in shown:
            shown.add(str(message))
            print("fg-mujoco: warning:", *str(message).split(), file=sys.stderr)

    with warnings.catch_warnings():
        usual, warnings.showwarning = warnings.showwarning, show
        yield


class _Parser(argparse.ArgumentParser):
    """Complains in one line, and says which option or command was probably meant."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; what is not known is refused by the command that it was given to, whose options are looked up."""
        given = list(sys.argv[1:] if args is None else args)
        if self._subparsers is None:
            for option in (each.partition("=")[0] for each in given[: given.index("--") if "--" in given else None]):
                if option.startswith("--") and option not in self._option_string_actions:
                    self.error(self._no_option(option))  # before what lacks
        elif given and given[0].startswith("--") and given[0] not in self._option_string_actions:
            self.error(f"{given[0]!r} stands before the command; accepted: {self.prog} COMMAND {given[0]}")
        options, left = super().parse_known_args(given, namespace)
        left = [each for each in left if each != "--"] or left
        if left:
            self.error(self._no_option(left[0]) if left[0].startswith("-") else self._no_argument(left[0]))
        return options, left

    def _no_option(self, given: str) -> str:
        """Return what is said of an option that there is not."""
        known = [option for option in self._option_string_actions if option.startswith("--")]
        command = command_for(given)
        meant = nearest(given, known, cutoff=1.0)
        if not given.startswith("--"):
            meant = "--out" if given == "-o" and "--out" in known else None
        elif meant is None and command is None:
            meant = nearest(given, known)
        hint = command if meant is None else f"did you mean {meant!r}?"
        return f"{given!r} is no option here" + ("" if hint is None else f"; {hint}")

    def _no_argument(self, given: str) -> str:
        """Return what is said of a word for which there is no place: it may be the value of an option."""
        means = {option: means for option, means in _MEANS.items() if option in self._option_string_actions}
        option = next((option for option in means if means[option](given)), None)
        return f"{given!r} is no argument here" + ("" if option is None else f"; did you mean '{option} {given}'?")

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        if action.option_strings and action.nargs is None and arg_strings == ["--"]:  # argparse would lose it
            arg_strings = ["--", "--"]
        return super()._get_values(action, arg_strings)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            name = action.metavar if isinstance(action.metavar, str) else "COMMAND"
            rather = command_for(value) if self.prog == "fg-mujoco" else None
            listed = accepted_names(value, action.choices)
            end = listed if rather is None else f"{listed.partition('; did you mean')[0]}; {rather}"
            raise argparse.ArgumentError(None, f"{name} is {value!r}; {end}")

    def error(self, message: str) -> NoReturn:
        self.exit(_BAD_INPUT, f"{self.prog}: {in_one_line(message)}; see {self.prog} --help\n")


def _names_a_course(word: str) -> bool:
    return word.endswith((".csv", ".yaml", ".yml")) or word.startswith(("random:", "scene:")) or word in track_names()


def _names_a_planner(word: str) -> bool:
    return ".py" in word or word.startswith("ros:") or word.partition("[")[0] in controller_names()


_MEANS = {
    "--track": _names_a_course, "--tracks": _names_a_course, "--controller": _names_a_planner,
    "--controllers": _names_a_planner,
}  # fmt: skip
"""Option -> whether a word is a value of it."""


_COMMANDS = (
    "race", "replay", "drive", "track", "controllers", "vehicles", "rollout", "compare", "overtake", "render", "report",
    "debug", "view", "friction", "identify", "bags",
)  # fmt: skip
"""In the order in which the help lists them."""


class _Version(argparse.Action):
    """Prints the version, which takes a while to look up."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from .. import __version__

        print(f"fg-mujoco {__version__}")
        parser.exit()


def _first(arguments: Sequence[str] | None) -> str | None:
    """Return the command of a command line, if the shell does not ask what it may become."""
    given = sys.argv[1:] if arguments is None else arguments
    return given[0] if given and given[0] in _COMMANDS and "_ARGCOMPLETE" not in os.environ else None


@cache
def _parser(only: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of one command, or of all: their options name what there is, which takes a while to import."""
    parser = _Parser(prog="fg-mujoco", description="A MuJoCo 3D testbed for F1TENTH cars.", allow_abbrev=False)
    parser.add_argument("--version", action=_Version, nargs=0, help="show program's version number and exit")
    commands = parser.add_subparsers(title="commands", required=True)
    for name in _COMMANDS if only is None else (only,):
        if name == "race":
            _add_race(commands)
        elif name == "replay":
            command = _add(commands, name, _replay, "simulate a run folder again and compare it bit for bit")
            command.add_argument("folder", metavar="DIR", help="written by race --out")
        else:
            getattr(import_module(f".{name}", __package__), f"add_{name}")(_add, commands)
    return parser


def _add(commands: Any, name: str, run: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
    command: argparse.ArgumentParser = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
    command.set_defaults(run=run, command=command)
    return command


def _add_race(commands: Any) -> None:
    command = _add(commands, "race", _race, "race a controller from a standing start")
    add = command.add_argument
    add(
        "--track", default="oval",
        help="NAME, random:SEED[:tight], scene:NAME:SEED, file.csv or map.yaml; default: oval; "
        "names: track list, track scenes",
    )  # fmt: skip
    add_controller_option(add)
    add("--laps", type=whole, metavar="N", help=f"default: {USUAL_LAPS}; a scene is driven once")
    add("--obstacles", type=whole, default=0, metavar="N", help="boxes on the track, with a way past each; default: 0")
    add("--obstacle-seed", type=whole, default=0, metavar="K", help="of their places; default: 0")
    add_drive_options(add)
    add("--lidar", default="raycast", metavar="NAME", help=f"{' or '.join(LIDAR_BACKENDS)}; default: raycast")
    add("--lidar-noise", type=number, default=0.0, metavar="M", help="standard deviation of each range")
    add("--lidar-dropout", type=number, default=0.0, metavar="P", help="probability that a beam fails")
    add("--lidar-latency", type=number, default=0.0, metavar="S", help="from measurement to delivery")
    add("--motion-distortion", action="store_true", help="each beam from the pose at its own time in the sweep")
    add(
        "--odometry-drift", type=number, default=0.0, metavar="D", help="relative error of measured speeds and yaw rate"
    )
    add("--seed", type=whole, default=0, metavar="N", help="of noise and dropouts; default: 0")
    add_opponent_options(add)
    add("--rules", default="none", metavar="NAME", help=f"of race control: {' or '.join(RULES)}; default: none")
    add(
        "--time-limit", type=number, metavar="S",
        help="of simulated time; default: what a car of 0.5 m/s needs, or the scene's",
    )  # fmt: skip
    add(
        "--decision-limit", type=number, metavar="S",
        help="of wall time for each decision; a planner that takes longer, or never answers, ends the race",
    )  # fmt: skip
    add_out_options(command, RUN, "write a run folder here")
    add("--video", type=Path, metavar="FILE", help="write a video of the race, .mp4 or .gif; see the command render")
    add("--json", action="store_true", help="print one JSON object and nothing else")
    add("--traceback", action="store_true", help="of a planner that fails, print the whole traceback, not its own part")
    add_config(command)
    add_trust_option(add)


def _race(options: argparse.Namespace) -> int:
    effects = LidarEffects(
        range_noise_std=options.lidar_noise,
        dropout_probability=options.lidar_dropout,
        latency=options.lidar_latency,
        motion_distortion=options.motion_distortion,
    )
    settings = settings_of(options)
    picture = options.out is not None and check_out(options.out)
    if options.video is not None:
        check_film(options.video)
    race_settings: dict[str, Any] = {
        "laps": options.laps, "lidar": options.lidar, "time_limit": options.time_limit,
        "decision_limit": options.decision_limit, "obstacles": options.obstacles,
        "obstacle_seed": options.obstacle_seed,
    }  # fmt: skip
    own: dict[str, Any] = {
        **drive_options(options), "seed": options.seed, "effects": effects, "odometry_drift": options.odometry_drift,
    }  # fmt: skip
    find_rules(options.rules)
    if options.opponent or options.opponent_max_speed:
        first = Entry(controller=options.controller, **own)
        race_settings |= {"entries": (first, *opponents_of(options, first)), "grid": options.grid}
        race_settings["rules"] = options.rules
    else:
        race_settings |= {"controller": options.controller, **own}
    # what a planner prints is not our output
    with contextlib.redirect_stdout(sys.stderr), _Watcher(show=not options.json) as watch:
        try:
            result = race(options.track, **race_settings, watch=watch)
        except PlannerError as error:  # what was driven is kept
            result = error.result
            whole = whole_traceback(error) if options.traceback else error.failure.traceback
            print(whole, end="", file=sys.stderr)
    try:
        if options.out is not None:
            write_run(result, options.out, picture=picture, settings=settings, add=report_race)
    except RunFolderError:  # of a race that is driven already; `main` says why
        print(summary_json(result, settings) if options.json else _table(result, None))
        raise
    failures = [car.planner_failure for car in result.car_results if car.planner_failure is not None]
    for failure in failures:
        print(failure.traceback, end="", file=sys.stderr)
    code = _DONE if result.finished and not failures else _NOT_DONE
    if options.video is not None:
        try:
            with contextlib.redirect_stdout(sys.stderr):  # stdout is the table's, or the JSON object's
                film_race(result, options.video)
        except FgMujocoError as error:
            if options.out is None:
                raise
            print("fg-mujoco:", in_one_line(str(error)), file=sys.stderr)  # the run folder is written, and stays
            code = _NOT_DONE
    print(summary_json(result, settings) if options.json else _table(result, options.out))
    for hint in race_hints(result):
        print("fg-mujoco: hint:", in_one_line(hint), file=sys.stderr)
    return code


def check_out(folder: str) -> bool:
    """Refuse a folder that cannot be written, before the race and not after it; answer whether to draw a picture."""
    check_run_folder(folder)
    return can_draw("trace.png", several=False)


class _Watcher:
    """Shows how a race goes, and on Ctrl-C ends it between two ticks, so that what was driven is whole.

    The first Ctrl-C says what it waits for. A second one ends a planner that never answers.
    """

    def __init__(self, *, show: bool) -> None:
        self._line, self._show = ProgressLine("preparing the race", show=show), show
        self._time: float | None = None  # [s] simulated; None: no tick is done
        self._started = time.perf_counter()
        self._interrupted = False

    def __enter__(self) -> _Watcher:
        self._before = signal.signal(signal.SIGINT, self._interrupt)
        self._line.__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        signal.signal(signal.SIGINT, self._before)
        self._line.__exit__(*exception)

    def _interrupt(self, *signal_and_frame: object) -> None:
        self._interrupted = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
        first = "the first tick: the world, kernels to be compiled, and the planner's first command"
        waits_for = first if self._time is None else f"the planner's command at t = {self._time:.3f} s"
        said = f"fg-mujoco: interrupted; waiting for {waits_for}. Ctrl-C once more ends the race at once.\n"
        clear = "\r\x1b[K" if self._show and self._line.terminal else ""
        with contextlib.suppress(OSError):
            os.write(2, (clear + said).encode())  # print may be interrupted in the midst of printing

    def __call__(self, progress: RaceProgress | FieldProgress) -> None:
        self._time = progress.time
        if self._interrupted:
            raise KeyboardInterrupt
        if self._line.due:
            lap = min(progress.laps_completed + 1, progress.laps_requested)
            self._line.write(
                f"lap {lap}/{progress.laps_requested}  {progress.time:6.1f} s  {progress.speed:5.2f} m/s  "
                f"{progress.time / (time.perf_counter() - self._started):.0f} x real time"
            )


def _table(result: RaceResult, out: str | None) -> str:
    laps = [(f"lap {lap}", f"{seconds:.3f} s") for lap, seconds in enumerate(result.lap_times_s, start=1)]
    rows = [
        ("laps", f"{result.laps_completed} of {result.laps_requested}, {result.end_reason.replace('_', ' ')}"),
        *laps,
        ("collisions", f"{result.collisions}"),
        ("greatest sliding", f"{result.max_slide_m_s:.4f} m/s (a tire slides {sliding_rule(result.tires_model)})"),
        ("sliding sideways", f"{result.max_lateral_slide_m_s:.4f} m/s at most"),
        ("time sliding", f"{100.0 * result.slide_time_fraction:.2f} %"),
        ("friction", friction_text(result.mu, result.planner_mu)),
        ("top speed", f"{result.max_speed_m_s:.2f} m/s"),
        ("mean speed", f"{result.mean_speed_m_s:.2f} m/s"),
        ("clamped commands", f"{result.clamped_commands} of {len(result.telemetry)}"),
        ("decisions", str(result.decision_times)),
        ("simulated", f"{result.sim_time_s:.2f} s in {result.wall_time_s:.2f} s"),
        ("real-time factor", f"{result.realtime_factor:.1f}"),
    ]
    if result.obstacles:
        rows.insert(1, ("obstacles", f"{result.obstacles}, seed {result.obstacle_seed}"))
    if result.wrong_way is not None:
        rows.insert(1, ("wrong way", str(result.wrong_way)))
    if result.planner_failure is not None:
        rows.insert(1, ("planner failed", str(result.planner_failure)))
    if result.crash is not None:
        rows.insert(1, ("crash", str(result.crash)))
    if result.rollover is not None:
        rows.insert(1, ("rolled over", str(result.rollover)))
    if result.end_reason == "decision_limit":
        rows.insert(1, ("decision limit", decision_limit_text(result.decision_limit_s, result.sim_time_s)))
    if out is not None:
        rows.append(("written to", out))
        if (Path(out) / PAGE).is_file():
            rows.append(("report", str(Path(out) / PAGE)))
    if result.car_results:
        rows.append(("winner", result.winner or "nobody finished"))
    controller = with_settings(result.controller, result.planner_settings)
    heading = f"{result.track}, {controller}, {result.vehicle}"
    return "\n".join([heading, *(f"  {name:<18}{value}" for name, value in rows), *_field_table(result)])


def _field_table(result: RaceResult) -> list[str]:
    """Return the lines about all cars of a race of several, and what happened between them."""
    lines = []
    for car in sorted(result.car_results, key=lambda car: car.position):
        best = f"best {min(car.lap_times_s):.2f} s" if car.lap_times_s else "no lap"
        said = str(car.crash or car.wrong_way or car.planner_failure or car.end_reason.replace("_", " "))
        touched = f"{car.collisions_car} contact{'s' if car.collisions_car != 1 else ''}"
        name = with_settings(car.controller, car.planner_settings)
        lines.append(f"  {car.position}. {car.name:<8} {name}: {car.laps_completed} laps, {best}, {touched}, {said}")
    lines += [f"  {lap.time_s:7.2f} s  {lap.by} overtakes {lap.of}" for lap in result.overtakes]
    for contact in result.contacts:
        cars = " and ".join(contact.cars)
        hit = f"{contact.impulse_Ns:.2f} N s at {contact.closing_speed_m_s:.1f} m/s"
        lines.append(f"  {contact.time_s:7.2f} s  {cars} touch: {hit}, at fault {contact.at_fault}")
    return lines + [f"  {warned.time_s:7.2f} s  warning to {warned.car}: {warned.reason}" for warned in result.warnings]


def _replay(options: argparse.Namespace) -> int:
    report = replay(options.folder)
    print(f"{options.folder}: {report}", *(f"  {line}" for line in report.lines), sep="\n")
    return _DONE if report.holds else _NOT_DONE
