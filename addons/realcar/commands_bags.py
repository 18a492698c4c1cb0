"""The commands of bags: `export`, a run as one; `bag`, what one holds; `replay-scans`, a planner over its scans."""

from __future__ import annotations

import argparse
import contextlib
import sys
import warnings
from collections.abc import Iterator
from os.path import abspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fg_mujoco.addons.ros.bag_messages import ODOMETRY, SCAN, require_ros_extra
from fg_mujoco.cli.options import add_setup_options, in_one_line, number, setup_of
from fg_mujoco.cli.out import RUN, require_new, write_page
from fg_mujoco.cli.progress import ProgressLine
from fg_mujoco.course.course import describe_course
from fg_mujoco.course.maps.map_server import RESOLUTION, require_maps_extra
from fg_mujoco.course.writing import temporary_folder
from fg_mujoco.errors import PlannerError, SettingsError, TrackError, accepted_names
from fg_mujoco.racing.planners import ControllerChoice, make_controller
from fg_mujoco.racing.run_folder import check_run_folder, read_run
from fg_mujoco.simulation.course_loading import load_track

from .drives.reading import kind_of, read_drive, refuse_for_kind

if TYPE_CHECKING:
    from fg_mujoco.addons.ros.bag_recording import Recording
    from fg_mujoco.addons.ros.bag_replay import PlannedCommand
    from fg_mujoco.course.course import Course
    from fg_mujoco.vehicle.vehicle import Vehicle

    from .mapping.recorded_map import RecordedMap
    from .mapping.sweeps import Sweeps

FORMATS = ("mcap",)

_BAG = ".mcap or .db3, or the folder of one or of its parts; .bag of ROS 1; or a drive's .csv"
_COLUMNS = "which columns of a CSV file are what; default: a layout that is recognised"
_ANY_TRACK = "oval"  # a planner is told of the car as in a race: as MJCF text has it, to six digits


def add_export(add: Any, commands: Any) -> None:
    """Add the command; `add` is the one that adds the others."""
    command = add(commands, "export", _export, "write a run folder as a ROS 2 bag, for Foxglove, ros2 bag and rosbags")
    command.add_argument("folder", metavar="DIR", help="written by race --out")
    command.add_argument("--format", default="mcap", metavar="NAME", help=f"{', '.join(FORMATS)}, the default")
    command.add_argument("--out", metavar="FILE.mcap", type=Path, help="default: the folder's name, here")
    command.add_argument("--force", action="store_true", help="replace the file if it exists")
    command.add_argument(
        "--trust",
        action="store_true",
        help="run the planner once more: what it shows by fg.show, and what nodes publish, is written, too",
    )


def add_bag(add: Any, commands: Any) -> None:
    """Add the command; `add` is the one that adds the others."""
    command = add(commands, "bag", _bag, "say what a robot's bag holds, and make a map of it that --track takes")
    command.add_argument("bag", metavar="BAG", help=_BAG)
    command.add_argument(
        "--map", metavar="FILE.yaml", type=Path, help="write the map of its scans, with a PNG beside it"
    )
    command.add_argument(
        "--out", metavar="DIR",
        help="write the drive as a run folder, for report, debug and replay-scans; DIR/ numbers itself: DIR/001",
    )  # fmt: skip
    command.set_defaults(folder_kind=RUN)
    command.add_argument(
        "--resolution", type=number, default=RESOLUTION, metavar="M", help=f"of the map's cells; default: {RESOLUTION}"
    )
    command.add_argument(
        "--match", action="store_true", help="correct the poses by the scans, too, where they are not said to drift"
    )
    command.add_argument("--scan-topic", metavar="TOPIC", help="default: /scan, or the only one with scans")
    command.add_argument(
        "--pose-topic", metavar="TOPIC",
        help="of poses on the map; default: the transforms from map, or the only one with poses",
    )  # fmt: skip
    command.add_argument("--odom-topic", metavar="TOPIC", help="default: /odom, or the only one with odometry")
    command.add_argument("--drive-topic", metavar="TOPIC", help="default: /drive, or the only one with commands")
    command.add_argument("--columns", metavar="FILE.toml|LAYOUT", help=_COLUMNS)
    add_setup_options(command, "vehicle")
    command.add_argument("--force", action="store_true", help="replace files that exist, and the run that DIR has")


def add_replay_scans(add: Any, commands: Any) -> None:
    """Add the command; `add` is the one that adds the others."""
    command = add(commands, "replay-scans", _replay_scans, "run a planner over the scans of a robot's bag")
    command.add_argument("bag", metavar="BAG", help=_BAG)
    add_setup_options(command, "controller")
    command.add_argument(
        "--out", metavar="FILE", type=Path,
        help="the commands, .csv, or .mcap with /drive; default: BAG_commands.csv, here",
    )  # fmt: skip
    command.add_argument("--scan-topic", metavar="TOPIC", help="default: /scan, or the only one with scans")
    command.add_argument(
        "--odom-topic",
        metavar="TOPIC",
        help="of odometry, poses or a VESC; default: /odom, or the only one with odometry",
    )
    command.add_argument("--drive-topic", metavar="TOPIC", help="default: /drive, or the only one with commands")
    command.add_argument("--columns", metavar="FILE.toml|LAYOUT", help=_COLUMNS)
    add_setup_options(
        command, "vehicle", "tires", "planner_mu", "max_speed", "track",
        track="whose line a planner with a map follows, as race takes it; default: it has no map",
    )  # fmt: skip
    command.add_argument("--force", action="store_true", help="replace the file if it exists")


def _export(options: argparse.Namespace) -> int:
    from fg_mujoco.addons.ros.bag_writer import export_bag

    if options.format not in FORMATS:
        raise SettingsError(f"format is {options.format!r}; {accepted_names(options.format, FORMATS)}")
    path = options.out or Path(f"{Path(abspath(options.folder)).name}.mcap")
    if path.suffix.lower() != ".mcap":
        raise SettingsError(f"{path}: is no name for a bag; accepted: one that ends in .mcap")
    require_new(path, force=options.force)
    with _progress("tick") as watch:
        ticks = export_bag(options.folder, path, watch, trust=options.trust)
    print(f"{path}: {ticks} ticks, {path.stat().st_size / 1e6:.1f} MB")
    return 0


def _bag(options: argparse.Namespace) -> int:
    from fg_mujoco.addons.ros.bag_recording import Recording

    from .bag_mapping.poses import read_sweeps
    from .mapping.recorded_map import make_map, map_files, write_map

    if _is_csv(options):
        if options.map is not None or options.out is not None:
            what = "map" if options.map is not None else "out"
            raise SettingsError(f"{what} is given, and {options.bag} is a CSV file; accepted: with bags")
        print("\n".join(read_drive(options.bag, columns=options.columns).lines))
        return 0
    require_ros_extra()
    if options.map is not None or options.out is not None:
        require_maps_extra()
    if options.map is not None:
        for file in map_files(options.map):
            require_new(file, force=options.force)
    if options.out is not None:
        check_run_folder(options.out)
    vehicle = setup_of(options).first.car
    with contextlib.ExitStack() as stack:
        bag = stack.enter_context(Recording(options.bag))
        print("\n".join(bag.table()))
        if options.map is None and options.out is None:
            return 0
        aside = stack.enter_context(temporary_folder("the map of the bag"))
        path = options.map or aside / f"{bag.path.resolve().stem}.yaml"
        with bag.blame(), _progress("scan") as watch:
            sweeps = read_sweeps(
                bag,
                vehicle.parameters,
                scan_topic=options.scan_topic,
                pose_topic=options.pose_topic,
                odometry_topic=options.odom_topic,
            )
            made = make_map(sweeps, resolution=options.resolution, match=options.match or None, watch=watch)
        write_map(made, path, f"made by: fg-mujoco bag {bag.path.name}")
        rows, columns = made.cells.shape
        size = f"{columns * made.resolution:.1f} x {rows * made.resolution:.1f} m"
        print(f"{options.map or 'map'}: {size}, of {made.text}")
        if options.map is not None:
            print(_course_of(options.map))
        if options.out is not None:
            _write_run(options, bag, sweeps, made, load_track(str(path)), vehicle)
    return 0


def _write_run(
    options: argparse.Namespace, bag: Recording, sweeps: Sweeps, made: RecordedMap, course: Course, vehicle: Vehicle
) -> None:
    """Write the run folder of a bag, with its picture and its report, and say what it has."""
    from .bag_mapping.mapped_run import write_recorded_run

    with contextlib.redirect_stdout(sys.stderr):
        write_recorded_run(bag, sweeps, made, course, vehicle, options.out, drive_topic=options.drive_topic)
        write_page(options.out)
    print(f"written to {options.out}: {read_run(options.out)!r}")


def _course_of(path: Path) -> str:
    """Return what course a map is, in words."""
    try:
        return f"a course: {describe_course(load_track(str(path)))}; fg-mujoco race --track {path} drives it"
    except TrackError as error:
        return f"no course yet: {in_one_line(str(error))}"


def _is_csv(options: argparse.Namespace) -> bool:
    """Return whether a command is given a CSV file, and refuse columns with anything else."""
    path = Path(options.bag)
    kind = kind_of(path)
    refuse_for_kind(path, kind, options.columns, {})
    if kind == "csv":
        names = ("scan_topic", "drive_topic", "odom_topic")
        refuse_for_kind(path, kind, None, {name: getattr(options, name) for name in names})
    return kind == "csv"


def _replay_scans(options: argparse.Namespace) -> int:
    from fg_mujoco.addons.ros.bag_reader import ScanBag
    from fg_mujoco.addons.ros.bag_replay import check_commands_file, planned

    from .drives.drive_scans import deliveries

    from_csv = _is_csv(options)
    if not from_csv:
        require_ros_extra()
    out = options.out or Path(f"{Path(abspath(options.bag)).stem}_commands.csv")
    check_commands_file(out)
    require_new(out, force=options.force)
    setup = setup_of(options)
    choice, drive = ControllerChoice.of(str(setup.first.controller)), setup.drive_settings
    mapped = hasattr(options, "track")
    course = load_track(setup.track if mapped else _ANY_TRACK, car=drive.car.parameters)
    context = drive.context(drive.world(course).parameters, course.map_line if mapped else None)
    planner = make_controller(choice.source, context, settings=dict(choice.settings))
    if from_csv:
        recorded = read_drive(options.bag, columns=options.columns)
        with contextlib.redirect_stdout(sys.stderr):
            written = _write(planned(planner, deliveries(recorded, context.car)), out)
        if written is None:
            return 1
        print(f"{out}: {written} commands to the beams of {options.bag}")
        return 0
    bag = ScanBag(
        options.bag,
        context.car,
        scan_topic=options.scan_topic,
        odometry_topic=options.odom_topic,
        drive_topic=options.drive_topic,
    )
    # what a planner prints is not our output
    with bag, contextlib.redirect_stdout(sys.stderr), _progress("scan") as watch:
        if ODOMETRY not in bag.topics:
            warnings.warn(f"{options.bag}: no odometry; the speed is {bag.speed}", stacklevel=2)

        def watched() -> Iterator[Any]:
            for count, delivery in enumerate(bag, start=1):
                yield delivery
                watch(count, bag.scans)

        count = _write(planned(planner, watched()), out)
    if count is None:
        return 1
    print(f"{out}: {count} commands to the scans on {bag.topics[SCAN]}")
    return 0


def _write(commands: Iterator[PlannedCommand], out: Path) -> int | None:
    """Write commands and return how many there are; None: the planner failed, which is said."""
    from fg_mujoco.addons.ros.bag_replay import write_commands

    try:
        return write_commands(commands, out)
    except PlannerError as error:
        print("fg-mujoco:", in_one_line(f"{error}; {out} has the commands up to there"), file=sys.stderr)
        return None


@contextlib.contextmanager
def _progress(what: str) -> Iterator[Any]:
    with ProgressLine(f"reading {what}s") as line:

        def watch(count: int, total: int) -> None:
            if line.due:
                line.write(f"{what} {count}/{total}")

        yield watch
