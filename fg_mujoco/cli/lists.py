"""The commands `fg-mujoco controllers` and `fg-mujoco vehicles`: which planners, cars and floors there are."""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import fields, is_dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from .. import from_addons
from ..controllers import BASELINES
from ..errors import SettingsError
from ..racing.planner_origin import distribution
from ..racing.planners import controller_names, find_controller
from ..vehicle.tires import Tires, tire_names
from ..vehicle.vehicle import Vehicle, vehicle_names
from .command import command, option

_TEXT_COLUMN = 46


@command(
    option("names", "of a controller, or path/to/file.py:ClassName; default: all", "NAME", nargs="*"),
    option("--json", "print one JSON array and nothing else"),
)
def controllers_command(options: argparse.Namespace) -> int:
    """List the controllers and their settings, and then the baselines, which look at nothing."""
    described = [describe(name) for name in options.names or (*controller_names(), *BASELINES)]
    if options.json:
        print(json.dumps(described, indent=2, default=str))
    else:
        print("\n\n".join(_table(each) for each in described))
    return 0


def describe(name: str) -> dict[str, Any]:
    """Return a controller's summary, in one line, and its settings, for tables.

    Returns:
      name, summary, baseline, distribution and settings; of each setting its name, unit, default, text, and what is
      accepted. The default of a setting of the car is that of the F1TENTH car, and `scales` says that it is scaled to
      other cars; that of a setting of the method is a table with both.

    Raises:
      ControllerError: an unknown name, or a file or class that cannot be loaded.
    """
    found = find_controller(name)
    module, kind = sys.modules.get(found.__module__), getattr(found, "Settings", None)
    text = None if name in BASELINES else getattr(module, "__doc__", None)
    lines = (text or found.__doc__ or "").strip().splitlines()
    return {
        "name": name,
        "summary": lines[0] if lines else "",
        "baseline": name in BASELINES,
        "distribution": distribution(found, name),
        "settings": describe_settings(kind) if isinstance(kind, type) and is_dataclass(kind) else [],
    }


def describe_settings(kind: type) -> list[dict[str, Any]]:
    """Return name, unit, default, text, accepted and scales of the fields of a settings dataclass, in their order."""
    hints, rows = get_type_hints(kind), []
    for each in fields(kind):
        hint, of_field = hints.get(each.name), each.metadata
        accepted = getattr(of_field.get("accepted"), "text", "")
        if get_origin(hint) is Literal:
            accepted = ", ".join(get_args(hint))
        rows.append(
            {
                "name": each.name, "unit": of_field.get("unit", ""),
                "default": of_field.get("of_f1tenth", of_field.get("of_method", each.default)),
                "text": of_field.get("text", ""),
                "accepted": accepted, "scales": "of_f1tenth" in of_field,
            }
        )  # fmt: skip
    return rows


def _table(described: dict[str, Any]) -> str:
    package = described["distribution"]
    by = "" if package in ("fg-mujoco", None) else f" ({package})"
    lines = [f"{described['name']}{by}: {described['summary']}"]
    for each in described["settings"]:
        value = f"  {each['name']} = {value_text(each['default'])} {each['unit']}".rstrip()
        notes = [each["text"], f"({each['accepted']})" if each["accepted"] else ""]
        if each["scales"]:
            notes.append("[F1TENTH car; scaled to others]")
        lines.append(f"{value:<{_TEXT_COLUMN}} {' '.join(filter(None, notes))}".rstrip())
    return "\n".join(lines)


def value_text(value: Any) -> str:
    """Return a default as tables show it; one of two methods as both of its values."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return " or ".join(f"{value_text(each)} ({name})" for name, each in value.items())
    if isinstance(value, float) and math.isfinite(value):
        return f"{value:.4g}"
    return str(value)


@command(
    option("names", "of a vehicle, or a file or folder of one; default: the bundled ones", "NAME|FILE", nargs="*"),
    option("--floors", "list the floors that were measured, and those of each set of tires"),
    option("--json", "print one JSON array and nothing else"),
)
def vehicles_command(options: argparse.Namespace) -> int:
    """List the vehicles, and what they are like."""
    if options.floors:
        return _floors(options)
    rows = [described(Vehicle.load(name)) for name in options.names or vehicle_names()]
    if options.json:
        print(json.dumps(rows, indent=2))
        return 0
    for row in rows:
        lidar = row["lidar"]
        print(
            f"{row['name']:<9} {row['mass_kg']:.2f} kg, wheelbase {row['wheelbase_m']:.3f} m, "
            f"width {row['width_m']:.2f} m, mu {row['mu']:.5g}, LiDAR {lidar['beams']} beams over "
            f"{math.degrees(lidar['field_of_view_rad']):.0f} deg, {lidar['range_max_m']:g} m, {lidar['rate_hz']:.0f} Hz"
        )
    return 0


def _floors(options: argparse.Namespace) -> int:
    if options.names:
        raise SettingsError(f"floors of {options.names[0]!r}; accepted: --floors alone")
    floors = [from_addons.Floor.load(name) for name in from_addons.floor_names()]
    tires = {name: Tires.load(name).floor or "none: the vehicle's friction, or a floor's" for name in tire_names()}
    if options.json:
        print(json.dumps({"floors": [floor.described() for floor in floors], "tires": tires}, indent=2))
        return 0
    for floor in floors:
        known = "" if floor.least is None or floor.greatest is None else f" ({floor.least:g} to {floor.greatest:g})"
        print(f"{floor.name:<12} mu {floor.mu:.5g}{known}: {floor.ground}; {floor.where}")
        for what in ("how", "car", "source"):
            print(f"  {what:<7} {getattr(floor, what)}")
    print("\nTires, and the floor that they were measured on:")
    for name, where in tires.items():
        print(f"  {name:<16} {where}")
    return 0


def described(vehicle: Vehicle) -> dict[str, Any]:
    """Return what a vehicle is like, as JSON has it."""
    car, beams = vehicle.parameters, vehicle.lidar.beams
    return {
        "name": vehicle.name,
        "file": vehicle.file,
        "mass_kg": car.mass,
        "wheelbase_m": car.wheelbase,
        "length_m": car.length,
        "width_m": car.width,
        "mu": vehicle.greatest_mu(),
        "max_steering_angle_rad": car.max_steering_angle,
        "max_speed_m_s": car.max_speed,
        "lidar": {
            "file": vehicle.lidar.file,
            "beams": len(beams.bearings),
            "field_of_view_rad": beams.angle_max - beams.angle_min,
            "range_max_m": beams.range_max,
            "rate_hz": 1.0 / beams.period,
        },
        "sha256": vehicle.sha256,
    }
