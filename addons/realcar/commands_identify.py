"""The command `fg-mujoco identify`: the tires, the steering and the drive of a car, from drives that it recorded."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fg_mujoco.cli.options import number
from fg_mujoco.cli.out import require_new
from fg_mujoco.cli.progress import shown_as
from fg_mujoco.errors import SettingsError

_DONE = 0


def add_identify(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    text = "find the tires, the steering and the drive of a car from its drives, and write them as files"
    add = add_command(commands, "identify", _identify, text).add_argument
    add("sources", metavar="DRIVE", nargs="+", help="run folders; .csv, .mcap, .db3 or .bag files, or folders of bags")
    add(
        "--out", type=Path, required=True, metavar="FOLDER|FILE.toml",
        help="FOLDER: the car, its tires and a page, NAME.xml, NAME_tires.toml and NAME.html, NAME that of the folder; "
        "FILE.toml: the tires alone",
    )  # fmt: skip
    add(
        "--hold-out", metavar="DRIVE", nargs="+", default=[],
        help="drives that nothing is fitted to, to validate on; default: every third second of each drive",
    )  # fmt: skip
    add("--budget", type=number, metavar="S", help="time for the fit, after which the best so far counts; default: 120")
    add("--report", type=Path, metavar="FILE.html", help="a page of data and fit; default: none")
    add(
        "--vehicle", metavar="NAME|FILE.xml",
        help="whose mass, inertia and lengths are assumed; default: the run's own car, or f1tenth with others",
    )  # fmt: skip
    add("--linear", action="store_true", help="find the stiffness of each axle alone, which a gentle drive determines")
    add(
        "--front-drive", type=number, default=0.5, metavar="SHARE",
        help="of the drive at the front axle: 0.5, the default, with four driven wheels, 0 with driven rear wheels",
    )  # fmt: skip
    add(
        "--single-track", action="store_true",
        help="fit the single-track model: no load on outer tires, and driving takes nothing of the grip",
    )  # fmt: skip
    add(
        "--columns", metavar="FILE.toml|LAYOUT",
        help="which columns of a CSV file are what; default: a layout that is recognised",
    )  # fmt: skip
    add(
        "--pose-topic", metavar="TOPIC", help="of the poses in a bag; default: the only one there is, or the odometry's"
    )
    add("--drive-topic", metavar="TOPIC", help="of a bag's commands; default: /drive, or the only one there is")
    add("--imu-topic", metavar="TOPIC", help="default: /imu, or the only one there is")
    add("--odom-topic", metavar="TOPIC", help="default: /odom, or the only one there is")
    add("--force", action="store_true", help="replace files that exist")


def _identify(options: argparse.Namespace) -> int:
    from fg_mujoco.pictures.pages.bokeh_plots import require_bokeh
    from fg_mujoco.vehicle.vehicle import Vehicle

    from .bag_drive import identify
    from .identification.fit import require_scipy
    from .identification.identification import BUDGET
    from .identification.identification_page import write_identification_report
    from .identification.tire_file import check_tire_file, write_tires
    from .identification.vehicle_file import write_vehicle

    require_scipy()
    folder = None if options.out.suffix else options.out
    tires, report = options.out, options.report
    if folder is not None:
        name = folder.absolute().name
        if name.encode(errors="replace").decode() != name:
            raise SettingsError(f"out is {str(folder)!r}; accepted: a name in UTF-8, which the files get")
        tires, report = folder / f"{name}_tires.toml", report or folder / f"{name}.html"
        require_new(folder / f"{name}.xml", force=options.force)
    check_tire_file(tires, force=options.force)
    if report is not None:
        require_bokeh()
        if report.suffix.lower() not in (".html", ".htm"):
            raise SettingsError(f"{report}: is no name for a page; accepted: one that ends in .html")
        require_new(report, force=options.force)
    with shown_as(str, "reading drives") as watch:
        found = identify(
            *options.sources,
            vehicle=options.vehicle,
            linear=options.linear,
            front_drive=options.front_drive,
            single_track=options.single_track,
            columns=options.columns,
            pose_topic=options.pose_topic,
            drive_topic=options.drive_topic,
            imu_topic=options.imu_topic,
            odometry_topic=options.odom_topic,
            hold_out=options.hold_out,
            budget=BUDGET if options.budget is None else options.budget,
            watch=watch,
        )
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    write_tires(found, tires, force=options.force)
    print(found.summary())
    print(f"written to {tires}")
    if folder is not None:
        vehicle = Vehicle.load(options.vehicle or found.drives[0].vehicle)
        car = write_vehicle(found, vehicle, folder / f"{folder.absolute().name}.xml", tires=tires.name)
        Vehicle.load(car)
        print(f"car: {car}; drive it with --vehicle {car}")
    if report is not None:
        print(f"report: {write_identification_report(found, report)}")
    return _DONE
