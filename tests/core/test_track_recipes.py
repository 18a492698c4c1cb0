"""The bundled circuits are what their recipes make."""

from __future__ import annotations

from importlib import resources

import numpy as np
import pytest

from fg_mujoco.course.formats import track_names
from fg_mujoco.course.polyline import turns
from fg_mujoco.course.recipes import RECIPES, main, write_bundled
from fg_mujoco.errors import TrackError
from fg_mujoco.simulation.course_loading import load_track


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


def test_characters():
    tracks = {name: load_track(name) for name in RECIPES}
    sharpest = {name: 1.0 / np.abs(track.curvature).max() for name, track in tracks.items()}
    assert tracks["fast"].length > 180.0 and sharpest["fast"] > 6.5
    assert sharpest["oval"] == pytest.approx(4.0, rel=0.03)
    assert 1.2 <= sharpest["tight"] < 1.5
    assert tracks["tight"].width_left.max() + tracks["tight"].width_right.max() < 2.0
    corners = turns(tracks["l_corridor"].centreline)
    np.testing.assert_allclose(np.abs(corners[np.abs(corners) > 0.01]), 0.5 * np.pi)
    bends = np.sign(tracks["hairpins"].curvature[np.abs(tracks["hairpins"].curvature) > 0.4])
    assert np.sum(bends != np.roll(bends, 1)) >= 4
    back_to_back = {name: tracks[name] for name in ("u_turns", "serpentine", "spiral", "elbow", "boxes", "maze")}
    assert all(15.0 < track.length < 60.0 and 0.44 < sharpest[name] < 0.8 for name, track in back_to_back.items())
    assert {name for name, track in back_to_back.items() if (track.width_left + track.width_right).min() < 0.99} == {
        "boxes"
    }
    assert sharpest["elbow"] == pytest.approx(0.45, abs=0.01)
    assert all(track.start_pose() == pytest.approx((0.0, 0.0, 0.0), abs=1e-3) for track in tracks.values())


def test_unknown_recipe_is_refused(tmp_path, capsys):
    with pytest.raises(TrackError, match="unknown recipe 'figure_of_eight'; accepted: oval"):
        write_bundled("figure_of_eight", tmp_path / "x.csv")
    assert main(["figure_of_eight"]) == 2
    assert "unknown recipe" in capsys.readouterr().err
