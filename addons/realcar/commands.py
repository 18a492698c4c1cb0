"""The commands of real cars and their bags."""

from __future__ import annotations

import argparse
import contextlib
import sys
import warnings
from collections.abc import Callable, Iterator
from os.path import abspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fg_mujoco.addons.ros.bag_messages import ODOMETRY, SCAN, require_ros_extra
from fg_mujoco.cli.command import FORCE, command, number, option, require_ending, whole
from fg_mujoco.cli.options import NAMES, in_one_line, setup_of, setup_options
from fg_mujoco.cli.out import course_files, given, new_files, require_new
from fg_mujoco.cli.progress import ProgressLine, shown_as
from fg_mujoco.course.writing import staged_folder, write_file, writing
from fg_mujoco.errors import PlannerError, SettingsError, accepted_names
from fg_mujoco.messages import require_whole
from fg_mujoco.pictures.pages.bokeh_plots import require_bokeh
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.racing.planners import ControllerChoice, make_controller
from fg_mujoco.simulation.course_loading import load_track
from fg_mujoco.vehicle.vehicle import Vehicle

from .drives.reading import kind_of, read_drive, refuse_for_kind

if TYPE_CHECKING:
    from fg_mujoco.addons.ros.bag_replay import PlannedCommand

    from .identification.identification import Identification

FORMATS = ("mcap",)

_ANY_TRACK = "oval"  # a planner is told of the car as in a race: as MJCF text has it, to six digits

_BAG = option("bag", ".mcap or .db3, or the folder of one or of its parts; .bag of ROS 1; or a drive's .csv", "BAG")
_COLUMNS = option(
    "--columns", "meaning of a CSV file's columns; default: a known layout", "FILE.toml|LAYOUT"
)
_DRIVE_TOPIC = option("--drive-topic", "default: /drive, or the only one with commands", "TOPIC")
_ODOM_TOPIC = option("--odom-topic", "of odometry, poses or a VESC; default: /odom, or the only one there is", "TOPIC")
_SCAN_TOPIC = option("--scan-topic", "default: /scan, or the only one with scans", "TOPIC")


@command(
    option("sources", "run folders; .csv, .mcap, .db3 or .bag files, or folders of bags", "DRIVE", nargs="+"),
    option(
        "--out", "FOLDER: the car, its tires and a page, NAME.xml, NAME_tires.toml and NAME.html, NAME that of the "
        "folder; FILE.toml: the tires alone", "FOLDER|FILE.toml", Path, required=True,
    ),
    option(
        "--hold-out", "drives for validation only; default: every third second of each drive",
        "DRIVE", nargs="+", default=[],
    ),
    option("--budget", "time for the fit [s], after which the best so far counts; default: 120", "S", number),
    option("--report", "a page of data and fit; default: none", "FILE.html", Path),
    option(
        "--vehicle", "car whose mass, inertia, lengths and drive line count; default: the run's own, else f1tenth",
        "NAME|FILE", names=NAMES["vehicle"],
    ),
    option("--linear", "find only the stiffness of each axle, for a gentle drive"),
    option(
        "--single-track", "fit the single-track model: no load transfer, and driving takes no grip"
    ),
    _COLUMNS,
    option("--pose-topic", "of the poses in a bag; default: the only one there is, or the odometry's", "TOPIC"),
    _DRIVE_TOPIC,
    option("--imu-topic", "default: /imu, or the only one there is", "TOPIC"),
    _ODOM_TOPIC,
    FORCE,
)  # fmt: skip
def identify_command(options: argparse.Namespace) -> int:
    """Find the tires, the steering and the drive of a car from its drives, and write them as files."""
    from .bag_drive import identify
    from .identification.fit import require_scipy
    from .identification.identification import BUDGET
    from .identification.tire_file import check_tire_file

    require_scipy()
    folder = None if options.out.suffix else options.out
    tires, report, car = options.out, options.report, None
    if folder is not None:
        name = folder.absolute().name
        if name.encode(errors="replace").decode() != name:
            raise SettingsError(f"out is {str(folder)!r}; accepted: a name in UTF-8, which the files get")
        tires, report, car = folder / f"{name}_tires.toml", report or folder / f"{name}.html", folder / f"{name}.xml"
    check_tire_file(tires)
    if report is not None:
        require_bokeh()
        require_ending(report, ".html", ".htm", what="a page")
    with new_files(folder, *filter(None, (tires, report, car)), options=options):
        with shown_as(str, "reading drives") as watch:
            found = identify(
                *options.sources, vehicle=options.vehicle, linear=options.linear,
                single_track=options.single_track, columns=options.columns, pose_topic=options.pose_topic,
                drive_topic=options.drive_topic, imu_topic=options.imu_topic, odometry_topic=options.odom_topic,
                hold_out=options.hold_out, budget=BUDGET if options.budget is None else options.budget, watch=watch,
            )  # fmt: skip
        _write_identified(found, options.vehicle, tires, report, car)
    print(found.summary())
    print(f"written to {tires}")
    if car is not None:
        print(f"car: {car}; drive it with --vehicle {car}")
    if report is not None:
        print(f"report: {report}")
    return 0


def _write_identified(
    found: Identification, vehicle: str | None, tires: Path, report: Path | None, car: Path | None
) -> None:
    """Write the files of an identification; those of a car's folder all together, when the car has been loaded."""
    from .identification.identification_page import write_identification_report
    from .identification.tire_file import write_tires
    from .identification.vehicle_file import write_vehicle

    if car is None:
        write_tires(found, tires)
        if report is not None:
            write_identification_report(found, report)
        return
    with writing(car.parent), staged_folder(car.parent, last=car.name) as aside:
        write_tires(found, aside / tires.name)
        if report is not None:
            write_identification_report(found, aside / report.name if report.parent == car.parent else report)
        assumed = Vehicle.load(vehicle or found.drives[0].vehicle)
        Vehicle.load(write_vehicle(found, assumed, aside / car.name, tires=tires.name))


@command(
    option("drives", "CSV files, folders of them, bags, or run folders", "DRIVE", nargs="+"),
    setup_options("vehicle", "tires", "mu", "floor"),
    _COLUMNS,
    option("--threads", "number of threads; the results are the same for any; default: 1", "N", whole, 1),
    option("--report", "a page of overlays and residuals; default: none", "FILE.html", Path),
    option("--csv", "all figures, a row each; default: none", "FILE.csv", Path),
    FORCE,
)  # fmt: skip
def validate_command(options: argparse.Namespace) -> int:
    """Drive the recorded commands of a real car from its recorded states, and say how far a model is off."""
    from .validation.validation import validate
    from .validation.validation_page import write_validation_page

    require_whole("threads", options.threads, 1)
    for path, endings in ((options.report, (".html", ".htm")), (options.csv, (".csv",))):
        if path is not None:
            require_ending(path, *endings, what="it")
            require_new(path, force=options.force, reads=given(options, "report", "csv"))
    if options.report is not None:
        require_bokeh()
    setup = setup_of(options).first
    with shown_as(str, "reading drives") as watch:
        found = validate(
            options.drives, vehicle=setup.car, tires=setup.tires, mu=setup.set_mu, columns=options.columns,
            threads=options.threads, watch=watch,
        )  # fmt: skip
    for name, checks in {drive.part_of or drive.name: drive.checks for drive in found.drives}.items():
        print(f"{name}: {checks}")
    print(f"\n{found}")
    if options.csv is not None:
        with writing(options.csv):
            write_file(options.csv, Table.of(found.rows).csv().encode())
        print(f"written to {options.csv}")
    if options.report is not None:
        print(f"report: {write_validation_page(found, options.report)}")
    return 0


@command(
    option("folder", "written by race --out", "DIR"),
    option("--format", "{names}, the default", "NAME", default="mcap", names=lambda: FORMATS),
    option("--out", "default: the folder's name, here", "FILE.mcap", Path),
    FORCE,
)
def export_command(options: argparse.Namespace) -> int:
    """Write a run folder as a ROS 2 bag, for Foxglove, ros2 bag and rosbags."""
    from fg_mujoco.addons.ros.bag_writer import export_bag

    if options.format not in FORMATS:
        raise SettingsError(f"format is {options.format!r}; {accepted_names(options.format, FORMATS)}")
    path = options.out or Path(f"{Path(abspath(options.folder)).name}.mcap")
    require_ending(path, ".mcap", what="a bag")
    require_new(path, force=options.force, reads=[options.folder])
    with _progress("tick") as watch:
        ticks = export_bag(options.folder, path, watch)
    print(f"{path}: {ticks} ticks, {path.stat().st_size / 1e6:.1f} MB")
    return 0


@command(_BAG, _COLUMNS)
def bag_command(options: argparse.Namespace) -> int:
    """Say what a robot's bag holds, or a drive's CSV file."""
    from fg_mujoco.addons.ros.bag_recording import Recording

    if _is_csv(options):
        print("\n".join(read_drive(options.bag, columns=options.columns).lines))
        return 0
    require_ros_extra()
    with Recording(options.bag) as bag:
        print("\n".join(bag.table()))
    return 0


def _is_csv(options: argparse.Namespace) -> bool:
    """Return whether a command is given a CSV file, and refuse columns with anything else."""
    path = Path(options.bag)
    kind = kind_of(path)
    refuse_for_kind(path, kind, options.columns, {})
    if kind == "csv":
        names = ("scan_topic", "drive_topic", "odom_topic")
        refuse_for_kind(path, kind, None, {name: getattr(options, name, None) for name in names})
    return kind == "csv"


@command(
    _BAG,
    setup_options(
        "controller", "vehicle", "tires", "planner_mu", "max_speed", "track",
        track="course whose line a planner with a map follows; default: no map",
    ),
    option("--out", "the commands, .csv, or .mcap with /drive; default: BAG_commands.csv, here", "FILE", Path),
    _SCAN_TOPIC,
    _ODOM_TOPIC,
    _DRIVE_TOPIC,
    _COLUMNS,
    FORCE,
)
def replay_scans_command(options: argparse.Namespace) -> int:
    """Run a planner over the scans of a robot's bag."""
    from fg_mujoco.addons.ros.bag_reader import ScanBag
    from fg_mujoco.addons.ros.bag_replay import check_commands_file, planned

    from .drives.drive_scans import deliveries

    from_csv = _is_csv(options)
    if not from_csv:
        require_ros_extra()
    out = options.out or Path(f"{Path(abspath(options.bag)).stem}_commands.csv")
    check_commands_file(out)
    setup = setup_of(options)
    course_read = course_files(setup.track) if hasattr(options, "track") else []
    require_new(out, force=options.force, reads=[*given(options, "out"), *course_read])
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
        options.bag, context.car, scan_topic=options.scan_topic, odometry_topic=options.odom_topic,
        drive_topic=options.drive_topic,
    )  # fmt: skip
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
def _progress(what: str) -> Iterator[Callable[[int, int], None]]:
    with ProgressLine(f"reading {what}s") as line:

        def watch(count: int, total: int) -> None:
            if line.due:
                line.write(f"{what} {count}/{total}")

        yield watch
