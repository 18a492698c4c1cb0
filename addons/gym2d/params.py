"""The car that `params` of f1tenth_gym describe, built: the vehicle's MJCF with these masses, lengths and limits.

Each parameter is built into the model, or named once in a warning as not there. Parameters within 1 % of the vehicle's
leave its MJCF as it is. C_Sf and C_Sr are those of linear tires, which the set `f1tenth_gym` has, and tires with a
peak have not.
"""

from __future__ import annotations

import math
import operator
import warnings
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

from fg_mujoco.addons.realcar.fitting import fit
from fg_mujoco.errors import FgMujocoError, SettingsError
from fg_mujoco.messages import MOST_WHOLE, require_whole, shown
from fg_mujoco.simulation.cars import WorldCar
from fg_mujoco.vehicle.car import car_parameters
from fg_mujoco.vehicle.changes import GREATEST_MU, CarChanges
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

F1TENTH = {
    "mu": 1.0489, "C_Sf": 4.718, "C_Sr": 5.4562, "lf": 0.15875, "lr": 0.17145, "h": 0.074, "m": 3.74, "I": 0.04712,
    "s_min": -0.4189, "s_max": 0.4189, "sv_min": -3.2, "sv_max": 3.2, "v_switch": 7.319, "a_max": 9.51, "v_min": -5.0,
    "v_max": 20.0, "width": 0.31, "length": 0.58,
}  # fmt: skip
"""The gym's default parameters."""

F1FIFTH = F1TENTH | {
    "mu": 1.1, "C_Sf": 5.3507, "C_Sr": 5.3507, "lf": 0.2725, "lr": 0.2585, "h": 0.1825, "m": 15.32, "I": 0.64332,
    "width": 0.55, "length": 0.8,
}  # fmt: skip
"""Those of its car at a fifth of the size."""

FULL_SCALE = F1TENTH | {
    "C_Sf": 20.89, "C_Sr": 20.89, "lf": 0.88392, "lr": 1.50876, "h": 0.557, "m": 1225.8878467253344,
    "I": 1538.8533713561394, "s_min": -0.91, "s_max": 0.91, "sv_min": -0.4, "sv_max": 0.4, "v_switch": 4.755,
    "a_max": 11.5, "v_min": -13.9, "v_max": 45.8, "width": 1.674, "length": 4.298,
}  # fmt: skip
"""Those of its full-scale car, without those of its multi-body model."""

_BODY = ("lf", "lr", "h", "m", "I", "width", "length")
_LIMITS = ("s_min", "s_max", "sv_min", "sv_max", "v_switch", "a_max", "v_min", "v_max")
_STIFFNESSES = ("C_Sf", "C_Sr")
_SAME = 0.01  # share by which a parameter may differ from that of the car
_FRONT = ("steering", "front_left_carrier", "front_right_carrier")  # bodies that go with the front axle
_SUSPENSIONS = ("front_left", "front_right", "rear_left", "rear_right")
_GROUND = 0.002  # [m] height of a centre of gravity near the ground, so that hardly any load moves
_LEAST_OFFSET = 1e-4  # [m] of the LiDAR ahead of the rear axle
_LARGEST = 5.0  # times as heavy as the vehicle may a car be that is built from it: its wheels and axles stay


def car_of(
    params: Mapping[str, Any] | None,
    vehicle: Vehicle,
    *,
    tires: Tires | None = None,
    lidar_dist: float | None = None,
) -> WorldCar:
    """Return the car of parameters by the gym's names; None, and those that are missing: as the vehicle has them.

    `lidar_dist` [m] is ahead of the rear axle, of a car on linear tires ahead of the centre of gravity.
    Raises SettingsError: a parameter that is no number, or a friction that no tire has.
    """
    numbers = {name: number(f"params[{name!r}]", value) for name, value in (params or {}).items()}
    mu = numbers.pop("mu", None)
    if mu is not None and not 0.0 < mu <= GREATEST_MU:
        raise SettingsError(f"params['mu'] is {mu!r}; accepted: above 0, up to {GREATEST_MU:g}")
    if lidar_dist is not None and not 0.0 <= lidar_dist <= 1.0:
        raise SettingsError(f"lidar_dist is {lidar_dist!r} m; accepted: 0 to 1 m ahead of what poses are of")
    own_tires = tires or vehicle.tires
    own = own_params(vehicle)
    if vehicle.name != DEFAULT_VEHICLE:  # what a script carries with it as the gym's default is the vehicle's own
        numbers = {name: value for name, value in numbers.items() if value != F1TENTH.get(name)}
        mu = None if mu == F1TENTH["mu"] else mu
    differ = {
        name: value
        for name, value in numbers.items()
        if name in own and not math.isclose(value, own[name], rel_tol=_SAME)
    }
    not_there = [name for name in numbers if name not in own and name not in _STIFFNESSES]
    stiffnesses = {name: numbers[name] for name in _STIFFNESSES if name in numbers}
    changes = CarChanges()
    if not own_tires.slides:
        tires, changes = _stiff(own_tires, stiffnesses), CarChanges(center_of_gravity_height=_GROUND)
        lidar_dist = (lidar_dist or 0.0) + numbers.get("lr", own["lr"])
        if "h" in differ:
            not_there.append("h (linear tires have no load that moves)")
    else:
        not_there += [f"{name} (tires='f1tenth_gym' has it)" for name in stiffnesses if _is_set(name, stiffnesses)]
    try:
        built = build_vehicle(vehicle, tuple(sorted(differ.items())), lidar_dist)
    except FgMujocoError as error:
        kept = tuple(sorted((name, value) for name, value in differ.items() if name in _LIMITS))
        not_there += [f"{', '.join(name for name in differ if name in _BODY)} ({error})"]
        built = build_vehicle(vehicle, kept, lidar_dist)
    if not_there:
        _say(not_there, vehicle.name)
    return WorldCar(vehicle=built, mu=mu, tires=tires, changes=changes)


def own_params(vehicle: Vehicle) -> dict[str, float]:
    """Return the parameters of a vehicle by the gym's names: all that can be built into it."""
    car = vehicle.parameters
    return {
        "lf": car.front_axle_distance, "lr": car.rear_axle_distance, "m": car.mass,
        "h": car.center_of_gravity_height, "I": car.yaw_inertia, "s_min": -car.max_steering_angle,
        "s_max": car.max_steering_angle, "sv_min": -car.max_steering_rate, "sv_max": car.max_steering_rate,
        "v_switch": car.power_limit_speed, "a_max": car.max_acceleration, "v_min": car.min_speed,
        "v_max": car.max_speed, "width": car.width, "length": car.length,
    }  # fmt: skip


def all_params(params: Mapping[str, Any] | None, vehicle: Vehicle) -> dict[str, Any]:
    """Return parameters with those that are missing as the vehicle has them, or, within 1 %, as the gym has them."""
    own = own_params(vehicle) | {"mu": vehicle.greatest_mu()}
    near = {name: F1TENTH[name] for name in own if math.isclose(own[name], F1TENTH[name], rel_tol=_SAME)}
    return F1TENTH | own | near | dict(params or {})


def physics_timestep(timestep: float, vehicle: Vehicle) -> float:
    """Return the physics' timestep [s]: the vehicle's own if it divides a step, else the next lower; SettingsError."""
    if not 1e-5 <= timestep <= 1.0:
        raise SettingsError(f"timestep is {timestep!r} s; accepted: 1e-05 to 1 s")
    own = float(vehicle.spec().option.timestep)
    steps = max(1, math.ceil(timestep / own - 1e-9))
    return own if math.isclose(steps * own, timestep, rel_tol=1e-9) else timestep / steps


def number(name: str, value: Any, least: float = -math.inf, most: float = math.inf) -> float:
    """Return a setting as a float; SettingsError: it is no finite number from `least` to `most`."""
    try:
        found = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if not (math.isfinite(found) and least <= found <= most):
        within = "" if math.isinf(least) else f" from {least:g} to {most:g}"
        raise SettingsError(f"{name} is {shown(value)}; accepted: a finite number{within}")
    return found


def whole(name: str, value: Any, least: int, most: int = MOST_WHOLE) -> int:
    """Return a setting as a whole number, of NumPy's, too; SettingsError: it is none from `least` to `most`."""
    try:
        found = value if isinstance(value, bool) else operator.index(value)
    except TypeError:
        found = value
    require_whole(name, found, least, most)
    return int(found)


def mapping(name: str, value: Any) -> dict[str, Any]:
    """Return a setting of settings by name; SettingsError: it is none."""
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise SettingsError(f"{name} is {shown(value)}; accepted: a dictionary of values by name")
    return dict(value)


def _is_set(name: str, values: Mapping[str, float]) -> bool:
    """Return whether a stiffness is none of the gym's own, which every script carries with it."""
    own = (F1TENTH[name], F1FIFTH[name], FULL_SCALE[name])
    return not any(math.isclose(values[name], each, rel_tol=_SAME) for each in own)


def _stiff(tires: Tires, stiffnesses: Mapping[str, float]) -> Tires:
    """Return linear tires with these cornering stiffnesses, C_Sf and C_Sr, of the lateral curves [1/rad]."""
    axles = {}
    for axle, name in zip(("front", "rear"), _STIFFNESSES, strict=True):
        found = getattr(tires, axle)
        stiffness = stiffnesses.get(name, found.lateral.stiffness)
        axles[axle] = replace(
            found, lateral=replace(found.lateral, stiffness=stiffness),
            longitudinal=replace(found.longitudinal, stiffness=stiffness),
        )  # fmt: skip
    return replace(tires, **axles)


@lru_cache(maxsize=32)
def build_vehicle(vehicle: Vehicle, differ: tuple[tuple[str, float], ...], lidar_dist: float | None) -> Vehicle:
    """Return a vehicle with some of `own_params` changed, and a place of the LiDAR [m]; SettingsError, ModelError."""
    if not differ and lidar_dist is None:
        return vehicle
    spec, own = vehicle.spec(), own_params(vehicle)
    params = own | dict(differ)
    changed = {name for name, _ in differ}
    _change_limits(spec, params, changed)
    if changed & {*_BODY, "s_min", "s_max"}:  # Ackermann's angles are fitted to the steering's limit
        _change_body(spec, params, own)
    if lidar_dist is not None:
        mount = spec.site("lidar_mount")
        mount.pos = (max(lidar_dist, _LEAST_OFFSET), *mount.pos[1:])
    made = replace(vehicle, text=spec.to_xml())
    _ = made.parameters  # reads the compiled model
    return made


def _change_body(spec: Any, params: Mapping[str, float], own: Mapping[str, float]) -> None:
    """Give a vehicle's spec masses and lengths, in place; the suspension is as much stiffer as the car is heavier."""
    heavier = params["m"] / own["m"]
    if not 1.0 / _LARGEST <= heavier <= _LARGEST:
        raise SettingsError(f"m is {params['m']:g} kg; accepted: {own['m']:g} kg by {_LARGEST:g} at most, up or down")
    for name in ("length", "width"):
        if not own[name] / _LARGEST <= params[name] <= _LARGEST * own[name]:
            raise SettingsError(f"{name} is {params[name]:g} m; accepted: {own[name]:g} m by {_LARGEST:g} at most")
    wheelbase = params["lf"] + params["lr"]
    if not 0.1 <= wheelbase <= 5.0 * (own["lf"] + own["lr"]):
        raise SettingsError(f"lf + lr is {wheelbase:g} m; accepted: 0.1 to {5.0 * (own['lf'] + own['lr']):.2g} m")
    for body in _FRONT:
        spec.body(body).pos = (wheelbase, *spec.body(body).pos[1:])
    for wheel in _SUSPENSIONS:
        joint = spec.joint(f"{wheel}_suspension")
        joint.stiffness, joint.damping = heavier * joint.stiffness, heavier * joint.damping
    chassis = spec.geom("chassis")
    chassis.size = (0.5 * params["length"], 0.5 * params["width"], chassis.size[2])
    chassis.pos = (params["lr"], *chassis.pos[1:])
    fit(spec, mass=params["m"], center_of_gravity=(params["lr"], params["h"]), yaw_inertia=params["I"])


def _change_limits(spec: Any, params: Mapping[str, float], changed: set[str]) -> None:
    """Give a vehicle's spec the limits of its servos, in place."""
    car = car_parameters(spec.compile())
    steering, drive = spec.actuator("steering"), spec.actuator("speed")
    if changed & {"s_min", "s_max"}:
        lock = max(-params["s_min"], params["s_max"])
        steering.ctrlrange = (-lock, lock)
    if changed & {"sv_min", "sv_max"}:
        damping = steering.forcerange[1] / car.max_steering_rate
        steering.forcerange = (damping * params["sv_min"], damping * params["sv_max"])
    if "a_max" in changed:
        stronger = params["a_max"] / car.max_acceleration
        drive.forcerange = [stronger * value for value in drive.forcerange]
    if changed & {"v_min", "v_max"}:
        drive.ctrlrange = (params["v_min"], params["v_max"])
    if "v_switch" in changed:
        spec.numeric("power_limit_speed").data = [params["v_switch"]]


def _say(names: list[str], vehicle: str) -> None:
    """Warn of parameters that the car does not have; Python shows each such warning once."""
    warnings.warn(f"params: not in this car, {vehicle}: {', '.join(names)}; all others are", stacklevel=2)
