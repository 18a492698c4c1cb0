"""Reads any recorded drive: a CSV file, a ROS bag, or a run folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fg_mujoco import from_addons
from fg_mujoco.course.files import is_folder
from fg_mujoco.errors import SettingsError
from fg_mujoco.racing.run_folder import SUMMARY, read_run

from .drive_columns import DriveColumns, recognised
from .drive_csv import header_of, read_csv_drive
from .drive_recording import RecordedDrive

if TYPE_CHECKING:
    from fg_mujoco.vehicle.vehicle import Vehicle

CSV = (".csv", ".tsv", ".txt")
BAGS = (".mcap", ".db3", ".bag")
_HEAD = 2**18  # characters, of comments and a header
ACCEPTED = "a CSV file, an .mcap or .db3 file, a .bag of ROS 1, the folder of a bag, or a run folder"


def read_drive(
    path: str | Path,
    *,
    columns: DriveColumns | Mapping[str, Any] | str | Path | None = None,
    vehicle: str | Path | Vehicle | None = None,
    **topics: str | None,
) -> RecordedDrive:
    """Return a drive that was recorded in a CSV file, a ROS bag or a run folder.

    `columns` of a CSV file are a TOML file that names them, its content, or the name of a layout; None: of a layout
    that is recognised by its header. The wheel radius of `vehicle` turns a bag's wheel speeds into m/s; None:
    `f1tenth`. `topics` of a bag are `pose_topic`, `drive_topic`, `imu_topic`, `odometry_topic`; None: the usual or only
    one.
    Raises MissingExtraError: a bag without the extra `ros`; RunFolderError, BagError: what cannot be read, or a bag
    that lacks a channel; SettingsError: a file that is none of these, lacks a column, whose clock runs backwards, or
    whose units are wrong.
    """
    path = Path(path)
    kind = kind_of(path)
    refuse_for_kind(path, kind, columns, topics)
    if kind == "csv":
        return read_csv_drive(path, None if columns is None else DriveColumns.of(columns))
    if kind == "bag":
        return from_addons.read_bag_drive(path, vehicle=vehicle, **topics)
    from .driven_runs import drive_of_run  # loads MuJoCo

    return drive_of_run(read_run(path))


def refuse_for_kind(path: Path, kind: str, columns: object, topics: Mapping[str, str | None]) -> None:
    """Refuse columns with what is no CSV file, and topics with what is no bag; SettingsError: one is given."""
    if columns is not None and kind != "csv":
        raise SettingsError(f"columns is given, and {path} is a {kind}; accepted: with CSV files")
    given = next((name for name, topic in topics.items() if topic is not None), None)
    if given is not None and kind != "bag":
        article = "run" if kind == "run" else "CSV file"
        raise SettingsError(f"{given} is {topics[given]!r}, and {path} is a {article}; accepted: with bags")


def kind_of(path: Path) -> str:
    """Return what a path is, "csv", "bag" or "run", whether it is there or not; SettingsError: none of these."""
    if is_folder(path):
        if (path / SUMMARY).is_file():
            return "run"
        return "bag" if any(each.suffix.lower() in BAGS for each in path.iterdir()) else "run"
    suffix = path.suffix.lower()
    if suffix in CSV:
        return "csv"
    if suffix in BAGS or suffix not in (".toml", ".xml", ".yaml", ".json", ".png", ".npz", ".html"):
        return "bag"  # which is recognised by its first bytes
    raise SettingsError(f"{path}: is no drive; accepted: {ACCEPTED}")


def read_drives(*paths: str | Path, **options: Any) -> list[RecordedDrive]:
    """Return the drives of some paths; a folder of CSV files is all of them that are drives, sorted by name.

    Arguments and errors as of `read_drive`. Of a folder, CSV files whose columns no known layout has are left out,
    where no columns are given.
    """
    found = []
    for path in map(Path, paths):
        inside = sorted(path.glob("*.csv")) if is_folder(path) and not (path / SUMMARY).is_file() else []
        if not inside:
            found.append(read_drive(path, **options))
            continue
        drives = [each for each in inside if options.get("columns") is not None or _is_drive(each)]
        if not drives:
            raise SettingsError(f"{path}: none of its {len(inside)} CSV files is a drive; accepted: {ACCEPTED}")
        found += [read_drive(each, **options) for each in drives]
    return found


def _is_drive(path: Path) -> bool:
    """Return whether the columns of a CSV file are of a known layout."""
    with path.open(encoding="utf-8", errors="replace") as file:
        names, _, _ = header_of(file.read(_HEAD).split("\n"))
    return recognised(names) is not None
