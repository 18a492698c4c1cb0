"""No module of a room imports one of a room above it by name, where import-linter does not see it."""

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import fg_mujoco as fg
from cases import each

PACKAGE = Path(fg.__file__).parent
TOP_FOLDERS = {f"fg_mujoco.{name}": Path(getattr(fg, name).__file__).parent for name in ("controllers", "addons")}
MODULES = {
    f"{name}.{'.'.join(path.relative_to(folder).with_suffix('').parts)}".removesuffix(".__init__"): path
    for name, folder in (("fg_mujoco", PACKAGE), *TOP_FOLDERS.items())
    for path in folder.rglob("*.py")
}
NAMED_AT_RUN_TIME = {
    "fg_mujoco": "the public names, above all rooms",
    "fg_mujoco.registry": "what rooms above have registered",
    "fg_mujoco.addons.gym2d.old_gym": "modules of gymnasium and of a script",
    "fg_mujoco.addons.gym2d.installing": "modules of its own room, by the names that scripts import",
    "fg_mujoco.addons.gym2d.drawing": "its own parts",
    "fg_mujoco.addons.ros.node_host.imports": "modules of a node",
    "fg_mujoco.lab.lab": "the experiments, modules of its own room",
    "fg_mujoco.pictures.rendering.gl": "the back end of MuJoCo's renderer",
}
"""Modules that import by a name that is worked out, and what of."""
TABLE = ("fg_mujoco.registry", "fg_mujoco.addons")
"""The one module that names the add-ons, and their table."""
IMPORTERS = ("import_module", "_import_module", "__import__")


def layers():
    """Return the place of each room and top-level module in the list of import-linter, the lowest first."""
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8")
    rows = re.findall(r'^  "([\w :]+)",$', text.partition('type = "layers"')[2].partition("\n]")[0], re.MULTILINE)
    places = {name: len(rows) - i for i, row in enumerate(rows) for name in row.split(" : ")}
    return places | {"models": 0, "tracks": 0}


def place(name):
    """Return the place of a module's room; the package itself is above all."""
    return LAYERS[name.split(".")[1]] if "." in name else max(LAYERS.values()) + 1


LAYERS = layers()


@cache
def arrows(name, text):
    """Return how and what a module imports by name, see `each_arrow`."""
    return tuple(each_arrow(name, text))


def each_arrow(name, text):
    """Yield how and what a module imports by name: the modules, or None where the name is worked out."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in IMPORTERS and not isinstance(node.args[0], ast.Constant):
                yield node.lineno, None
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            if re.fullmatch(r"fg_mujoco(\.\w+)+(:[\w.]+)?", node.value):
                yield node.lineno, node.value.partition(":")[0]
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(name.split(".")[: -node.level or None]) if node.level else ""
            source = ".".join(part for part in (base, node.module or "") if part)
            if source == "fg_mujoco":  # of the package itself, which imports what is public when it is asked for it
                yield from ((node.lineno, f"fg_mujoco.{each.name}") for each in node.names)
        elif isinstance(node, ast.Import):
            yield from ((node.lineno, each.name) for each in node.names if each.name == "fg_mujoco")


def wrong(name, text):
    """Return what a module imports by name, and may not."""
    found = []
    for line, target in arrows(name, text):
        if target is None:
            if name not in NAMED_AT_RUN_TIME:
                found.append(f"{name}, line {line}: imports by a name that is worked out")
        elif target.split(".")[1:2] and target.split(".")[1] not in LAYERS:
            if target.split(".")[1] in set(fg.__all__) - {"__version__"}:
                found.append(f"{name}, line {line}: imports {target}, which the package imports from any room")
        elif place(target) > place(name) and (name, target) != TABLE:
            found.append(f"{name}, line {line}: names {target}, which is above it")
    return found


def test_no_module_imports_from_above_by_name():
    names = [name for name in MODULES if not name.endswith("__main__")]
    assert [each for name in names for each in wrong(name, MODULES[name].read_text("utf-8"))] == []


def test_no_test_of_the_core_imports_an_add_on():
    words = re.compile(r"^\s*(from|import) fg_mujoco\.addons|^\s*from fg_mujoco import .*\baddons\b", re.MULTILINE)
    tests = Path(__file__).parent.rglob("*.py")
    assert [path.name for path in tests if words.search(path.read_text("utf-8"))] == []


def test_there_is_one_place_that_compares_names_and_no_two_modules_have_the_same():
    """Modules of commands are named after the command, which another room may have the verb of."""
    core = {name: path for name, path in MODULES.items() if not name.startswith("fg_mujoco.addons")}
    assert [path.name for path in core.values() if "difflib" in path.read_text("utf-8")] == ["errors.py"]
    names = [path.stem for path in core.values() if "__" not in path.name and path.parent.name != "cli"]
    assert {name for name in names if names.count(name) > 1} == set()


LOADS_NOTHING_OF = (
    "course.maps", "course.scenes", "course.line_file", "course.track_walls", "addons.arena",
    "racing.crash", "racing.run_folder", "racing.run_checks", "lidar.scan_pipeline", "addons.realcar",
    "vehicle.sensors", "vehicle.contract", "cli.config", "cli.words", "lab", "pictures", "rollouts",
)  # fmt: skip
"""Rooms and modules of which a race of one car has nothing to do, see below."""
SLOW = {"matplotlib", "trimesh", "dm_control", "ray", "hypothesis", "scipy", "numba"}
MOST_MODULES = 122
"""Of ours that a race of one car loads: a new module of it is a chapter of its own, or belongs in one that is there."""
RACES = {
    "Python": "import fg_mujoco as fg; fg.race('oval', time_limit=0.05)",
    "the command": "from fg_mujoco.cli.main import main; main(['race', '--time-limit', '0.05', '--json'])",
}


@each("door", RACES)
def test_a_race_of_one_car_loads_what_it_has_and_no_more(door):
    for _ in range(2):  # the first keeps what it reads and makes of the course
        code = [sys.executable, "-c", f"import sys; {RACES[door]}; print(*sys.modules)"]
        loaded = subprocess.run(code, capture_output=True, text=True, check=True).stdout.split()
    assert "fg_mujoco.racing.race" in loaded and (door != "Python" or "fg_mujoco.cli" not in loaded)
    found = [name for name in loaded for room in LOADS_NOTHING_OF if f"{name}.".startswith(f"fg_mujoco.{room}.")]
    assert found == [] and SLOW.isdisjoint(loaded)
    assert len([name for name in loaded if name.partition(".")[0] == "fg_mujoco"]) <= MOST_MODULES
