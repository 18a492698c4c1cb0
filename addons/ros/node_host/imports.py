"""Resolves the import statements of a node: stubs of ROS, the user's own files, and other modules as they are.

A node's file runs with an `__import__` of its own, so that nothing is put into `sys.modules` that others would see, and
each planner has its own modules. The user's own files are looked for in the node's folder and in its package.
"""

from __future__ import annotations

import builtins
import importlib.util
import runpy
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from importlib.machinery import ModuleSpec, SourceFileLoader
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

from fg_mujoco.errors import ControllerError, accepted_names, gone

from .graph import Graph
from .message_classes import SERVICE_PACKAGES, Definitions
from .rosidl_modules import rosidl_modules
from .source import FINDER, Unused, data_file, is_package_of_python, own_folders, read_source
from .workspace import module_folders, packages

_PARTS = ("Request", "Response", "Goal", "Result", "Feedback")
_INTERFACES = ("_msgs", "_srvs", "_interfaces")
_INSTALLED_AS = {"cv2": "opencv-python-headless", "PIL": "pillow", "sklearn": "scikit-learn", "yaml": "pyyaml"}
_LEVELS = 4  # folders above the node's in which packages of messages are looked for


class StandIn(ModuleType):
    """A stub of a module of ROS."""

    def __init__(self, name: str, **members: Any) -> None:
        super().__init__(name, f"Stub of {name}.")
        self.__dict__.update(members)
        self.__path__: list[str] = []

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise AttributeError(lacks(self, name))


def lacks(module: ModuleType, name: str) -> str:
    """Return the message for a name that a stub lacks."""
    known = [each for each in vars(module) if not each.startswith("_")]
    return f"{module.__name__} has no {name!r} here, where no ROS is installed; {accepted_names(name, known)}"


class Overlay(ModuleType):
    """A module of Python with some of its members replaced."""

    def __init__(self, real: ModuleType, /, **members: Any) -> None:
        super().__init__(real.__name__, real.__doc__)
        self.__dict__.update(members)
        self.__dict__["_real"] = real

    def __getattr__(self, name: str) -> Any:
        return getattr(self.__dict__["_real"], name)


class Absent(ModuleType):
    """Placeholder for a failed import that nothing uses; each of its attributes is a placeholder, too."""

    def __init__(self, name: str, error: Exception) -> None:
        super().__init__(name)
        self.__path__: list[str] = []
        self._error = error

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Absent(f"{self.__name__}.{name}", self._error)

    def __call__(self, *_: Any, **__: Any) -> Any:
        """Raise what failed: a file that imports this one uses it."""
        raise self._error


class Imports:
    """The modules of one node.

    Its graph gets the paths of the files that are read, `definitions` the user's `.msg` files. `modules` are stubs,
    `overlays` modules of Python, `drawing` those that draw random numbers, for files that name such.
    """

    def __init__(
        self,
        node: Path,
        graph: Graph,
        definitions: Definitions,
        modules: Mapping[str, ModuleType],
        overlays: Mapping[str, ModuleType],
        drawing: Mapping[str, ModuleType],
    ) -> None:
        self._node, self._graph, self._definitions = node, graph, definitions
        self._modules: dict[str, ModuleType] = dict(modules)
        util = Overlay(importlib.util, spec_from_file_location=self._spec, find_spec=self._find_spec)
        by_name = Overlay(importlib, import_module=self._import_by_name, util=util)
        self._overlays = {
            **overlays,
            "importlib": by_name,
            "importlib.util": util,
            "runpy": Overlay(runpy, run_path=self._run_path),
        }
        self._modules |= {name: StandIn(name, **own) for name, own in rosidl_modules(self._interface).items()}
        self._drawing = drawing
        self._draws: set[str] = set()  # files that may draw random numbers, or use old names of NumPy
        self._own: dict[Path, ModuleType] = {}
        self._unused: dict[str, Unused] = {}  # by file
        self._builtins = {**vars(builtins), "__import__": self.import_module, FINDER: self._find_data}
        self._folders = own_folders(node)
        self._fixed = {each.partition(".")[0] for each in modules}  # names that no module in the node's folder has
        for name in list(self._modules):
            self._hang(name)

    def run(self, path: Path, text: bytes, name: str, module: ModuleType | None = None) -> ModuleType:
        """Execute a file of the user's as a module of a name."""
        module = module or ModuleType(name)
        module.__name__, module.__file__ = name, str(path)
        vars(module)["__builtins__"] = self._builtins
        self._graph.files.add(str(path))
        source = read_source(path, text, self._node)
        self._unused[str(path)] = source.unused
        self._graph.data |= source.data
        if b"random" in text:
            self._draws.add(str(path))
        for said in source.notes:
            _warn(said)
        there = sys.modules.setdefault(name, module)  # dataclasses look their module up there
        try:
            exec(source.code, module.__dict__)
        finally:
            if there is module:
                sys.modules.pop(name, None)
        return module

    def import_module(
        self,
        name: str,
        globals: Mapping[str, Any] | None = None,
        locals: Mapping[str, Any] | None = None,
        fromlist: Sequence[str] | None = (),
        level: int = 0,
    ) -> Any:
        """Take the place of `__import__` in the files of a node."""
        wanted = tuple(fromlist or ())
        file, line = str((globals or {}).get("__file__")), sys._getframe(1).f_lineno
        unused = self._unused.get(file, {}).get(line, set())
        try:
            found = self._find(name, globals, locals, wanted, level, unused)
        except ImportError as error:
            unknown = isinstance(error, ModuleNotFoundError) or not name.endswith(".msg")  # else it is a misspelling
            if not (name in unused or (wanted and unused.issuperset(wanted) and unknown)):
                raise
            _warn(f"{error}, and nothing uses it ({file}, line {line})")
            return Absent(name if wanted else name.partition(".")[0], error)
        lacking = [each for each in wanted if each in unused and not hasattr(found, each)]
        if not lacking or name.endswith(".msg"):
            return found
        _warn(f"{name} has no {', '.join(lacking)}, and nothing uses it ({file}, line {line})")
        failed = ImportError(f"cannot import {', '.join(lacking)} from {name!r} ({file}, line {line})")
        return Overlay(found, **{each: Absent(f"{name}.{each}", failed) for each in lacking})

    def _import_by_name(self, name: str, package: str | None = None) -> Any:
        """Take the place of `importlib.import_module`."""
        rest = name.lstrip(".")
        level = len(name) - len(rest)
        if level and not package:
            return self._relative(rest, sys._getframe(1).f_globals, (), level)
        if level and package:
            rest = ".".join([*package.split(".")[: package.count(".") + 2 - level], rest])
        found = self._find(rest, None, None, (), 0, set())
        for part in rest.split(".")[1:]:
            found = getattr(found, part)
        return found

    def _interface(self, said: str) -> Any:
        """Return the class of a message, service or action of `package/msg/Name` or `package/Name`."""
        package, _, rest = said.partition("/")
        part, _, name = rest.rpartition("/")
        return getattr(self._import_by_name(f"{package}.{part or 'msg'}"), name)

    def _spec(self, name: str, location: Any = None, **more: Any) -> Any:
        """Take the place of `importlib.util.spec_from_file_location`: the file is executed as a node's own."""
        spec = importlib.util.spec_from_file_location(name, location, **more)
        if spec is not None and str(location).endswith(".py"):
            path = Path(str(location))
            spec.loader = SourceFileLoader(name, str(path))
            vars(spec.loader)["exec_module"] = lambda module: self.run(path, path.read_bytes(), name, module)
        return spec

    def _run_path(self, path_name: Any, init_globals: Any = None, run_name: str | None = None) -> dict[str, Any]:
        """Take the place of `runpy.run_path`."""
        path, module = Path(path_name), ModuleType("")
        vars(module).update(init_globals or {})
        return vars(self.run(path, path.read_bytes(), run_name or "<run_path>", module))

    def _find_spec(self, name: str, package: str | None = None) -> Any:
        """Take the place of `importlib.util.find_spec`, which says whether there is a module."""
        if name.partition(".")[0] in self._modules:
            return ModuleSpec(name, None)
        return importlib.util.find_spec(name, package)

    def _find_data(self, said: Any) -> Any:
        """Return the path of a file of data that a node reads: another one, where it is not where the node says."""
        found = data_file(str(said), self._node) if isinstance(said, (str, Path)) else None
        if isinstance(said, (str, Path)):
            self._graph.data.add(str(found or said))
        if found is None:
            return said
        _warn(f"{said} is not there; {found} is taken{self._graph.place()}")
        return type(said)(found) if isinstance(said, str) else found

    def _find(
        self,
        name: str,
        globals: Mapping[str, Any] | None,
        locals: Mapping[str, Any] | None,
        wanted: tuple[str, ...],
        level: int,
        unused: set[str],
    ) -> Any:
        if level:
            return self._relative(name, globals or {}, wanted, level)
        top = name.partition(".")[0]
        if name in self._overlays:
            return self._overlays[name if wanted else top]
        if top == "rospy":
            raise ModuleNotFoundError(gone(top), name=top)
        if name in self._drawing and str((globals or {}).get("__file__")) in self._draws:
            return self._drawing[name if wanted or "." not in name else "numpy"]
        added = [each for each in self._overlays["sys"].path if each not in sys.path and isinstance(each, str)]
        own = self._own_first([*self._folders, *map(Path, added)], name, wanted)
        if own is not None:
            return own
        found = self._stub(name)
        if found is not None:
            for each in wanted:
                known = each == "*" or each in vars(found) or self._provides(found, each)
                if not known and (each not in unused or name.endswith(".msg")):
                    raise ImportError(lacks(found, each))
            own = next((each for each in self._own.values() if each.__name__ == top), None)
            if own is not None and "." in name:
                setattr(own, name.rpartition(".")[2], found)
            return found if wanted else own or self._modules[top]
        own = self._of_others(name, wanted)
        if own is not None:
            return own
        with self._graph.importing():
            sys.path[:0] = added
            try:
                return builtins.__import__(name, globals, locals, wanted, 0)
            except ModuleNotFoundError as lack:
                raise to_install(lack) from None
            finally:
                for each in added:  # another thread may import meanwhile
                    sys.path.remove(each)

    def _of_others(self, name: str, wanted: tuple[str, ...]) -> ModuleType | None:
        """Return a module of another package of the workspace that the node is in; None where there is none."""
        top = name.partition(".")[0]
        return self._own_module([each for each in self._others if is_package_of_python(each / top)], name, wanted)

    @cached_property
    def _packages(self) -> dict[str, Path]:
        return packages(self._node)

    @cached_property
    def _others(self) -> list[Path]:
        return module_folders(self._node)

    def _own_first(self, folders: Sequence[Path], name: str, wanted: tuple[str, ...]) -> ModuleType | None:
        """Return a module of the user's; of one that has the name of a package of messages it hides none of these."""
        top, _, rest = name.partition(".")
        messages = rest in ("msg", "srv", "action") or self._node.stem == top
        if top in self._fixed or (messages and self._package(top, loose=False)):
            return None
        own = self._own_module(folders, name, wanted)
        if own is None:
            return None
        for each in (each for each in wanted if not hasattr(own, each)):
            part = self._stub(f"{name}.{each}") if each in ("msg", "srv", "action") else None
            if part is not None:
                setattr(own, each, part)
        return own

    def _stub(self, name: str) -> ModuleType | None:
        top, _, rest = name.partition(".")
        if name not in self._modules and rest in ("msg", "srv", "action") and self._package(top):
            self._hang(name)
        elif name not in self._modules and not rest and self._package(top, loose=False):
            self._modules[top] = StandIn(top)
            self._hang(f"{top}.msg")
        elif name not in self._modules and rest in ("srv", "action") and top.endswith(_INTERFACES):
            self._modules[name] = Services(name, lambda _: {})  # nothing here defines them
            self._hang(name)
        found = self._modules.get(name)
        if found is None and rest and top in self._modules:
            raise ModuleNotFoundError(
                f"there is no {name!r} here, where no ROS is installed; accepted: "
                + ", ".join(each for each in self._modules if each.startswith(f"{top}."))
            )
        return found

    def _provides(self, module: ModuleType, name: str) -> bool:
        """Return whether a stub has a name: a module in it, or a service, which is made when it is used."""
        part = f"{module.__name__}.{name}"
        if isinstance(module, Services) or part in self._modules:
            return True
        return name in ("msg", "srv", "action") and self._stub(part) is not None

    def _package(self, name: str, *, loose: bool = True) -> bool:
        """Return whether there are messages of a package, and make its modules."""
        if f"{name}.msg" in self._modules:
            return True
        if not self._definitions.names(name):
            for folder in self._message_folders(name, loose=loose):
                self._definitions.add_files(name, folder)
        names = self._definitions.names(name)
        defined = name in SERVICE_PACKAGES or any(self._message_folders(name, part) for part in ("srv", "action"))
        if not names and not defined:
            return False
        kinds = {each: self._definitions.kind(f"{name}/msg/{each}") for each in names}
        self._modules[f"{name}.msg"] = StandIn(f"{name}.msg", **kinds)
        for part in ("srv", "action"):
            services = Services(f"{name}.{part}", partial(self._service, name, part))
            self._modules.setdefault(f"{name}.{part}", services)
        self._modules.setdefault(name, StandIn(name))
        for part in ("msg", "srv", "action"):
            setattr(self._modules[name], part, self._modules[f"{name}.{part}"])
        return True

    def _service(self, package: str, part: str, name: str) -> Mapping[str, type]:
        """Return the classes that a service or an action consists of, by part; none where nothing defines it."""
        for folder in self._message_folders(package, part):
            file = folder / f"{name}.{part}"
            if file.is_file():
                return self._definitions.parts(package, name, file.read_text("utf-8", "replace"), str(file))
        return self._definitions.parts(package, name)

    def _message_folders(self, package: str, kind: str = "msg", *, loose: bool = True) -> list[Path]:
        """Return the folders of a package's `.msg` files: its own, that of a neighbouring package, or the node's."""
        folder = self._node.resolve().parent
        above = [folder, *list(folder.parents)[:_LEVELS]]
        places = [place / package / kind for place in above]
        sibling = self._packages.get(package)
        places += [] if sibling is None or sibling / kind in places else [sibling / kind]
        places += [
            place / kind
            for place in above
            if (place.name == package or _is_package(place, package)) and place / kind not in places
        ]
        if loose and kind == "msg" and not any(place.is_dir() for place in places):
            local = folder / "msg"
            places = [local if local.is_dir() else folder]
        return [place for place in places if place.is_dir() and any(place.glob(f"*.{kind}"))]

    def _hang(self, name: str) -> None:
        """Make the modules that a module's name is in, and put each into the one above."""
        parent, _, last = name.rpartition(".")
        if parent:
            self._modules.setdefault(parent, StandIn(parent))
            vars(self._modules[parent]).setdefault(last, self._modules[name])
            self._hang(parent)

    def _relative(self, name: str, globals: Mapping[str, Any], wanted: tuple[str, ...], level: int) -> Any:
        folder = Path(str(globals.get("__file__"))).resolve().parents[level - 1]
        if name:
            found = self._own_module([folder], name, wanted or ("",))
            if found is None:
                raise ModuleNotFoundError(f"there is no module {name!r} in {folder}")
            return found
        package = self._own.setdefault(folder, ModuleType(folder.name))
        for each in wanted:
            own = None if hasattr(package, each) else self._own_module([folder], each, ("",))
            if own is not None:
                setattr(package, each, own)
        return package

    def _own_module(self, folders: Sequence[Path], name: str, wanted: tuple[str, ...]) -> ModuleType | None:
        """Return a module of the user's: the last of a dotted name where names are wanted of it, else the first."""
        for folder in folders:
            parts = name.split(".")
            path = folder.joinpath(*parts)
            if not (path.with_suffix(".py").is_file() or (path.is_dir() and _has_python(path))):
                continue
            if path.name != parts[-1] or (len(parts) == 1 and folder.name == "site-packages"):
                continue
            modules = [
                self._load(folder.joinpath(*parts[: i + 1]), ".".join(parts[: i + 1])) for i in range(len(parts))
            ]
            for outer, inner in pairwise(modules):
                setattr(outer, inner.__name__.rpartition(".")[2], inner)
            for each in wanted:
                if each and not hasattr(modules[-1], each) and path.is_dir():
                    inner_path = path / each
                    if inner_path.with_suffix(".py").is_file() or inner_path.is_dir():
                        setattr(modules[-1], each, self._load(inner_path, f"{name}.{each}"))
            return modules[-1] if wanted else modules[0]
        return None

    def _load(self, path: Path, name: str) -> ModuleType:
        """Return the module of `path.py`, or of the folder `path`, executed once."""
        if path in self._own:
            return self._own[path]
        module = self._own[path] = ModuleType(name)
        file = path.with_suffix(".py") if path.with_suffix(".py").is_file() else path / "__init__.py"
        if file.is_file():
            try:
                self.run(file, file.read_bytes(), name, module)
            except BaseException:
                del self._own[path]
                raise
        return module


class Services(StandIn):
    """Services or actions of a package; `parts_of` returns the parts of a name, none where nothing defines it."""

    def __init__(self, name: str, parts_of: Callable[[str], Mapping[str, type]]) -> None:
        super().__init__(name)
        self._parts_of = parts_of

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        known = self._parts_of(name)
        parts = {part: known.get(part) or type(part, (_Open,), {}) for part in _PARTS}
        found = type(name, (), parts)
        setattr(self, name, found)
        for part in ("Request", "Response"):
            setattr(self, f"{name}{part}", parts[part])
        return found


class _Open:
    """A part of a service that nothing here defines: whatever fields it is given."""

    def __init__(self, *values: Any, **named: Any) -> None:
        vars(self).update(named)


def to_install(lack: ModuleNotFoundError) -> ModuleNotFoundError:
    """Return an error of a module that is not installed, with the name of its package where that is another one."""
    if lack.name in _INSTALLED_AS:
        lack.msg += f"; it is yours to install: pip install {_INSTALLED_AS[lack.name]}"
    return lack


def _warn(said: str) -> None:
    warnings.warn(said, stacklevel=3)


def package_folder(node: Path, name: str) -> Path | None:
    """Return the folder of a package that a node's file is in, or of another of its workspace; None: there is none."""
    for folder in list(node.resolve().parents)[: _LEVELS + 1]:
        if _is_package(folder, name) or folder.name == name:
            inside = folder.parent  # of the Python package of the same name, in a package of ROS 2
            return inside if inside.name == name or _is_package(inside, name) else folder
        if (folder / name).is_dir() and folder != node.resolve().parent:
            return folder / name
    return packages(node).get(name)


def _is_package(folder: Path, name: str) -> bool:
    file = folder / "package.xml"
    return file.is_file() and f"<name>{name}</name>" in file.read_text("utf-8", "replace")


def _has_python(folder: Path) -> bool:
    """Return whether a folder is one of modules; a setup.py alone makes a ROS package, and no module."""
    return any(each.name != "setup.py" for each in folder.glob("*.py"))


def read_node(path: Path, origin: str) -> bytes:
    """Return the contents of a node's file; ControllerError: it cannot be read."""
    if not path.is_file():
        raise ControllerError(f"{origin}: there is no file {path}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise ControllerError(f"{origin}: {path} cannot be read: {error.strerror}") from error
