"""Writes identified tires as a TOML file of tires, each value with its unit, its 95 % interval and its source."""

from __future__ import annotations

import math
from pathlib import Path

from fg_mujoco.course.documents import comment
from fg_mujoco.course.writing import write_file
from fg_mujoco.errors import SettingsError

from .identification import Axle, Estimate, Identification

_SEEN_BEHIND = 2.0  # times the slip of the peak, that a drive must exceed to say how the force falls behind it
_RELAXATION_LENGTH = 0.045  # [m] SlipX, docs/reference/tyre-model.md, provisional


def tire_text(found: Identification) -> str:
    """Return identified tires as TOML, in the format of models/tires/."""
    car = found.drives[0].car
    sources = [f"{drive.name} (sha256 {drive.sha256[:12]})" for drive in found.drives]
    source = comment(sources[0] if len(sources) == 1 else "the drives above")
    steering = (
        ("gain", found.steering_gain, ""), ("offset", found.steering_offset, " rad"),
        ("lag, first order", found.steering_lag, " s"), ("delay", found.steering_delay, " s"),
    )  # fmt: skip
    relative = 100.0 * found.validation.yaw_rate_relative
    heading = [
        f"Tires of {found.drives[0].vehicle}, identified by fg-mujoco identify; see docs/addons/realcar/.",
        *(f"Drive: {text}" for text in sources),
        f"Car: {car.mass:.4g} kg, {car.yaw_inertia:.4g} kg m^2 about its vertical axis; centre of gravity "
        f"{car.front_axle_distance:.4g} m behind the front axle, {car.rear_axle_distance:.4g} m ahead of the rear one, "
        f"{car.center_of_gravity_height:.4g} m over the ground.",
        f"Yaw rate on held-out data: within {relative:.3g} % rms, over {found.validation.seconds:.3g} s.",
        *(f"Steering, {name}: {estimate}{unit}" for name, estimate, unit in steering),
        "In brackets: the unit, then 95 % intervals, from the spread between segments and the model's errors.",
        *(f"Not determined by the drives, usual values: {name}: {why}" for name, why in found.untold.items()),
        *([f"Partial: {found.fit.stopped}"] if found.fit.stopped else []),
    ]
    lines = [f"# {comment(line)}" for line in heading]
    lines += [f'model = "{"linear" if found.linear else "magic_formula"}"', ""]
    load = 0.25 * car.mass * car.gravity
    for name, axle in found.axles:
        lines += [f"[{name}]", *(_linear(axle, source) if found.linear else _formula(axle, source))]
        lines += [
            _relaxation(found.relaxation_length, source),
            "load_sensitivity = 0.0  # [-] not identified: the model has none",
            f"nominal_load = {load:.4g}  # [N] a tire of this car at rest; without effect",
            *_rolling(found, source),
            "",
        ]
    return "\n".join(lines)


def check_tire_file(path: Path) -> None:
    """Make sure that the name of a file is one of tires; SettingsError: another suffix."""
    if path.suffix.lower() != ".toml":
        raise SettingsError(f"{path}: is no name for a file of tires; accepted: one that ends in .toml, or a folder's")


def write_tires(found: Identification, path: str | Path) -> Path:
    """Write identified tires as a TOML file, in place of one that exists, and return its path; or SettingsError."""
    path = Path(path)
    check_tire_file(path)
    try:
        write_file(path, tire_text(found).encode())
    except OSError as error:
        reason = error.strerror or str(error)
        raise SettingsError(f"{path}: cannot be written: {reason}; accepted: a file that can be") from error
    return path


def _formula(axle: Axle, source: str) -> list[str]:
    values = (("B", axle.B, "1/rad"), ("C", axle.C, "-"), ("D", axle.D, "-"), ("E", axle.E, "-"))
    heading = (
        f"# B C D = {axle.stiffness} per rad; peak {axle.peak} at {axle.peak_slip:.3g} rad; slip angles reached "
        f"{axle.reached:.3g} rad"
    )
    return [
        heading,
        *(f"{name} = {value.value:.6g}  # [{unit}] {_half(value)}; {source}" for name, value, unit in values),
        *_behind(axle),
    ]


def _behind(axle: Axle) -> list[str]:
    """Return the line that keeps the force of a peak behind it, where the drives say nothing of its fall."""
    if axle.reached > _SEEN_BEHIND * axle.peak_slip:
        return []
    return ["sliding_share = 1.0  # [-] no fall behind the peak: the drives reach less than twice its slip angle"]


def _linear(axle: Axle, source: str) -> list[str]:
    stiffness = axle.stiffness
    return [
        f"stiffness = {stiffness.value:.6g}  # [1/rad] {_half(stiffness)}; {source}",
        "D = 1.0  # [-] not identified: a linear tire has no peak",
    ]


def _relaxation(found: Estimate, source: str) -> str:
    if math.isfinite(found.half) and found.value > found.half:
        return f"relaxation_length = {found.value:.6g}  # [m] {_half(found)}, of both axles; {source}"
    if math.isinf(found.half):  # the steering's lag was found with it
        return f"relaxation_length = {found.value:.6g}  # [m] at the bound of the search, of both axles; {source}"
    what = "not identified: SlipX, docs/reference/tyre-model.md, provisional"
    return f"relaxation_length = {_RELAXATION_LENGTH}  # [m] {what}"


def _rolling(found: Identification, source: str) -> list[str]:
    if isinstance(found.speed, str):
        return []
    value, half = found.speed.rolling
    if not value > half:  # no more than 0 is told
        return []
    return [f"rolling_resistance = {value:.4g}  # [-] +- {half:.2g}; {source}"]


def _half(estimate: Estimate) -> str:
    return f"+- {estimate.half:.2g}" if math.isfinite(estimate.half) else "at the bound of the search"
