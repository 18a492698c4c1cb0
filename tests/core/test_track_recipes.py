"""The bundled circuits are what their recipes make."""

from importlib import resources

from recipes import RECIPES, write_bundled

from cases import each
from fg_mujoco.course.formats import track_names


def test_every_circuit_has_a_recipe_and_every_recipe_a_circuit():
    assert set(track_names()) == set(RECIPES)


@each("name", sorted(RECIPES))
def test_circuit_is_what_its_header_says_makes_it(name, tmp_path):
    bundled = (resources.files("fg_mujoco.tracks") / f"{name}.csv").read_text(encoding="utf-8")
    command = next(line.partition("made by: ")[2] for line in bundled.splitlines() if "made by: " in line)
    assert command == f"python tools/recipes.py {name}"
    write_bundled(name, tmp_path / f"{name}.csv")
    made = (tmp_path / f"{name}.csv").read_text(encoding="utf-8")
    assert made.replace("-0.0,", "0.0,") == bundled.replace("-0.0,", "0.0,")  # a zero's sign is the processor's
