"""The bundled circuits are what their recipes make."""

from __future__ import annotations

from importlib import resources

import pytest

from fg_mujoco.course.formats import track_names
from fg_mujoco.course.recipes import RECIPES, main, write_bundled
from fg_mujoco.errors import TrackError


def test_every_circuit_has_a_recipe_and_every_recipe_a_circuit():
    assert set(track_names()) == set(RECIPES)


@pytest.mark.parametrize("name", sorted(RECIPES))
def test_circuit_is_what_its_header_says_makes_it(name, tmp_path):
    bundled = (resources.files("fg_mujoco.tracks") / f"{name}.csv").read_text(encoding="utf-8")
    command = next(line.partition("made by: ")[2] for line in bundled.splitlines() if "made by: " in line)
    assert command == f"python -m fg_mujoco.course.recipes {name}"
    assert main([*command.split()[3:], str(tmp_path / f"{name}.csv")]) == 0
    made = (tmp_path / f"{name}.csv").read_text(encoding="utf-8")
    assert made.replace("-0.0,", "0.0,") == bundled.replace("-0.0,", "0.0,")  # a zero's sign is the processor's


def test_unknown_recipe_is_refused(tmp_path, capsys):
    with pytest.raises(TrackError, match="unknown recipe 'figure_of_eight'; accepted: oval"):
        write_bundled("figure_of_eight", tmp_path / "x.csv")
    assert main(["figure_of_eight"]) == 2
    assert "unknown recipe" in capsys.readouterr().err
