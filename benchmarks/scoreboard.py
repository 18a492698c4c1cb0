"""A scoreboard of models on recorded drives: every bundled set of tires, f1tenth_gym's model, and ForzaETH's.

    python benchmarks/scoreboard.py DRIVE ... [--mu 0.66] [--vehicle f1tenth] [--columns FILE.toml] [--threads N]

Each set of tires is driven on the vehicle that it was measured on, as `fg-mujoco validate` drives one. Then come

- `f1tenth_gym`: CommonRoad's single-track model with linear axles and load transfer, as `single_track` has it,
  with the gym's stiffnesses and friction. Speed and steering are commanded through the gym's controller: a P controller
  of the speed, and a steering that turns at its greatest rate. Below 0.5 m/s it is kinematic.
- ForzaETH's: the single-track model with Magic Formula axles that On-Track-SysID identifies (arXiv 2411.17508), with
  the same controller. Its tires are those of models/tires, as published: past its peak a curve may fall through zero.

Where a speed is to be held, a P controller with the recorded acceleration holds it, within the motor's. Recorded
commands that are accelerations are those of the models, without the controller of the speed.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from common import table
from numpy.typing import NDArray

from fg_mujoco.addons.realcar.single_track import (
    FRONT_STIFFNESS,
    REAR_STIFFNESS,
    axle_loads,
    friction_used,
    linear_rates,
)
from fg_mujoco.addons.realcar.validation.car_model import BEFORE, SIGNALS, CarModel, Task
from fg_mujoco.addons.realcar.validation.validation import (
    COMMANDS,
    HELD,
    STEADY,
    DriveModel,
    Validation,
    read,
    validate_model,
)
from fg_mujoco.addons.realcar.validation.windows import ACCELERATE, HOLD_SPEED, PERIOD
from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import CarParameters, FloatArray
from fg_mujoco.vehicle.command_response import CommandResponse
from fg_mujoco.vehicle.tires import Tires, tire_names
from fg_mujoco.vehicle.tires.magic_formula import MagicFormula
from fg_mujoco.vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

GYM_MU = 1.0489
"""[-] f1tenth_gym's friction: `mu` of its default parameters."""

_STEPS = 10  # of Euler's method a period: 1 ms
_KINEMATIC = 0.5  # [m/s] f1tenth_gym
_GAIN = 10.0  # [1/s] by which a speed is held

_COLUMNS: tuple[tuple[str, str, str, float], ...] = (
    ("yaw rate, steady [%]", "yaw rate", STEADY, 0.0),
    ("slip angle, steady [rad]", "slip angle", STEADY, 0.0),
    ("yaw rate, 1 s [%]", "yaw rate", HELD, 1.0),
    ("yaw rate, 5 s [%]", "yaw rate", HELD, 5.0),
    ("lateral acceleration, 1 s [%]", "lateral acceleration", HELD, 1.0),
    ("position, 1 s [m]", "position", HELD, 1.0),
    ("yaw rate, commands, 1 s [%]", "yaw rate", COMMANDS, 1.0),
    ("speed, commands, 1 s [%]", "speed", COMMANDS, 1.0),
)
_FORZAETH = "nuc2"  # the vehicle whose constants are those of ForzaETH's car NUC2
_MEASURED_ON = {"ipz": "ipz", "forzaeth": _FORZAETH, "f1tenth": "f1tenth"}
"""First part of the name of a set of tires -> vehicle that it was measured on, or was made for."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PlanarModel:
    """A single-track model: of f1tenth_gym without tires, of ForzaETH with a set of Magic Formula axles.

    Raises:
      SettingsError: on making it, tires of another law.
    """

    name: str
    vehicle: Vehicle
    tires: Tires | None = None
    mu: float | None = None  # [-] None: GYM_MU, or as in the file of the tires

    def __post_init__(self) -> None:
        if self.tires is not None and not all(isinstance(axle.lateral, MagicFormula) for axle in self.tires.axles):
            raise SettingsError(f"{self.name}: tires are {self.tires.name!r}; accepted: a set of Magic Formula axles")

    @property
    def car(self) -> CarParameters:
        """The car's constants."""
        return self.vehicle.parameters

    @property
    def response(self) -> CommandResponse:
        """How it answers commands: it does what it is sent, at once, within the greatest rates."""
        return CommandResponse()

    @property
    def friction(self) -> float:
        """The friction [-]; of Magic Formula axles the greatest peak."""
        if self.mu is not None:
            return self.mu
        peak = None if self.tires is None else self.tires.peak
        return GYM_MU if peak is None else peak

    def simulate(self, task: Task, watch: Callable[[int, int], None] | None = None) -> FloatArray:
        """Return SIGNALS at the start and after each period, NaN after the end. Shape (n, k + 1, 6)."""
        periods, car = task.steering.shape[1] - BEFORE, self.car
        found = np.full((len(task.starts), periods + 1, len(SIGNALS)), np.nan)
        tires = np.zeros((2, 4))
        if self.tires is not None:
            share = self.friction / (self.tires.peak or 1.0)
            for place, axle in enumerate(self.tires.axles):
                law = axle.lateral
                assert isinstance(law, MagicFormula)
                tires[place] = share * law.slope, law.C, share * law.D, law.E
        constants = np.array(
            (
                car.front_axle_distance, car.rear_axle_distance, car.center_of_gravity_height, car.mass,
                car.yaw_inertia, car.gravity, car.max_steering_angle, car.max_steering_rate, car.max_acceleration,
                car.max_speed, car.min_speed, car.power_limit_speed,
            )
        )  # fmt: skip
        _drive(
            self.tires is None, self.friction, tires, constants, task.starts, task.counts.astype(np.int64),
            np.ascontiguousarray(task.steering[:, BEFORE:]), np.ascontiguousarray(task.drive[:, BEFORE:]),
            task.kinds, found,
        )  # fmt: skip
        return found


@kernel
def _drive(
    linear: bool, mu: float, tires: FloatArray, car: FloatArray, starts: FloatArray, counts: FloatArray,
    steering: FloatArray, drives: FloatArray, kinds: NDArray[np.int64], out: FloatArray,
) -> None:  # fmt: skip
    """Simulate each start by Euler's method; arguments as in Task, `out` as `simulate` returns it."""
    front, rear, height, mass, inertia, gravity, lock, turning, most, fastest, slowest, switch = car
    dt = PERIOD / _STEPS
    for number in range(len(starts)):
        heading, along, yaw_rate, angle = starts[number, 2], starts[number, 3], starts[number, 5], starts[number, 6]
        across = starts[number, 4] + rear * yaw_rate  # from here on of the centre of gravity
        x = starts[number, 0] + rear * math.cos(heading)
        y = starts[number, 1] + rear * math.sin(heading)
        for period in range(counts[number] + 1):
            out[number, period, 0] = x - rear * math.cos(heading)
            out[number, period, 1] = y - rear * math.sin(heading)
            out[number, period, 2], out[number, period, 3] = heading, along
            out[number, period, 4], out[number, period, 5] = across - rear * yaw_rate, yaw_rate
            if period == counts[number]:
                break
            wanted = drives[number, period]
            after = drives[number, min(period + 1, drives.shape[1] - 1)]
            for _ in range(_STEPS):
                target = min(max(steering[number, period], -lock), lock)
                angle += min(max(target - angle, -turning * dt), turning * dt)
                power = most * min(1.0, switch / max(along, switch))
                if kinds[number] == ACCELERATE:
                    acceleration = wanted
                elif kinds[number] == HOLD_SPEED:
                    acceleration = (after - wanted) / PERIOD + _GAIN * (wanted - along)
                else:
                    command = min(max(wanted, slowest), fastest)
                    forward_gain = 10.0 if along > 0.0 else 2.0
                    limit = fastest if command > along else max(-slowest, 0.1)
                    acceleration = forward_gain * most / limit * (command - along)
                acceleration = min(max(acceleration, -most), power)
                rate_across = rate_turning = 0.0
                if abs(along) < _KINEMATIC:
                    yaw_rate = along / (front + rear) * math.tan(angle)
                    across = rear * yaw_rate
                    along += dt * acceleration
                elif linear:
                    speed, slip = math.hypot(along, across), math.atan2(across, along)
                    rate_turning, rate_slip = linear_rates(
                        yaw_rate, slip, angle, speed, acceleration, mu, FRONT_STIFFNESS, REAR_STIFFNESS, front, rear,
                        height, mass, inertia, gravity,
                    )  # fmt: skip
                    # of CommonRoad's states the slip angle turns, and the speed along the velocity follows
                    rate_across = along * rate_slip + math.sin(slip) * acceleration
                    along += dt * (math.cos(slip) * acceleration - across * rate_slip)
                else:
                    load_front, load_rear = axle_loads(acceleration, front, rear, height, mass, gravity)
                    slip_front = angle - math.atan2(across + front * yaw_rate, along)
                    slip_rear = -math.atan2(across - rear * yaw_rate, along)
                    tire = tires[0]
                    force_front = load_front * friction_used(slip_front, tire[0], tire[1], tire[2], tire[3])
                    tire = tires[1]
                    force_rear = load_rear * friction_used(slip_rear, tire[0], tire[1], tire[2], tire[3])
                    rate_across = (force_front * math.cos(angle) + force_rear) / mass - along * yaw_rate
                    rate_turning = (front * force_front * math.cos(angle) - rear * force_rear) / inertia
                    drag = force_front * math.sin(angle) / mass
                    along += dt * (acceleration - drag + across * yaw_rate)
                across += dt * rate_across
                yaw_rate += dt * rate_turning
                heading += dt * yaw_rate
                x += dt * (along * math.cos(heading) - across * math.sin(heading))
                y += dt * (along * math.sin(heading) + across * math.cos(heading))


def models_of(vehicle: Vehicle, *, mu: float | None = None, threads: int = 1) -> list[DriveModel]:
    """Return the models of a scoreboard: each bundled set of tires on its vehicle, f1tenth_gym, and ForzaETH's.

    Sets that were measured on none of the bundled vehicles stand on `vehicle`, whose own set is among them.
    """
    sets = {name: Tires.load(name) for name in tire_names()}
    models: list[DriveModel] = []
    for name, tires in (sets | {vehicle.tires.name: vehicle.tires}).items():
        if not tires.is_contact:  # whose sliding is right at ten times as many steps only
            own = None if name == vehicle.tires.name else _MEASURED_ON.get(name.partition("_")[0])
            car = vehicle if own is None else Vehicle.load(own)
            models.append(CarModel(vehicle=car, tires=tires, mu=mu, threads=threads))
    models.append(PlanarModel(name="f1tenth_gym's model", vehicle=Vehicle.load(DEFAULT_VEHICLE), mu=mu))
    forzaeth = Vehicle.load(_FORZAETH)
    for name in tire_names():
        if name.startswith("forzaeth_"):
            own = name.removeprefix("forzaeth_").upper()
            models.append(PlanarModel(name=f"ForzaETH's model, {own}", vehicle=forzaeth, tires=Tires.load(name), mu=mu))
    return models


def rows_of(validations: Sequence[Validation]) -> list[list[object]]:
    """Return a row for each model, the one with the least error of the yaw rate over steady states first."""
    rows = []
    for each in validations:
        cells: list[object] = [each.model, f"{each.friction:.3f}"]
        for name, signal, how, length in _COLUMNS:
            found = each.agreement(signal, how, length)
            percent = name.endswith("[%]")
            cells.append("" if found is None else f"{100.0 * found.share:.1f}" if percent else f"{found.rms:.3f}")
        recorded, model = each.plateau
        cells.append(f"{100.0 * (model / recorded - 1.0):+.1f}" if recorded == recorded else "")
        cells.append(sum(state.spun for state in each.steady))
        rows.append(cells)
    return sorted(rows, key=lambda row: float(str(row[2] or row[4])))


def main() -> None:
    """Print the scoreboard."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drives", nargs="+", help="as `fg-mujoco validate` takes them")
    parser.add_argument("--mu", type=float, help="friction of all models; default: each its own")
    parser.add_argument("--vehicle", default=DEFAULT_VEHICLE, help="of sets that were measured on no bundled vehicle")
    parser.add_argument("--columns", help="of CSV files")
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    vehicle = Vehicle.load(options.vehicle)
    drives = read(options.drives, columns=options.columns, vehicle=vehicle)
    models = models_of(vehicle, mu=options.mu, threads=options.threads)
    rows = rows_of([validate_model(model, drives) for model in models])
    print(table(("model", "friction [-]", *(name for name, *_ in _COLUMNS), "plateau [%]", "states spun"), rows))


if __name__ == "__main__":
    main()
