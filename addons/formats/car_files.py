"""Reads what files tell of a car: f1tenth_gym's parameters, vesc.yaml, ForzaETH's, SlipX's and TUM's files, URDF.

All is brought to the names of f1tenth_gym, in SI units and radians. Of several files the first that tells a value has
it. What is told and means nothing to a car here is listed, not dropped in silence.
"""

from __future__ import annotations

import configparser
import importlib.util
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fg_mujoco.course.documents import comment
from fg_mujoco.course.files import is_file, is_folder, read_setting
from fg_mujoco.course.maps.map_server import plain_yaml
from fg_mujoco.errors import SettingsError, missing_extra
from fg_mujoco.vehicle.changes import GREATEST_MU

from .urdf import urdf_values

_MOST_BYTES = 2**20  # of a file
_SPELLINGS = {
    "m": "m mass vehicle_mass total_mass", "I": "I I_z Iz Izz izz moment_inertia yaw_inertia inertia_z",
    "lf": "lf l_f l_cg2front wheelbase_front",
    "lr": "lr l_r l_cg2rear wheelbase_rear", "wheelbase": "wheelbase wheel_base l_wb lwb",
    "h": "h h_cg h_cog height_cg cog_z", "mu": "mu mue friction_coeff friction_coefficient",
    "C_Sf": "C_Sf C_S_front cs_f", "C_Sr": "C_Sr C_S_rear cs_r",
    "s_min": "s_min min_steer min_steering_angle delta_min",
    "s_max": "s_max max_steer max_steering_angle max_steer_angle max_angle delta_max",
    "sv_min": "sv_min ddelta_min",
    "sv_max": "sv_max max_steering_vel max_steering_velocity max_rate max_servo_speed max_steering_rate ddelta_max",
    "v_switch": "v_switch", "a_max": "a_max max_accel accel_max max_acceleration", "v_min": "v_min",
    "v_max": "v_max max_speed", "width": "width width_m", "length": "length length_m",
    "track_width": "track_width track_front track_width_front", "wheel_radius": "wheel_radius r_wheel",
    "rolling": "roll_resist c_roll", "relaxation": "sigma", "k_mu": "k_mu", "f_z0": "f_z0",
} | {
    f"{letter}{axle[0]}": f"{letter}{axle[0]} {letter}_{axle[0]} {letter}_{axle}"
    for letter in ("B", "C", "D", "E", "eps") for axle in ("front", "rear")
}  # fmt: skip
_QUANTITIES = {name: quantity for quantity, names in _SPELLINGS.items() for name in names.split()}
_MUST = {
    "m": (0.1, 5000.0, "kg"), "I": (1e-4, 1e5, "kg m^2"), "lf": (0.01, 5.0, "m"), "lr": (0.01, 5.0, "m"),
    "wheelbase": (0.05, 10.0, "m"), "h": (0.0, 3.0, "m"), "mu": (1e-3, GREATEST_MU, "-"), "s_max": (0.01, 1.2, "rad"),
    "s_min": (-1.2, -0.01, "rad"), "sv_max": (0.01, 100.0, "rad/s"), "sv_min": (-100.0, -0.01, "rad/s"),
    "v_max": (0.1, 200.0, "m/s"), "v_min": (-200.0, 0.0, "m/s"), "a_max": (0.1, 100.0, "m/s^2"),
    "f_z0": (1e-3, 1e6, "N"), "width": (0.01, 5.0, "m"), "length": (0.01, 10.0, "m"), "wheel_radius": (0.005, 1.0, "m"),
} | {f"D{axle}": (1e-3, GREATEST_MU, "times the load, and not newtons") for axle in "fr"}  # fmt: skip
"""Of a quantity the least, the greatest, and its unit."""

_OF_A_FOLDER = ("*pacejka*", "*linear*", "car_model.*", "params.*", "dynamics.*", "limits.*", "vesc.*")
_URDF = (".urdf", ".xacro")
_SUFFIXES = (".yaml", ".yml", ".json", ".txt", ".ini", *_URDF)
_USUAL_WHEELBASE = 0.25  # [m] of the vesc.yaml that cars of .33 m are delivered with


@dataclass(frozen=True, kw_only=True)
class Told:
    """A value as a file tells it."""

    value: float
    name: str  # as the file has it
    file: str


@dataclass(frozen=True, kw_only=True)
class CarFiles:
    """What files tell of a car."""

    name: str
    values: Mapping[str, Told]  # by the names of f1tenth_gym, and B, C, D, E of Magic Formulas, f and r behind
    unused: tuple[str, ...]  # what means nothing to a car here
    notes: tuple[str, ...]


def read_car(paths: Sequence[Path]) -> CarFiles:
    """Return what files, or those of a folder, tell of a car; SettingsError: nothing, what cannot be, or differs."""
    values: dict[str, Told] = {}
    unused: list[str] = []
    notes: list[str] = []
    for path in [file for each in paths for file in files_of(each)]:
        found: dict[str, Told] = {}
        for name, value in _values(path):
            quantity = _QUANTITIES.get(name.partition(" ")[0])
            if quantity is None:
                unused.append(name)
                continue
            _require(path, name, quantity, value)
            said = name.partition(" of ")[2] or name
            told = found.setdefault(quantity, Told(value=value, name=said, file=comment(path.name)))
            if told.value != value:
                raise SettingsError(
                    f"{path}: {told.name} is {told.value:g} and {name} is {value:g}; accepted: one of them, or the same"
                )
        for quantity, told in found.items():
            kept = values.setdefault(quantity, told)
            if not math.isclose(kept.value, told.value, rel_tol=1e-6):
                own = f"{kept.value:g} of {kept.file}"
                notes.append(f"{told.name} {told.value:g} of {told.file} is not used, but {own}")
    if not {"m", "lf", "lr", "wheelbase", "mu", "s_max", "v_max", "Bf"} & set(values):
        said = ", ".join(map(str, paths))
        raise SettingsError(
            f"{said}: tells nothing of a car; accepted: names as m, lf, lr, h, I, mu, s_max of f1tenth_gym, or those "
            "of a vesc.yaml"
        )
    if {"lf", "lr", "wheelbase"} <= set(values):
        apart, wheelbase = values["lf"].value + values["lr"].value, values.pop("wheelbase")
        if not math.isclose(apart, wheelbase.value, rel_tol=0.02):
            notes.append(
                f"{wheelbase.name} {wheelbase.value:g} of {wheelbase.file} is not used: lf + lr is {apart:.4g} m"
            )
    first = paths[0]
    name = first.stem if is_file(first) else first.resolve().name
    return CarFiles(name=re.sub(r"\W+", "_", name), values=values, unused=tuple(unused), notes=tuple(notes))


def is_car(path: Path) -> bool:
    """Return whether a path is that of a file or a folder that tells of a car."""
    return is_folder(path) or (path.suffix.lower() in _SUFFIXES and is_file(path))


def files_of(path: Path) -> list[Path]:
    """Return a file, or those of a folder that tell of a car, what was measured first."""
    if not is_folder(path):
        return [path]
    found = [file for form in _OF_A_FOLDER for file in sorted(path.glob(form)) if file.suffix.lower() in _SUFFIXES]
    found += sorted((path / "tyres").glob("*.yaml")) + sorted(path.glob("*.urdf"))
    if not found:
        said = f"vehicle file {path}: is a folder without a file of a car"
        raise SettingsError(f"{said}; accepted: an MJCF file, or a folder with one of {', '.join(_OF_A_FOLDER)}")
    if len(list((path / "tyres").glob("*.yaml"))) > 1:
        raise SettingsError(f"{path}/tyres: several sets; accepted: the folder's files one by one, with one of tyres")
    return list(dict.fromkeys(found))


def _values(path: Path) -> Iterator[tuple[str, float]]:
    """Yield the names and numbers of a file; behind a name there may stand of what in the file it is made."""
    text = read_setting(path, f"vehicle file {path}", "a file of a car's parameters", _MOST_BYTES)
    if path.suffix.lower() in _URDF:
        yield from urdf_values(path, text)
        return
    if importlib.util.find_spec("yaml") is None:
        raise missing_extra("parameters of a car need PyYAML", "maps")
    try:
        content = _ini(text) if path.suffix.lower() == ".ini" else plain_yaml(text)
    except Exception as error:  # of YAML
        said = " ".join(str(error).split())
        raise SettingsError(f"vehicle file {path}: {said}; accepted: YAML or JSON of names and numbers") from error
    leaves: dict[str, Any] = {}
    for name, value in _leaves(content):  # of a name in several sections the first is the file's own
        if leaves.setdefault(name, value) != value and (number := _number(value)) is not None:
            yield f"a second {name} of {number:g}", number
    numbers = {name: number for name, value in leaves.items() if (number := _number(value)) is not None}
    if {"nominal_load", "c_alpha"} <= set(numbers):  # SlipX's tyres, of both axles
        if zero := [name for name in ("nominal_load", "mu_y0", "C") if numbers.get(name) == 0.0]:
            raise SettingsError(f"{path}: {zero[0]} is 0; accepted: a number above 0")
        friction, shape = numbers.pop("mu_y0", math.nan), numbers.pop("C", math.nan)
        stiffness, curvature = numbers.pop("c_alpha") / numbers["nominal_load"], numbers.pop("E", 0.0)
        for axle in "fr":
            yield from ((f"B{axle}", stiffness / (shape * friction)), (f"C{axle}", shape))
            yield from ((f"D{axle}", friction), (f"E{axle}", curvature))
    numbers |= _of_tum(numbers)
    for axle in "fr":  # ForzaETH's lists
        formula = leaves.get(f"C_P{axle}", leaves.get({"f": "pacejka_front", "r": "pacejka_rear"}[axle]))
        if isinstance(formula, list) and len(formula) == 4:
            for letter, value in zip("BCDE", formula, strict=True):
                number = _number(value)
                yield f"{letter}{axle}", math.nan if number is None else number
    if "steering_angle_to_servo_gain" in numbers:
        numbers = dict(_vesc(numbers))
    yield from numbers.items()


def _ini(text: str) -> dict[str, dict[str, Any]]:
    """Return the sections of an INI whose values are JSON, as of TUM's global_racetrajectory_optimization."""
    parser = configparser.ConfigParser(interpolation=None, default_section="\0")
    parser.optionxform = str  # type: ignore[assignment, method-assign]  # keeps capitals
    parser.read_string(text)
    return {name: {key: plain_yaml(value) for key, value in parser[name].items()} for name in parser.sections()}


def _of_tum(numbers: dict[str, float]) -> dict[str, float]:
    """Return what follows from TUM's numbers: its tires' D is `mue` alone; its motor has a force and a power."""
    found: dict[str, float] = {}
    if {"f_z0", "B_front", "B_rear", "mue"} <= set(numbers):
        found |= {f"D{axle} of F_z mue": 1.0 for axle in "fr"}
    force, power, mass = (numbers.get(name, 0.0) for name in ("f_drive_max", "power_max", "mass"))
    if mass > 0.0 and _MUST["a_max"][0] <= force / mass <= _MUST["a_max"][1]:
        found["a_max of f_drive_max and mass"] = numbers.pop("f_drive_max") / mass
        if power > 0.0:
            found["v_switch of power_max and f_drive_max"] = numbers.pop("power_max") / force
    return found


def _vesc(numbers: dict[str, float]) -> Iterator[tuple[str, float]]:
    """Yield what the settings of a VESC tell: how far the servo turns the wheels, and how fast the motor drives."""
    turn, middle = numbers.pop("steering_angle_to_servo_gain"), numbers.pop("steering_angle_to_servo_offset", 0.5)
    ends = [numbers.pop(name) for name in ("servo_min", "servo_max") if name in numbers]
    if turn and len(ends) == 2:  # a vehicle steers as far to either side
        yield "s_max of servo_min, servo_max and the servo's gain", min(abs((end - middle) / turn) for end in ends)
    gain, offset = (numbers.pop(f"speed_to_erpm_{name}", 0.0) for name in ("gain", "offset"))
    most, _ = (numbers.pop(name, 0.0) for name in ("speed_max", "speed_min"))
    if gain and most:
        yield "v_max of speed_max and the gain of the speed", abs((most - offset) / gain)
    if numbers.get("wheelbase") == _USUAL_WHEELBASE:
        yield f"the wheelbase of {numbers.pop('wheelbase'):g} m that every vesc.yaml has", _USUAL_WHEELBASE
    yield from numbers.items()


def _leaves(value: Any, depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield the last names and the values of a tree, as of ROS 2's parameters."""
    if isinstance(value, Mapping) and depth < 8:
        for key, each in value.items():
            if isinstance(each, Mapping):
                yield from _leaves(each, depth + 1)
            else:
                yield comment(str(key)).rpartition("/")[2], each


def _number(value: Any) -> float | None:
    """Return a number, of which YAML reads 1e-3 as text; None: it is none."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    try:
        return float(value)
    except OverflowError:  # a whole number of hundreds of digits
        return math.inf
    except ValueError:
        return None


def _require(path: Path, name: str, quantity: str, value: float) -> None:
    """Refuse a value that cannot be in its unit."""
    least, most, unit = _MUST.get(quantity, (-1e3, 1e5, "-"))
    if not least <= value <= most:
        degrees = unit.startswith("rad") and most < abs(value) <= math.degrees(most)
        said = ": degrees?" if degrees else ""
        raise SettingsError(f"{path}: {name} is {value:g}{said}; accepted: {least:g} to {most:g} {unit}")
