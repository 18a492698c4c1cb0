"""Cards: their numbers are those of races, the same again, and a suite is checked before anything is driven."""

import json
from dataclasses import replace

import pytest

import fg_mujoco as fg
from comparison_worlds import SUITE
from fg_mujoco.addons.arena.bench.card import bench
from fg_mujoco.addons.arena.bench.card_page import write_card_page
from fg_mujoco.addons.arena.study.suite import read_suite
from fg_mujoco.cli.main import main

PLANNER = """
import fg_mujoco as fg

def ahead(scan, odometry):
    return fg.DriveCommand(steering_angle=0.0, speed=3.0)
"""


@pytest.fixture
def suite(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SUITE)
    return read_suite(path)


def test_a_card_has_the_figures_of_races(suite):
    card = bench("straight", suite, workers=1)
    row = card.of("none", "circuits")[0]
    race = fg.race("oval", "straight", laps=1, max_speed=3.0, assist="none")
    assert row["trajectory_sha256"] == race.trajectory_sha256
    driven = race.car.column("progress_m")[-1] / race.world.track.length
    assert (row["end_reason"], row["collisions"]) == ("crash", 1)
    assert row["completion"] == pytest.approx(driven) and driven < 0.5
    guided = card.of("full", "circuits")[0]
    assert guided["success"] and guided["completion"] == 1.0
    assert guided["best_lap_s"] == fg.race("oval", "straight", laps=1, max_speed=3.0).car.lap_times_s[0]
    groups = [card.score("none", group) for group in ("circuits", "boxes")]
    assert card.score("none") == pytest.approx(sum(groups) / 2.0)
    assert groups[0] == pytest.approx(50.0 * sum(each["completion"] for each in card.of("none", "circuits")))


def test_a_card_is_the_same_again_in_other_processes(suite):
    first, again = (bench("follow_the_gap", suite, workers=count) for count in (1, 2))

    def timeless(card):
        return {assist: [row | {"decision_ms": None} for row in rows] for assist, rows in card.rows.items()}

    assert timeless(first) == timeless(again)


def test_the_command_writes_the_page_and_the_numbers_of_a_planner_without_stages(here, capsys):
    (here / "mine.py").write_text(PLANNER)
    (here / "small.toml").write_text(SUITE)
    command = ["bench", "mine.py", "--suite", "small.toml", "--workers", "1", "--out", "card"]
    assert main(command) == 0
    assert "mine.py:ahead" in capsys.readouterr().out
    card = json.loads((here / "card" / "card.json").read_text())
    assert list(card["rows"]) == ["none"] and card["suite"] == "small 2" and len(card["rows"]["none"]) == 4
    page = (here / "card" / "card.html").read_text()
    assert card["suite_sha256"][:12] in page and "obstacle" not in card["scores"]["none"]["groups"]["circuits"]
    assert main(command) == 2
    assert "card.html" in capsys.readouterr().err


def test_a_name_of_a_planner_is_text_on_its_page(suite, tmp_path):
    card = replace(bench("straight", suite, workers=1), planner="<script>alert(1)</script>")
    assert "<script>alert(1)" not in write_card_page(card, tmp_path / "card.html").read_text()


def test_why_a_planner_failed_stands_on_its_card(suite, tmp_path):
    path = tmp_path / "broken.py"
    path.write_text("def broken(scan, odometry):\n    raise ValueError('boom')\n")
    card = bench(str(path), suite, workers=1)
    assert card.score("none") == 0.0
    assert "boom" in card.rows["none"][0]["message"]
    assert "boom" in write_card_page(card, tmp_path / "card.html").read_text()


def test_a_planner_that_ends_its_process_ends_no_more_than_its_runs(here, capsys):
    (here / "exits.py").write_text("import os\n\ndef exits(scan, odometry):\n    os.kill(os.getpid(), 9)\n")
    (here / "small.toml").write_text(SUITE[: SUITE.index('[[groups]]\nname = "boxes"')])
    assert main(["bench", "exits.py", "--suite", "small.toml", "--workers", "2"]) == 1
    assert "exits.py:exits" in capsys.readouterr().out
