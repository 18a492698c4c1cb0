"""Runs a planner over the scans of a bag, in the order in which they arrived.

The commands do not change how the recorded car drives, and so not the next scan.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from fg_mujoco.course.writing import staged_file
from fg_mujoco.errors import BagError, SettingsError
from fg_mujoco.messages import Controller, DriveCommand
from fg_mujoco.simulation.planner_adapter import plan, start

from .bag_messages import drive_message
from .bag_reader import Delivery
from .bag_writer import KEPT, BagWriter

COLUMNS = ("received_s", "stamp_s", "steering_angle_rad", "speed_m_s")
"""Of the CSV: when the scan came in, the stamp in its header, and the command."""
SUFFIXES = (".csv", ".mcap")


@dataclass(frozen=True, kw_only=True)
class PlannedCommand:
    """A planner's command for a scan."""

    received: int  # [ns] when the scan came in
    measured: int  # [ns] the stamp in its header
    command: DriveCommand


def planned(planner: Controller, deliveries: Iterable[Delivery]) -> Iterator[PlannedCommand]:
    """Reset a planner, and yield its command for each scan; ControllerError: it raises, or answers none."""
    start(planner)
    for delivery in deliveries:
        command = plan(planner, delivery.scan, delivery.odometry)
        yield PlannedCommand(received=delivery.received, measured=delivery.measured, command=command)


def check_commands_file(path: Path) -> None:
    """Make sure that commands can be written to a file of this name; SettingsError: none of SUFFIXES."""
    if path.suffix.lower() not in SUFFIXES:
        raise SettingsError(f"{path}: is no file of commands; accepted: one that ends in {' or '.join(SUFFIXES)}")


def write_commands(commands: Iterable[PlannedCommand], path: str | Path) -> int:
    """Write commands as CSV, a row each, or as /drive in an MCAP bag; return how many.

    After Ctrl-C, and where the planner fails, the commands up to there are written. Any other error leaves no file.
    Raises SettingsError: another suffix; BagError: the file cannot be written.
    """
    path = Path(path)
    check_commands_file(path)
    return _write_bag(commands, path) if path.suffix.lower() == ".mcap" else _write_csv(commands, path)


def _write_bag(commands: Iterable[PlannedCommand], path: Path) -> int:
    count = 0
    with BagWriter(path) as bag:
        for answer in commands:
            bag.write("/drive", drive_message(answer.command, answer.received), answer.received)
            count += 1
    return count


def _write_csv(commands: Iterable[PlannedCommand], path: Path) -> int:
    count, ended = 0, None
    try:
        with staged_file(path) as aside, aside.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(COLUMNS)
            try:
                for answer in commands:
                    times = map(_seconds, (answer.received, answer.measured))
                    writer.writerow((*times, repr(answer.command.steering_angle), repr(answer.command.speed)))
                    count += 1
            except KEPT as error:
                ended = error
    except OSError as error:
        if isinstance(error, BagError):  # of the bag that the commands are read from
            raise
        raise BagError(f"{path}: cannot be written: {error.strerror or error}; accepted: a file that can be") from error
    if ended is not None:
        raise ended
    return count


def _seconds(nanoseconds: int) -> str:
    """Return a time in seconds, all nine digits of it: a float of the seconds since 1970 has fewer."""
    sign, (whole, part) = "-" if nanoseconds < 0 else "", divmod(abs(nanoseconds), 1_000_000_000)
    return f"{sign}{whole}.{part:09d}"
