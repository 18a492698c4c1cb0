"""The tire laws by name, and those of a user's own; native/vehicle/tires.hpp has the forces of all of them."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import is_dataclass
from pathlib import Path
from types import ModuleType

from ...course.files import read_setting
from ...errors import SettingsError, accepted_names
from ...native import core
from ...registry import Registry
from .friction_curve import FrictionCurve
from .law import Law
from .magic_formula import MagicFormula
from .plain_laws import Brush, Coulomb, Linear
from .sampled import Sampled, SampledBristles

CONTACT = "contact"
"""Model of tires that MuJoCo's own contacts carry, friction included; it has no curve of ours."""

LAWS: tuple[type[Law], ...] = (Coulomb, MagicFormula, Linear, Brush, FrictionCurve, Sampled, SampledBristles)
"""Their places are the numbers by which the native core and compiled models know them."""

LAW_OF = {law.model: law for law in LAWS}
MODELS = (CONTACT, *LAW_OF)

_MOST_BYTES = 2**20  # of the file of a law

curve_force = core.curve_force

_LAWS: Registry[type[Law]] = Registry("tire law", SettingsError, "fg_mujoco.tire_laws", LAW_OF, type)


def law_names() -> tuple[str, ...]:
    """Return the names of the bundled laws and of those that installed packages register."""
    return _LAWS.names()


def find_law(source: str, folder: Path, where: str) -> tuple[type[Law], str]:
    """Return a law of a user's own, by entry point or `path/to/file.py:Class`, and its name with its file's hash.

    Raises:
      SettingsError: no such name or file, or a file that does not import or has no such class.
    """
    path, name = (source, "") if source.endswith(".py") else source.rpartition(":")[::2]
    if not path.endswith(".py"):
        kind, text = _LAWS.find(source, ", or path/to/law.py:Class"), source
    else:
        text = read_setting(folder / Path(path).expanduser(), f"{where}: tire law {path}", "a Python file", _MOST_BYTES)
        module = ModuleType(f"tire_law_{hashlib.sha256(text.encode()).hexdigest()[:16]}")
        sys.modules[module.__name__] = module  # dataclasses look their module up there
        try:
            exec(compile(text, path, "exec"), module.__dict__)
        except (Exception, SystemExit) as error:
            said = " ".join(f"{type(error).__name__}: {error}".split())
            raise SettingsError(f"{where}: tire law {path} does not import: {said}; accepted: a Python file") from error
        own = [each for each in vars(module).values() if isinstance(each, type) and each.__module__ == module.__name__]
        found = {each.__name__: each for each in own if issubclass(each, Law)}
        name = next(iter(found)) if len(found) == 1 and not name else name
        if name not in found:
            listed = accepted_names(name, found) if found else "accepted: a subclass of Law there"
            raise SettingsError(f"{where}: tire law {path} has no {name or 'class named behind it'}; {listed}")
        kind, text = found[name], f"{Path(path).name}:{name}, sha256 {hashlib.sha256(text.encode()).hexdigest()}"
    if not (isinstance(kind, type) and issubclass(kind, Law) and is_dataclass(kind)):
        raise SettingsError(f"{where}: tire law {source} is {kind!r}; accepted: a dataclass that is a subclass of Law")
    return kind, text
