"""What benchmarks/race_maps.py makes of a folder of maps."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import fg_mujoco as fg
from map_oracles import draw_map, ring

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "race_maps.py"
if not SCRIPT.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)


def run(*options):
    return subprocess.run([sys.executable, str(SCRIPT), *map(str, options)], capture_output=True, text=True)


@pytest.fixture
def data(tmp_path):
    maps = tmp_path / "race_maps"
    maps.mkdir()
    draw_map(maps, ring())
    (maps / "broken.yaml").write_text("image: nowhere.png\n", encoding="utf-8")
    return tmp_path


def test_rows_are_in_the_order_of_what_was_asked_for_and_have_the_figures_of_the_race(data):
    figures = data / "figures.json"
    done = run(
        "--data", data, "--track", "oval", "--speeds", "2,4", "--laps", 2, "--tight", "3:4", "--workers", 2,
        "--odometry-drift", 0.05, "--json", figures,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    rows = json.loads(figures.read_text(encoding="utf-8"))["races"]
    asked = [(name, speed) for name in ("broken", "drawn", "oval") for speed in (2.0, 4.0)]
    assert [(row["course"], row["speed_limit_m_s"]) for row in rows] == [*asked, ("random:3:tight", 8.0)]
    assert rows[0]["message"].startswith("refused: broken.yaml") and str(data) not in done.stdout
    for course, row in ((data / "race_maps" / "drawn.yaml", rows[3]), ("oval", rows[5])):
        race = fg.race(course, laps=2, max_speed=4.0, odometry_drift=0.05)
        assert (row["end_reason"], row["first_lap_s"]) == (race.car.end_reason, race.car.lap_times_s[0])
        assert row["best_flying_lap_s"] == race.car.lap_times_s[1] and row["ratio"] is None
    *table, _, last = done.stdout.splitlines()
    assert len(table) == 2 + len(rows)
    finished, crashed = (sum(row["end_reason"] == reason for row in rows) for reason in ("finished", "crash"))
    assert finished >= 4 and last.startswith(f"{finished} of 7 finished; {crashed} crashed;")


@pytest.mark.parametrize(
    ("options", "said"),
    [(("--maps", "drawn,nowhere"), "--maps has nowhere; accepted: none, or any of broken, drawn")],
)
def test_a_map_that_is_not_there_is_named(data, options, said):
    done = run("--data", data, *options)
    assert done.returncode == 1 and said in done.stderr
