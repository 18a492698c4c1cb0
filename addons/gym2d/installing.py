"""Resolves the import statements of scripts for f1tenth_gym: `install` provides the modules.

`f110_gym`, `f1tenth_gym` and `pyglet` are always those of here. `gym` stays itself where it is installed; else it is
`old_gym`, on top of Gymnasium. The environments are registered with both. A name of f1tenth_gym that is not here is
reported with the file and the line that asks for it.
"""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import os
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

from fg_mujoco.errors import accepted_names
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle

from .drawing import Pyglet, names_of
from .environment import TIRES, VEHICLE
from .maps import FOLDER
from .old_gym import names_of_gym, parts_of_gym, really_installed

_PACKAGE = str(Path(__file__).parents[1])
_LIBRARIES = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})

# A name's source is `chapter:name` of this room; `environment` and `value.TEXT` are resolved by the finder.
RACING = ("f110_gym", "f1tenth_gym")
"""Packages of f1tenth_gym: the first of v0.2, both of v1.0."""

Table = dict[str, Any]

_SIMULATOR = {name: f"simulator:{name}" for name in ("Integrator", "DynamicModel", "Simulator", "RaceCar")}
_INTEGRATORS = {
    "Integrator": "simulator:Integrator", "IntegratorType": "simulator:Integrator",
    "RK4Integrator": "simulator:Integrator", "EulerIntegrator": "simulator:Integrator",
}  # fmt: skip
_MODELS = {name: f"gym_functions:{name}" for name in (
    "accl_constraints", "steering_constraint", "vehicle_dynamics_ks", "vehicle_dynamics_st", "pid", "pid_steer",
    "pid_accl",
)} | {"DynamicModel": "simulator:DynamicModel"} | {
    name: f"gym_config:{name}" for name in (
        "VehicleParameters", "F1TENTH_VEHICLE_PARAMETERS", "F1FIFTH_VEHICLE_PARAMETERS", "FULLSCALE_VEHICLE_PARAMETERS",
        "get_f1tenth_vehicle_parameters", "get_f1fifth_vehicle_parameters", "get_fullscale_vehicle_parameters",
    )
}  # fmt: skip
_COLLISIONS = {name: f"gym_functions:{name}" for name in (
    "get_vertices", "get_trmtx", "collision", "collision_multiple",
)} | {"CollisionCheckMode": "gym_config:CollisionCheckMode"}  # fmt: skip
_LASERS = {"ScanSimulator2D": "simulator:ScanSimulator2D", "LiDARConfig": "gym_config:LiDARConfig"} | {
    name: f"gym_functions:{name}" for name in ("check_ttc_jit", "ray_cast", "get_dt", "xy_2_rc")
}  # fmt: skip
_TRACKS = {name: f"gym_track:{name}" for name in ("Track", "TrackSpec", "Raceline", "CubicSpline2D", "find_track_dir")}
_ACTIONS = {"CarAction": "new_api:CarAction"} | {
    name: f"gym_config:{name}" for name in ("LongitudinalActionType", "SteerActionType")
} | {
    "LongitudinalActionEnum": "gym_config:LongitudinalActionType", "SteerActionEnum": "gym_config:SteerActionType",
}  # fmt: skip
_RENDERING = {
    "EnvRenderer": "drawing:EnvRenderer", "RenderSpec": "drawing:Nothing", "make_renderer": "drawing:Nothing",
    "CAR_LENGTH": "drawing:CAR_LENGTH", "CAR_WIDTH": "drawing:CAR_WIDTH", "ZOOM_IN_FACTOR": 1.2,
    "ZOOM_OUT_FACTOR": 1.0 / 1.2, "make_lidar_scan_callback": "drawing:Nothing",
}  # fmt: skip
_OTHERS = {"ContactConfig": "gym_config:ContactConfig", "ScanBackend": "drawing:Nothing"}
_CONFIG = {name: f"gym_config:{name}" for name in (
    "EnvConfig", "ControlConfig", "SimulationConfig", "ObservationConfig", "ResetConfig", "RenderConfig",
    "LoopCounterMode", "TerminationConfig", "AgentTerminationMode", "RewardConfig", "RewardMode",
    "DomainRandomizationConfig",
)} | _OTHERS | _LASERS | _ACTIONS | _MODELS  # fmt: skip
_OBSERVATIONS = {
    "Observation": "gym_observations:Observation", "observation_factory": "gym_observations:Observation",
    "ObservationType": "gym_config:ObservationType",
}  # fmt: skip
_ENVIRONMENT = {
    "F110Env": "environment", "VIDEO_W": 600, "VIDEO_H": 400, "WINDOW_W": 1000, "WINDOW_H": 800,
}  # fmt: skip

_RACING: dict[str, Table] = {
    "": {"__version__": "value.1.0.0"},
    "envs": _ENVIRONMENT | _SIMULATOR | _INTEGRATORS | {"Track": "gym_track:Track"},
    "envs.f110_env": _ENVIRONMENT | _SIMULATOR | _INTEGRATORS,
    "envs.base_classes": _SIMULATOR | _INTEGRATORS | _MODELS | _COLLISIONS | _LASERS,
    "envs.simulator": _SIMULATOR,
    "envs.dynamic_models": _MODELS,
    "envs.dynamic_models.kinematic": _MODELS,
    "envs.dynamic_models.single_track": _MODELS,
    "envs.dynamic_models.utils": _MODELS,
    "envs.collision_models": _COLLISIONS,
    "envs.laser_models": _LASERS,
    "envs.lidar": _LASERS | _OTHERS,
    "envs.lidar.config": _LASERS | _OTHERS,
    "envs.contact": _OTHERS,
    "envs.integrator": _INTEGRATORS,
    "envs.integrators": _INTEGRATORS,
    "envs.action": _ACTIONS,
    "envs.observation": _OBSERVATIONS,
    "envs.env_config": _CONFIG,
    "envs.reset": {name: f"gym_config:{name}" for name in ("ResetStrategy", "ReferenceLine")},
    "envs.rendering": _RENDERING,
    "envs.rendering.renderer": _RENDERING,
    "envs.rendering.rendering_pyglet": _RENDERING,
    "envs.rendering.rendering_pygame": _RENDERING,
    "envs.track": _TRACKS,
    "envs.track.track": _TRACKS,
    "envs.track.raceline": _TRACKS,
    "envs.track.cubic_spline": _TRACKS,
    "envs.track.utils": _TRACKS,
    "envs.cubic_spline": _TRACKS,
    "envs.termination": _CONFIG,
    "envs.wrappers": {
        name: f"gym_wrappers:{name}" for name in ("SingleAgentWrapper", "ObservationDelayWrapper")
    },
    "envs.utils": {"deep_update": "gym_functions:deep_update"},
}



def install(
    *, maps: str | Path | None = None, vehicle: str | Path | None = None, tires: str | Path | None = None
) -> None:
    """Let import statements of this process find the modules that scripts of f1tenth_gym ask for.

    Folder of maps, vehicle (a bundled name or an MJCF file) and tires (a bundled set or a TOML file) hold for
    environments without settings of their own, in this process and those that it starts, through the environment
    variables FG_MUJOCO_MAPS, FG_MUJOCO_VEHICLE and FG_MUJOCO_TIRES.
    Raises SettingsError: an unknown vehicle, or unknown tires.
    """
    if vehicle is not None:
        Vehicle.load(vehicle)
    if tires is not None:
        Tires.load(tires)
    for variable, value in ((FOLDER, maps), (VEHICLE, vehicle), (TIRES, tires)):
        if value is not None:
            os.environ[variable] = str(value)
    if not any(isinstance(finder, Finder) for finder in sys.meta_path):
        for name in [each for each in sys.modules if each.partition(".")[0] in (*RACING, "pyglet")]:
            del sys.modules[name]  # of a library that is installed, and was imported before
        sys.meta_path.insert(0, Finder())


class Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Finds the modules of f1tenth_gym, of pyglet, and of gym where it is not installed."""

    def __init__(self) -> None:
        self._tables = {f"{top}.{part}" if part else top: table for top in RACING for part, table in _RACING.items()}

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return a module of here, None of another library; ImportError: one of f1tenth_gym that is not here."""
        top = fullname.partition(".")[0]
        if top == "gym":
            if really_installed(top) or names_of_gym(fullname) is None:
                return None
        elif top not in (*RACING, "pyglet"):
            return None
        elif top != "pyglet" and fullname not in self._tables:
            parent, _, last = fullname.rpartition(".")
            known = [name for name in self._names(parent) if not name.startswith("_")]
            if last in known:  # imported as if it were a module
                said = f"{_asker()}{parent}.{last} is no module; accepted: from {parent} import {last}"
                raise ImportError(said, name=last)
            raise ImportError(f"{_asker()}{parent} has no {last!r} here; {accepted_names(last, known)}", name=last)
        return importlib.machinery.ModuleSpec(fullname, self, is_package=True)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType:
        """Return the module, empty."""
        if spec.name.partition(".")[0] == "gym":
            return ModuleType(spec.name)
        return Pyglet(spec.name) if spec.name.partition(".")[0] == "pyglet" else StandIn(spec.name, self)

    def exec_module(self, module: ModuleType) -> None:
        """Fill the module."""
        name = module.__name__
        top = name.partition(".")[0]
        vars(module)["__file__"] = f"<{name} of fg_mujoco.addons.gym2d>"
        if top == "gym":
            vars(module).update(names_of_gym(name) or {})
            for part in parts_of_gym(name):
                setattr(module, part.rpartition(".")[2], importlib.import_module(part))
            return
        if top == "pyglet":
            vars(module).update(names_of(name))
        vars(module)["__all__"] = [each for each in self._names(name) if not each.startswith("_")]
        if name in RACING:
            self._register()

    def value(self, module: str, name: str) -> Any:
        """Return a name of a module of here; a module in it is imported. AttributeError: it is not here."""
        table = self._tables[module]
        if name in table:
            found = table[name]
            if not isinstance(found, str):
                return found
            if found == "environment":
                return self._environment(module)
            if found.startswith("value."):
                return found.partition(".")[2]
            source, _, attribute = found.partition(":")
            return getattr(importlib.import_module(f"{__package__}.{source}"), attribute)
        if f"{module}.{name}" in self._tables:
            return importlib.import_module(f"{module}.{name}")
        known = [each for each in self._names(module) if not each.startswith("_")]
        raise AttributeError(f"{_asker()}{module} has no {name!r} here; {accepted_names(name, known)}")

    def _names(self, module: str) -> list[str]:
        """Return the names of a module: what is in it, and the modules in it."""
        if module.partition(".")[0] == "pyglet":
            return list(names_of(module))
        inside = [each.rpartition(".")[2] for each in self._tables if each.rpartition(".")[0] == module]
        return [*self._tables.get(module, {}), *inside]

    def _environment(self, module: str) -> Any:
        """Return the class of the environment: of f110_gym the one of v0.2, unless Gymnasium alone is imported."""
        new = module.startswith("f1tenth_gym") or ("gymnasium" in sys.modules and "gym" not in sys.modules)
        source, name = ("new_api", "F110Env") if new else ("old_api", "GymEnv")
        return getattr(importlib.import_module(f"{__package__}.{source}"), name)

    def _register(self) -> None:
        """Register the environments with Gymnasium, and with gym where it is installed."""
        new = f"{__package__}.new_api:F110Env"
        for library, old in (("gymnasium", new), ("gym", f"{__package__}:environment_of_gym")):
            if really_installed(library):
                for id, entry in (("f110-v0", old), ("f1tenth-v0", new)):
                    _register_with(importlib.import_module(library), id, entry)


class StandIn(ModuleType):
    """A module of here, whose names are looked up when they are asked for."""

    def __init__(self, name: str, finder: Finder) -> None:
        super().__init__(name, f"Stub of {name}.")
        self.__dict__["_finder"] = finder

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") and name != "__version__":
            raise AttributeError(name)
        found = self.__dict__["_finder"].value(self.__name__, name)
        if not isinstance(found, type) or not name.startswith("F110Env"):
            self.__dict__[name] = found
        return found


def _register_with(library: Any, id: str, entry: str) -> None:
    """Register an environment with a library that is installed, bare: scripts read its own attributes."""
    known = getattr(library, "registry", None)
    if isinstance(known, dict) and id in known:
        return
    try:
        library.register(id=id, entry_point=entry, order_enforce=False, disable_env_checker=True)
    except TypeError:  # of older releases
        library.register(id=id, entry_point=entry)
    except library.error.Error:
        pass  # it is registered


def is_of_the_script(file: str) -> bool:
    """Return whether a file of a frame is a script's own, and not of Python, of this package, or of a library."""
    return not (file.startswith(("<", _PACKAGE, *_LIBRARIES)) or "site-packages" in file)


def _asker() -> str:
    """Return the file and the line of the script that asks, as the beginning of a message."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        if is_of_the_script(frame.f_code.co_filename):
            return f"{frame.f_code.co_filename}:{frame.f_lineno}: "
        frame = frame.f_back
    return ""
