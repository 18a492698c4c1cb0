"""The overtaker: alone it is the gap finder; it passes where there is room, and keeps behind where there is none."""

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.arena.runs.duels import Duel, Duels
from fg_mujoco.addons.arena.runs.run import Origin


def duel(track, opponent, seed, ratio=0.5, laps=1):
    """The figures of a duel of the overtaker."""
    row = Duel(place={"planner": "overtaker", "course": str(track), "opponent": opponent, "seed": seed},
               origins=(Origin(sha256=None),), setup=fg.Setup.of(str(track), controller="overtaker", laps=laps),
               planners=("overtaker",), course_sha256="", duels=Duels(opponent=opponent, ratio=(ratio, ratio))).drive()
    assert row.figures["outcome"] != "failed", row.message
    return row


@pytest.mark.slow
@each("track, settings",
      [("chicanes", {}),
       ("chicanes", {"obstacles": 6, "lidar_noise": 0.03}),
       ("l_corridor", {"obstacles": 6, "obstacle_seed": 20, "lidar_noise": 0.03, "seed": 0})])  # fmt: skip
def test_alone_it_is_the_gap_finder_that_predicts_nothing_to_the_last_bit(track, settings):
    names = ("overtaker", "gap_finder", "gap_finder[assist=full-prediction]")
    results = [fg.race(track, name, **{"laps": 1, "seed": 2} | settings) for name in names]
    assert results[0].car.finished and results[0].car.collisions_wall == 0
    assert len({result.trajectory_sha256 for result in results}) == 1


def test_it_passes_where_there_is_room():
    figures = duel("oval", "centreline", 1).figures
    assert figures["outcome"] == "overtaken" and figures["time_lost_s"] < 2.0


@pytest.mark.slow
def test_it_keeps_behind_where_there_is_none(tmp_path):
    """A ring as wide as two and a half cars, and the other in its middle."""
    turns = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
    rows = [f"{6.0 * np.cos(a):.6f}, {6.0 * np.sin(a):.6f}, 0.4, 0.4" for a in turns]
    path = tmp_path / "ring.csv"
    path.write_text("# x_m, y_m, w_tr_right_m, w_tr_left_m\n" + "\n".join(rows) + "\n")
    row = duel(path, "centreline", 0)
    assert row.figures["outcome"] == "behind", row
    assert row.car.message is None
