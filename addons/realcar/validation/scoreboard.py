"""The scoreboard: every bundled set of tires, and the models of other simulators, on the same drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fg_mujoco.display import brief
from fg_mujoco.messages import CarParameters
from fg_mujoco.pictures.pages.table import Table
from fg_mujoco.vehicle.command_response import CommandResponse
from fg_mujoco.vehicle.tires import Tires, tire_names
from fg_mujoco.vehicle.vehicle import DEFAULT_VEHICLE, Vehicle

from ..drives.drive_recording import RecordedDrive
from .car_model import CarModel
from .planar_models import PlanarModel
from .validation import COMMANDS, HELD, STEADY, DriveModel, Validation, motions_of, read, validate_model
from .windows import DriveMotion

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
class Scoreboard:
    """Validations of several models on the same drives."""

    validations: tuple[Validation, ...]

    def __repr__(self) -> str:
        return brief(self, f"{len(self.validations)} models", f"{len(self.validations[0].drives)} drives")

    @property
    def rows(self) -> list[dict[str, Any]]:
        """All agreements of all models as records."""
        return [row for each in self.validations for row in each.rows]

    @property
    def table(self) -> Table:
        """A row for each model, the one with the least error of the yaw rate over steady states first."""
        rows = []
        for each in self.validations:
            cells: list[object] = [each.model, f"{each.friction:.3f}"]
            for name, signal, how, length in _COLUMNS:
                found = each.agreement(signal, how, length)
                percent = name.endswith("[%]")
                cells.append(None if found is None else f"{100.0 * found.share:.1f}" if percent else f"{found.rms:.3f}")
            recorded, model = each.plateau
            cells.append(f"{100.0 * (model / recorded - 1.0):+.1f}" if recorded == recorded else None)
            cells.append(sum(state.spun for state in each.steady))
            rows.append(cells)
        rows.sort(key=lambda row: float(str(row[4])) if row[2] is None else float(str(row[2])))
        header = ("model", "friction [-]", *(name for name, *_ in _COLUMNS), "plateau [%]", "states spun")
        return Table(header=header, rows=rows, left=("model",))

    def __str__(self) -> str:
        return self.table.markdown()


def scoreboard(
    drives: Sequence[str | Path | RecordedDrive] | str | Path,
    *,
    vehicle: str | Path | Vehicle = DEFAULT_VEHICLE,
    mu: float | None = None,
    columns: Any = None,
    threads: int = 1,
    watch: Callable[[str], None] | None = None,
) -> Scoreboard:
    """Return the scoreboard of every bundled set of tires, and of the models of other simulators.

    Each set is driven on the vehicle that it was measured on; `vehicle` stands on those of no car and on its own.
    Arguments and errors as of `validate`. With `mu` all models have this friction; else each its own.
    """
    loaded = Vehicle.load(vehicle)
    found = read(drives, columns=columns, vehicle=loaded, watch=watch)
    smoothed: dict[tuple[CarParameters, CommandResponse], tuple[list[DriveMotion], list[str]]] = {}
    validations = []
    for model in models_of(loaded, mu=mu, threads=threads):
        key = model.car, model.response
        if key not in smoothed:
            smoothed[key] = motions_of(found, model, watch=watch)
        validations.append(validate_model(model, found, smoothed=smoothed[key], watch=watch))
    return Scoreboard(validations=tuple(validations))


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
