"""The command `fg-mujoco vehicles`: the vehicles, one line each, and the floors; of a file, whether it is a vehicle."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable
from typing import Any

from ..errors import SettingsError
from ..vehicle.floors import Floor, floor_names
from ..vehicle.tires import Tires, tire_names
from ..vehicle.vehicle import Vehicle, vehicle_names

_DONE = 0


def add_vehicles(add_command: Callable[..., argparse.ArgumentParser], commands: Any) -> None:
    """Add the command; `add_command` is the one that adds the others."""
    add = add_command(commands, "vehicles", _vehicles, "list the vehicles, and what they are like").add_argument
    add("names", metavar="NAME|FILE.xml", nargs="*", help="of a vehicle, or its MJCF file; default: the bundled ones")
    add("--floors", action="store_true", help="list the floors that were measured, and those of each set of tires")
    add("--json", action="store_true", help="print one JSON array and nothing else")


def _vehicles(options: argparse.Namespace) -> int:
    if options.floors:
        return _floors(options)
    rows = [described(Vehicle.load(name)) for name in options.names or vehicle_names()]
    if options.json:
        print(json.dumps(rows, indent=2))
        return _DONE
    for row in rows:
        lidar = row["lidar"]
        print(
            f"{row['name']:<9} {row['mass_kg']:.2f} kg, wheelbase {row['wheelbase_m']:.3f} m, "
            f"width {row['width_m']:.2f} m, mu {row['mu']:.5g}, LiDAR {lidar['beams']} beams over "
            f"{math.degrees(lidar['field_of_view_rad']):.0f} deg, {lidar['range_max_m']:g} m, {lidar['rate_hz']:.0f} Hz"
        )
    return _DONE


def _floors(options: argparse.Namespace) -> int:
    if options.names:
        raise SettingsError(f"floors of {options.names[0]!r}; accepted: --floors alone")
    floors = [Floor.load(name) for name in floor_names()]
    tires = {name: Tires.load(name).floor or "none: the vehicle's friction, or a floor's" for name in tire_names()}
    if options.json:
        print(json.dumps({"floors": [floor.described() for floor in floors], "tires": tires}, indent=2))
        return _DONE
    for floor in floors:
        known = "" if floor.least is None or floor.greatest is None else f" ({floor.least:g} to {floor.greatest:g})"
        print(f"{floor.name:<12} mu {floor.mu:.5g}{known}: {floor.ground}; {floor.where}")
        for what in ("how", "car", "source"):
            print(f"  {what:<7} {getattr(floor, what)}")
    print("\nTires, and the floor that they were measured on:")
    for name, where in tires.items():
        print(f"  {name:<16} {where}")
    return _DONE


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
        "mu": vehicle.nominal_mu,
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
