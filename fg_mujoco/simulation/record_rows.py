"""Rows of tables of arrays (fg_mujoco.array_table) whose arrays are of the simulation's types of records."""

from __future__ import annotations

from typing import Any

from ..array_table import Row, carray, pointer
from ..course.lap_timer import LAP_TIMER
from ..kernels import kernel
from ..lidar.links import LINK
from ..messages import ODOMETRY
from ..vehicle.motion import CAR
from ..vehicle.tire_forces import GEAR, TIRE
from .telemetry import STATISTICS


@kernel
def car_rows(row: Row) -> Any:
    """Return the array of a row: of type CAR."""
    return carray(pointer(row[0]), (row[1],), CAR)


@kernel
def link_rows(row: Row) -> Any:
    """Return the array of a row: of type LINK."""
    return carray(pointer(row[0]), (row[1],), LINK)


@kernel
def tire_rows(row: Row) -> Any:
    """Return the array of a row: of type TIRE."""
    return carray(pointer(row[0]), (row[1],), TIRE)


@kernel
def gear_rows(row: Row) -> Any:
    """Return the array of a row: of type GEAR."""
    return carray(pointer(row[0]), (row[1],), GEAR)


@kernel
def timer_rows(row: Row) -> Any:
    """Return the array of a row: of type LAP_TIMER."""
    return carray(pointer(row[0]), (row[1],), LAP_TIMER)


@kernel
def odometry_rows(row: Row) -> Any:
    """Return the array of a row: of type ODOMETRY."""
    return carray(pointer(row[0]), (row[1],), ODOMETRY)


@kernel
def statistics_rows(row: Row) -> Any:
    """Return the array of a row: of type STATISTICS."""
    return carray(pointer(row[0]), (row[1],), STATISTICS)
