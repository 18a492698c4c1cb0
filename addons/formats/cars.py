"""A car of the files that teams have: a bundled vehicle with what they tell built in, and tires.

What is not given is the vehicle f1tenth's. Tires that are told as a Magic Formula are one; cornering stiffnesses with a
friction are the brush model, which has both and lets go. Without them the tires are the default set at the mu.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from fg_mujoco.addons.gym2d.params import F1TENTH, build_vehicle, own_params
from fg_mujoco.course.documents import comment, toml_text, xml_comment
from fg_mujoco.course.files import state_of
from fg_mujoco.course.writing import staged_folder, write_file
from fg_mujoco.errors import FgMujocoError, Note, SettingsError
from fg_mujoco.pictures.pages.page import note, scroll, write_page
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.vehicle.changes import set_mu
from fg_mujoco.vehicle.tires import DEFAULT_TIRES, Tires
from fg_mujoco.vehicle.tires.law import GREATEST_SLIP
from fg_mujoco.vehicle.vehicle import DEFAULT_VEHICLE, Vehicle, vehicle_names
from fg_mujoco.vehicle.vehicle_mjcf import parsed

from .car_files import CarFiles, Told, files_of, is_car, read_car

ENDINGS = (".xml", ".toml", ".html")
"""Of the files that `write_car` writes."""

_UNITS = {
    "lf": "m", "lr": "m", "m": "kg", "h": "m", "I": "kg m^2", "s_min": "rad", "s_max": "rad", "sv_min": "rad/s",
    "sv_max": "rad/s", "v_switch": "m/s", "a_max": "m/s^2", "v_min": "m/s", "v_max": "m/s", "width": "m", "length": "m",
    "track_width": "m", "wheel_radius": "m",
}  # fmt: skip
_WORDS = {
    "lf": "front axle ahead of the centre of gravity", "lr": "rear axle behind it", "m": "mass",
    "h": "height of the centre of gravity", "I": "yaw inertia", "s_max": "greatest steering angle",
    "sv_max": "greatest steering rate", "v_switch": "speed above which the motor's power limits",
    "a_max": "greatest acceleration", "v_min": "fastest backwards", "v_max": "greatest speed", "width": "width",
    "length": "length", "track_width": "track width", "wheel_radius": "wheel radius",
}  # fmt: skip
_KEPT = ("track_width", "wheel_radius")  # what is not built, but the vehicle's
_SHOWN = 40  # names of what is not used
_SAME = 0.01  # share within which a value is the vehicle's
_LEAST_C, _OF_D = 0.5, 0.9  # of a Magic Formula with a peak, as `MagicFormula` takes it
_MOST_OF_LOAD = 0.3  # share by which friction may fall at the car's load
_RELAXATION, _SLIDING = 0.045, 0.7  # as in models/tires/forzaeth_nuc2.toml, which says from where


@dataclass(frozen=True, kw_only=True)
class FileCar:
    """A car of files."""

    vehicle: Vehicle
    files: CarFiles
    tires: str  # the TOML of its tires; nothing: the default set
    words: tuple[str, ...]  # what was told and what was taken instead, a line each


def load_car(source: Path) -> Vehicle:
    """Return the vehicle of a file or folder that tells of a car; a `Note` says what is missing; errors of `car_of`."""
    car = car_of([source])
    taken = ", ".join(line.partition(":")[0] for line in car.words if ": not given" in line)
    unused = [line for line in car.words if "not used" in line]
    said = [f"{source}: told are {', '.join(car.files.values)}", f"not given, so taken: {taken or 'nothing'}", *unused]
    warnings.warn("; ".join(said), Note, stacklevel=4)
    return car.vehicle


def car_of(sources: Sequence[Path]) -> FileCar:
    """Return the car of files and folders, of which the first that tells a value has it; errors as `read_car`."""
    for source in sources:
        if not is_car(source):
            accepted = ".yaml, .json, .txt, .ini, .urdf, or a folder"
            raise SettingsError(f"{source}: no such file of a car; accepted: {accepted}")
    states = tuple(state_of(file) for source in sources for file in files_of(source))
    return _car_of(tuple(sources), states)


@lru_cache(maxsize=16)
def _car_of(sources: tuple[Path, ...], states: tuple[str, ...]) -> FileCar:
    files = read_car(sources)
    base = Vehicle.load(DEFAULT_VEHICLE)
    own = own_params(base) | {
        "track_width": base.parameters.track_width, "wheel_radius": base.parameters.wheel_radius
    }  # fmt: skip
    values = dict(files.values)
    words = [*_lengths(values, own)]
    if "length" in values:
        wheelbase = sum(values[name].value if name in values else own[name] for name in ("lf", "lr"))
        if values["length"].value <= wheelbase:  # of a model of points
            short = values.pop("length")
            said = f"is not used: the axles are {wheelbase:.3g} m apart"
            words.append(f"{short.name} {short.value:g} of {short.file} {said}")
    for side in ("s", "sv"):
        if f"{side}_max" in values and f"{side}_min" not in values:
            values[f"{side}_min"] = replace(values[f"{side}_max"], value=-values[f"{side}_max"].value)
    differ = {
        name: told.value
        for name, told in values.items()
        if name in own and name not in (*_KEPT, "width") and not math.isclose(told.value, own[name], rel_tol=_SAME)
    }
    where = ", ".join(dict.fromkeys(told.file for told in files.values.values()))
    tires, mu, tire_words = _tires(files, values["m"].value if "m" in values else own["m"])
    try:
        built = build_vehicle(base, tuple(sorted(differ.items())), None)
        spec = built.spec()
        spec.modelname = files.name
        if "width" in values:  # of the outline alone: masses are where the vehicle's wheels are
            chassis = spec.geom("chassis")
            chassis.size = (chassis.size[0], 0.5 * values["width"].value, chassis.size[2])
        if mu is not None:
            set_mu(spec, mu)
        found = Tires.load({"name": files.name, **tires}) if tires else base.tires
        vehicle = replace(built, name=files.name, file=str(sources[0]), text=spec.to_xml(), tires=found)
        _ = vehicle.parameters
    except FgMujocoError as error:
        raise SettingsError(f"{where}: no such car can be built: {error}") from error
    for name, value in own.items():
        if name in ("s_min", "sv_min"):
            continue
        told, said = values.get(name), f"{_WORDS.get(name, name)} {{:.4g}} {_UNITS[name]}"
        if told is None:
            words.append(f"{said.format(value)}: not given, {DEFAULT_VEHICLE}'s")
        elif name in _KEPT and not math.isclose(told.value, value, rel_tol=_SAME):
            other = f"{told.name} {told.value:g} of {told.file}"
            words.append(f"{said.format(value)}: {other} is not used, {DEFAULT_VEHICLE}'s is")
        else:
            words.append(f"{said.format(told.value)}: {told.name} of {told.file}")
    words += [*tire_words, *files.notes]
    if files.unused:
        others = f" and {len(files.unused) - _SHOWN} others" if len(files.unused) > _SHOWN else ""
        words.append(f"not used: {', '.join(files.unused[:_SHOWN])}{others}")
    return FileCar(vehicle=vehicle, files=files, tires=_toml(files, tires, tire_words), words=tuple(words))


def _lengths(values: dict[str, Told], own: dict[str, float]) -> Iterator[str]:
    """Share a wheelbase between the axles as the vehicle does, in place; yield words."""
    known = [name for name in ("lf", "lr") if name in values]
    wheelbase = values.pop("wheelbase", None)
    if wheelbase is not None and len(known) < 2:
        if known:
            (one,), other = known, "lr" if known[0] == "lf" else "lf"
            shared = {other: wheelbase.value - values[one].value}
        else:
            shared = {name: wheelbase.value * own[name] / (own["lf"] + own["lr"]) for name in ("lf", "lr")}
            yield f"centre of gravity between the axles: not given, shared as {DEFAULT_VEHICLE}'s"
        values |= {name: replace(wheelbase, value=value) for name, value in shared.items()}


def _tires(files: CarFiles, mass: float) -> tuple[dict[str, Any], float | None, list[str]]:
    """Return the table of the tires, the friction of the vehicle, and words; no table: the default set."""
    told = {name: each.value for name, each in files.values.items()}
    mu = told.get("mu")
    source = ", ".join(dict.fromkeys(files.values[name].file for name in ("Bf", "C_Sf", "mu") if name in told))
    common = {
        "relaxation_length": told.get("relaxation", _RELAXATION), "load_sensitivity": told.get("k_mu", 0.0),
        "nominal_load": 0.25 * mass * 9.81, "rolling_resistance": told.get("rolling", 0.0),
    }  # fmt: skip
    taken = [
        f"{name} of the tires {common[name.replace(' ', '_')]:g}: not given, as in nuc2's"
        for name, quantity in (("relaxation length", "relaxation"), ("rolling resistance", "rolling"))
        if quantity not in told
    ]
    words: list[str] = []
    formula = [f"{letter}{axle}" for axle in "fr" for letter in "BCD"]
    if told.keys().isdisjoint(["Bf", "Br", "Df", "Dr"]):  # C alone is a stiffness, in one unit or another
        words += [f"{files.values[name].name} {told[name]:g} is not used: B and D are not given" for name in formula
                  if name in told]  # fmt: skip
    elif missing := [name for name in formula if name not in told]:
        said = ", ".join(missing)
        raise SettingsError(f"{source}: the Magic Formulas lack {said}; accepted: all of them, E or none")
    else:
        formulas = {  # B has a sign where slip angles have the other one
            k: (abs(told[f"B{k}"]), told[f"C{k}"], told[f"D{k}"] * (mu or 1.0), told.get(f"E{k}", 0.0)) for k in "fr"
        }
        words.append(f"Magic Formulas of {source}" + ("" if mu in (None, 1.0) else f", their D times mu {mu:g}"))
        peaks = {k: _greatest(*formulas[k]) for k in "fr"}
        if flat := [k for k in "fr" if not peaks[k] > 0.0]:
            named = zip("BCDE", formulas[flat[0]], strict=True)
            said = f"a Magic Formula of {', '.join(f'{letter} {value:g}' for letter, value in named)} has no force"
            raise SettingsError(f"{source}: {said}; accepted: one with a peak above 0")
        if all(C >= _LEAST_C and peaks[k] >= _OF_D * D for k, (_, C, D, _) in formulas.items()):
            model = "magic_formula"
            curves = {k: dict(zip("BCDE", formulas[k], strict=True)) | {"sliding_share": _SLIDING} for k in "fr"}
            words += [*taken, f"force behind the peak, at least {_SLIDING:g} of it: not given"]
        else:  # as some that were fitted to drives that never slid
            model = "brush"
            curves = {k: {"stiffness": B * C * D / peaks[k], "D": peaks[k]} for k, (B, C, D, _) in formulas.items()}
            words += ["brush tires of their slopes and greatest forces, because they have no peak", *taken]
        words.append("force along the wheels as across them: not given")
        axles = {axle: curves[axle[0]] | common for axle in ("front", "rear")}
        words += _heed_loads(told, axles)
        return {"model": model, "floor": f"not given by {source}", **axles}, None, words
    stiffness = {name: told.get(name, math.nan) for name in ("C_Sf", "C_Sr")}
    if not any(math.isnan(value) for value in stiffness.values()):
        if all(math.isclose(value, F1TENTH[name], rel_tol=_SAME) for name, value in stiffness.items()):
            words.append("C_Sf and C_Sr are f1tenth_gym's defaults, which every file has, and not used")
        elif mu is not None:
            axles = {
                axle: {"stiffness": stiffness[name], "D": mu} | common
                for axle, name in (("front", "C_Sf"), ("rear", "C_Sr"))
            }
            words += [f"brush tires of C_Sf, C_Sr and mu of {source}; past mu they slide, which linear tires do not"]
            words += taken
            return {"model": "brush", "floor": f"not given by {source}", **axles}, None, words
        else:
            words.append("C_Sf and C_Sr are not used: mu is not given")
    own = Vehicle.load(DEFAULT_VEHICLE).greatest_mu()
    words.append(
        f"{DEFAULT_TIRES}'s tires at mu {own:.5g}: not given, {DEFAULT_VEHICLE}'s"
        if mu is None
        else f"{DEFAULT_TIRES}'s tires at mu {mu:g}: {files.values['mu'].name} of {files.values['mu'].file}"
    )
    return {}, mu, words


def _heed_loads(told: Mapping[str, float], axles: Mapping[str, dict[str, Any]]) -> Iterator[str]:
    """Give tires, in place, TUM's friction at the car's load, D (1 + eps F_z / f_z0), and its fall; return words."""
    for axle, curve in axles.items():
        eps, nominal = told.get(f"eps{axle[0]}", 0.0), told.get("f_z0", math.nan)
        share = eps * curve["nominal_load"] / nominal if eps else 0.0
        if not -_MOST_OF_LOAD <= share <= 0.0:
            said = f"eps_{axle} {eps:g} with f_z0 {nominal:g} N changes the friction by {100.0 * share:.3g} %"
            raise SettingsError(f"{said} at the car's load; accepted: -{100.0 * _MOST_OF_LOAD:g} to 0 %")
        if share:
            curve |= {"D": curve["D"] * (1.0 + share), "load_sensitivity": -share / (1.0 + share)}
            yield f"D of the {axle} tires times {1.0 + share:.3g}, and its fall with the load: eps_{axle} and f_z0"


def _greatest(B: float, C: float, D: float, E: float) -> float:  # noqa: N803 - as the formula has them
    """Return the greatest force over the load of a Magic Formula [-]."""
    slips = [B * GREATEST_SLIP * k / 200 for k in range(1, 201)]
    return max(abs(D * math.sin(C * math.atan(slip - E * (slip - math.atan(slip))))) for slip in slips)


def _toml(files: CarFiles, tires: dict[str, Any], words: Sequence[str]) -> str:
    """Return a table of tires as TOML, with the words above."""
    if not tires:
        return ""
    heading = [f"Tires of {files.name}, made by fg-mujoco car.", *words]
    lines = [f"# {comment(line)}" for line in heading]
    lines.append(toml_text({name: tires[name] for name in ("model", "floor")}))
    lines += [f"[{axle}]\n{toml_text(tires[axle])}" for axle in ("front", "rear")]
    return "\n".join(lines)


def write_car(car: FileCar, folder: Path) -> list[Path]:
    """Write MJCF, tires and page of a car into a folder, and return their paths; OSError.

    Raises ModelError: it cannot drive.
    """
    name, spec = car.files.name, parsed(car.vehicle.text, f"vehicle {car.files.name!r}")
    if car.tires:
        element = spec.text("tires") or spec.add_text(name="tires")
        element.data = f"{name}.toml"
    head, _, rest = spec.to_xml().partition("\n")
    sources = sorted({told.file for told in car.files.values.values()})
    xml, toml, html = (f"{name}{ending}" for ending in ENDINGS)
    folder.mkdir(parents=True, exist_ok=True)
    with staged_folder(folder, last=xml) as aside:
        write_file(aside / xml, f"{head}\n  <!--{xml_comment(car.words)}-->\n{rest}".encode())
        if car.tires:
            write_file(aside / toml, car.tires.encode())
        written = Vehicle.load(aside / xml)
        write_page(aside / html, f"{name}: a car of {', '.join(sources)}", _page(car, written))
    return [folder / each for each in ((xml, toml, html) if car.tires else (xml, html))]


def _page(car: FileCar, vehicle: Vehicle) -> list[object]:
    """Return the body of the page: the car beside the bundled ones, and what was told and taken."""
    cars = [vehicle, *map(Vehicle.load, vehicle_names())]
    columns = [own_params(each) | {
        "track_width": each.parameters.track_width, "wheel_radius": each.parameters.wheel_radius
    } for each in cars]  # fmt: skip
    rows = [[_WORDS[name], _UNITS[name], *(column[name] for column in columns)] for name in _WORDS]
    rows += [
        ["tires", "", *(each.tires.model for each in cars)],
        ["friction to rely on", "-", *(each.nominal_mu for each in cars)],
        ["front peak at a slip angle", "rad", *(each.tires.axles[0].lateral.peak_slip for each in cars)],
        ["rear peak at a slip angle", "rad", *(each.tires.axles[1].lateral.peak_slip for each in cars)],
    ]
    table = Table(header=["", "unit", *(each.name for each in cars)], rows=rows, left=("", "unit"))
    return [scroll(table.html(), "whole"), *(note(line) for line in car.words)]
