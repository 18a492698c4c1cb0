"""How the command line refuses what it cannot use, and what classes refuse, from their fields."""

import importlib
import math
import pkgutil
import re
from dataclasses import MISSING, fields, is_dataclass

from fg_mujoco.cli.main import main
from fg_mujoco.errors import FgMujocoError

BOUND = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
ANGLES = {"at most pi": math.pi, "90 degrees": 0.5 * math.pi}


def contents(folder):
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def refused(here, capsys, *arguments):
    """Assert exit 2, one line on stderr, nothing on stdout, nothing written in a folder; return the line."""
    before = contents(here)
    try:
        code = main(arguments)
    except SystemExit as end:  # argparse leaves like that
        code = end.code
    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("fg-mujoco")
    assert "Traceback" not in err
    assert contents(here) == before
    return err


def classes_that_validate(package, given):
    """The dataclasses of a package with a `__post_init__` that can be made of nothing, or of what is given."""
    found = dict(given)
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if ".addons" in module.name.removeprefix(package.__name__) or module.name.endswith(("__main__", "spawned")):
            continue
        try:
            kinds = vars(importlib.import_module(module.name)).values()
        except (ImportError, FgMujocoError):
            assert ".addons" in package.__name__ or module.name.endswith(".dm_environment")  # needs what is not here
            continue
        for kind in kinds:
            own = isinstance(kind, type) and is_dataclass(kind) and kind.__module__ == module.name
            if own and hasattr(kind, "__post_init__") and fields(kind) and kind not in found:
                lacks = any(field.default is field.default_factory is MISSING for field in fields(kind))
                found |= {} if lacks else {kind: {}}
    return found


def assert_bounds(kind, given, leave=()):
    """Of every number, to both sides: just beyond a bound it is refused, and on the bound or just within accepted.

    The bounds are the numbers in the refusal of one that is far away. `leave`: fields whose bounds others set.
    """

    def refusal(name, value):
        try:
            kind(**given | {name: value})
        except FgMujocoError as error:
            return str(error).rpartition("accepted: ")[2].partition(";")[0]
        return None

    for field in fields(kind):
        number = re.match(r"(float|int)\b", str(field.type)) if field.init and field.name not in leave else None
        for side in (-1, 1) if number else ():
            of = int if number[0] == "int" else float
            said = refusal(field.name, of(side * 1e12))
            if said is None:
                continue
            named = [0.0, *map(float, BOUND.findall(said))]
            named += [angle for words, angle in ANGLES.items() if words in said]
            named += [-bound for bound in named if "either side" in said]
            steps = {bound: 1.0 if of is int else max(1e-5 * abs(bound), 1e-9) for bound in named}
            assert any(
                refusal(field.name, of(bound + side * step)) is not None
                and None in (refusal(field.name, of(bound)), refusal(field.name, of(bound - side * step)))
                for bound, step in steps.items()
            ), (field.name, said)
