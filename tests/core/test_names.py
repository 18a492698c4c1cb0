"""A name that is mistyped is refused with the one that was probably meant, at every door."""

from pathlib import Path

import fg_mujoco as fg
from fg_mujoco import controllers

PACKAGE = Path(fg.__file__).parent


def test_there_is_one_place_that_compares_names():
    """A second one would have another wording and other rules."""
    users = [path.name for path in PACKAGE.rglob("*.py") if "difflib" in path.read_text(encoding="utf-8")]
    assert users == ["errors.py"]


def test_no_two_modules_have_the_same_name():
    """Modules of commands are named after the command, which another room may have the verb of."""
    names = [path.stem for path in PACKAGE.rglob("*.py") if "__" not in path.name and path.parent.name != "cli"]
    names += [path.stem for path in Path(controllers.__file__).parent.rglob("*.py") if "__" not in path.name]
    assert {name for name in names if names.count(name) > 1} == set()
