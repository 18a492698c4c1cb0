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

from .environment import TIRES, VEHICLE
from .maps import FOLDER
from .module_tables import RACING, module_tables
from .old_gym import names_of_gym, parts_of_gym, really_installed
from .pyglet_stub import Pyglet, names_of

_PACKAGE = str(Path(__file__).parents[1])
_LIBRARIES = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})


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
        self._tables = module_tables()

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
