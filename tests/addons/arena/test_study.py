"""A study drives each run once, says how it went, and keeps it: comparisons, suites and scores; and their commands."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from comparison_worlds import FAILS_AT, PLANNERS, SUITE, files
from fg_mujoco.addons.arena.runs.run import CarFigures, Origin, RunRow, driven_poses, lap_bound, wrong_way_time
from fg_mujoco.addons.arena.study.functions import study
from fg_mujoco.addons.arena.study.tables import cells_of, table_of
from fg_mujoco.cli.main import main
from fg_mujoco.course.moving_obstacles import MovingObstacle
from fg_mujoco.course.scene import Scene
from fg_mujoco.racing.resolved import Ground
from fg_mujoco.rollouts.shares import wilson

CAR = fg.Vehicle.load().parameters
GRID = ["planners.py:Gentle", "planners.py:Gentle[speed=2,steering=0.1]", "planners.py:Broken"]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "planners.py").write_text(PLANNERS)
    return tmp_path


def compare(controller=GRID, **options):
    defaults = {"track": ["oval"], "laps": 1, "time_limit": 0.6, "obstacles": 1, "seed": [0, 4], "workers": 1,
                "out": "out"}  # fmt: skip
    return fg.compare(controller, **(defaults | options))


# what a run is


def test_a_run_is_the_race_that_it_says():
    comparison = compare(GRID[1:2], seed=[4], lidar_noise=0.02)
    (row,) = comparison.rows
    result = fg.race("oval", "planners.py:Gentle", laps=1, time_limit=0.6, obstacles=1, obstacle_seed=4, seed=4,
                     effects=fg.LidarEffects(range_noise_std=0.02), planner_settings={"speed": 2, "steering": 0.1})
    figures = row.car
    assert row.trajectory_sha256 == result.trajectory_sha256
    assert figures.end_reason == result.car.end_reason == "time_limit"
    assert not figures.success
    assert (figures.laps_completed, figures.laps_requested, figures.best_lap_s) == (0, 1, None)
    assert figures.mean_speed_m_s == result.car.mean_speed_m_s
    assert figures.distance_m == pytest.approx(result.car.column("progress_m")[-1], rel=0.1)
    assert row.setup["obstacle_seed"] == row.setup["seed"] == 4
    assert row.planner == row.place["planner"] == "planners.py:Gentle[speed=2,steering=0.1]"


def test_a_lap_is_a_success_with_its_times():
    (row,) = compare(["gap_finder"], time_limit=None, obstacles=0, assist="full").rows
    assert row.place["seed"] is None  # nothing depends on it: two seeds, one run
    assert row.car.success
    assert row.car.first_lap_s == row.car.best_lap_s == row.car.mean_lap_s > 5.0
    assert row.car.wrong_way_time_s == 0.0
    assert 0.05 < row.car.least_clearance_m < 1.1 - 0.5 * CAR.width


def test_a_run_that_touches_something_has_no_clearance():
    (row,) = compare(["planners.py:Gentle[speed=4]"], obstacles=0, time_limit=8.0).rows
    assert row.car.end_reason == "crash"
    assert row.car.least_clearance_m == 0.0
    assert row.car.collisions == 1


@each("track, speed", [("oval", 1.0), ("oval", -1.0), ("l_corridor", 2.0)])
def test_where_the_physics_meets_the_wall_the_footprint_does(track, speed):
    """The engine's contacts know nothing of the clearance: what they report is its oracle."""
    settings = {"speed": speed, "steering": 0.05}
    result = fg.race(track, "planners.py:Gentle", laps=1, planner_settings=settings)
    assert result.car.end_reason == "crash"
    poses = driven_poses(result)
    ground, times = Ground(result.world.track), np.zeros(len(poses))
    assert ground.least_clearance(times, poses, CAR) < 0.01
    before = poses[:-2]  # the tick of the contact is the last
    assert ground.least_clearance(times[:-2], before, CAR) > 0.0


def test_wrong_way_time_counts_what_goes_back_faster_than_jitter():
    time = np.array([0.0, 1.0, 2.0, 3.0, 5.0, 6.0])
    assert wrong_way_time(time, np.array([0.0, 1.0, 0.95, 0.5, -9.0, -8.0])) == 3.0
    assert wrong_way_time(time, np.zeros(6)) == 0.0
    assert wrong_way_time(time[:0], time[:0]) == 0.0


def test_a_planner_that_fails_is_a_row_and_the_others_go_on(capsys):
    comparison = compare(seed=[0])
    assert [row.car.end_reason for row in comparison.rows] == ["time_limit", "time_limit", "planner_failed"]
    failed = comparison.rows[-1].car
    assert failed.message == f"ValueError: no more (planners.py, line {FAILS_AT}), t = 0.200 s"
    assert failed.time_s == pytest.approx(0.2) and failed.distance_m > 0.0 and not failed.success
    words = "compare --controller planners.py:Broken --track oval --laps 1 --time-limit 0.6 --workers 1 --out told"
    assert main(words.split()) == 0
    assert capsys.readouterr().out.count(f"planners.py:Broken failed, first: {failed.message}\n") == 1


def test_a_comparison_has_the_settings_of_a_run_folder_and_its_own_planners(capsys):
    fg.write_run(fg.race("oval", "planners.py:Gentle", laps=1, time_limit=0.2, mu=0.7), "raced", picture=False)
    words = ["compare", "--config", "raced", "--track", "oval", "--seed", "0", "--workers", "1", "--out"]
    assert main([*words, "some", "--controller", "gap_finder,planners.py:Gentle"]) == 0
    assert main([*words, "bundled"]) == 0  # the planner of the folder is none of them
    out = capsys.readouterr().out
    assert out.count("comparison: 2 runs") == 1 and out.count("planners.py:Gentle") == 1 and out.count("mu 0.7;") == 2


def test_the_clearance_to_what_moves_is_that_of_its_time():
    crossing = MovingObstacle(length=0.4, width=0.4, start=(2.0, -4.0), end=(2.0, 4.0), speed=1.0)
    scene = Scene(name="test", way=np.array([[-3.0, 0.0], [20.0, 0.0]]), start=3.0, goal=15.0,
                  walls=(fg.Box(x=0.0, y=6.0, length=9.0, width=0.2),), moving=(crossing,), time_limit=10.0)
    front = CAR.length - CAR.rear_overhang
    times = np.array([0.0, 4.0, 8.0])
    standing = np.zeros((3, 3))
    assert Ground(scene).least_clearance(times, standing, CAR) == pytest.approx(2.0 - 0.2 - front)
    assert Ground(scene).least_clearance(times[::2], standing[::2], CAR) > 3.0


# the grid and its folder


def test_the_files_are_the_same_for_any_number_of_workers_and_after_an_interruption(here):
    compare(out="straight")

    def interrupt(progress):
        if progress.runs_driven == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compare(out="halting", watch=interrupt)
    assert len((here / "halting/runs.jsonl").read_text().splitlines()) == 2
    assert compare(out="halting").runs_driven == 4
    assert compare(out="many", workers=2).runs_driven == 6
    assert files(here / "straight") == files(here / "halting") == files(here / "many")
    assert {"runs.csv", "table.csv", "table.md", "table.html"} < files(here / "straight").keys()


def test_finished_runs_are_not_driven_again_and_a_larger_grid_goes_on(here):
    assert compare(GRID[:1]).runs_driven == 2
    assert compare(GRID[:1]).runs_driven == 0
    assert compare(GRID[:2], max_speed=(8.0, 4.0), seed=[0, 4, 5]).runs_driven == 10
    smaller = compare(GRID[:1])
    assert smaller.runs_driven == 0
    assert len(smaller.rows) == 2
    assert len((here / "out/runs.jsonl").read_text().splitlines()) == 12  # what is there stays there
    with (here / "out/runs.csv").open() as file:
        assert len(list(csv.reader(file))) == 1 + 2  # the tables are of what was asked for


def test_a_torn_line_is_dropped_and_its_run_driven_again(here):
    compare()
    whole = files(here / "out")
    for torn in (whole["runs.jsonl"][:-9], whole["runs.jsonl"][:30], whole["runs.jsonl"] + b'{"contr'):
        (here / "out/runs.jsonl").write_bytes(torn)
        assert compare().runs_driven == 6 - torn.count(b"\n")
        assert files(here / "out") == whole


def edit(path, old, new):
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


def flip(path):
    content = bytearray(path.read_bytes())
    content[content.index(b"finished")] ^= 1
    path.write_bytes(content)


DAMAGE = {"no run": ("runs.jsonl, line 1: ", lambda f: (f / "runs.jsonl").write_text('{"controller": 3}\n')),
          "edited": ("runs.jsonl, line [12]: ", lambda f: edit(f / "runs.jsonl", '"seed": 4', '"seed": 5')),
          "flipped": ("runs.jsonl, line 1: ", lambda f: flip(f / "runs.jsonl"))}  # fmt: skip


@each("damage", DAMAGE)
def test_a_damaged_run_is_told_of_by_its_name_and_driven_again(here, damage):
    compare(GRID[:1])
    whole = files(here / "out")
    named, spoil = DAMAGE[damage]
    spoil(here / "out")
    with pytest.warns(UserWarning, match=rf"{named}is damaged, and made again"):
        driven = compare(GRID[:1]).runs_driven
    assert driven == (2 if damage == "no run" else 1)
    assert files(here / "out") == whole


def test_a_folder_of_other_settings_or_versions_is_refused(here, monkeypatch):
    compare(GRID[:1])
    with pytest.raises(fg.RunFolderError, match="laps is 1 there and 2 here; accepted: "):
        compare(GRID[:1], laps=2)
    with pytest.raises(fg.RunFolderError, match='planner_mu is null there and "off" here'):
        compare(GRID[:1], planner_mu=float("inf"))
    monkeypatch.setattr("fg_mujoco.addons.arena.study.store.versions", lambda: {"sources_sha256": "other"})
    with pytest.raises(fg.RunFolderError, match="contents of the sources have changed"):
        compare(GRID[:1])
    (here / "full").mkdir()
    (here / "full/notes.txt").write_text("mine")
    with pytest.raises(fg.RunFolderError, match="is not empty"):
        compare(GRID[:1], out="full")


def test_a_worker_that_dies_is_told_of_and_the_other_runs_are_driven(here):
    with pytest.warns(UserWarning, match=r"Deadly on oval, max_speed 8.0, seed \d: the worker ended by SIGKILL"):
        result = compare(["planners.py:Gentle", "planners.py:Deadly"], workers=2)
    assert [row.car.end_reason for row in result.rows] == ["time_limit"] * 2 + ["worker_died"] * 2
    assert compare(["planners.py:Gentle"]).runs_driven == 0


# the tables


def row(planner="a", course="oval", speed=8.0, seed=0, sha256=None, **figures):
    none = {"success": True, "end_reason": "finished", "finished": True, "laps_completed": 1, "laps_requested": 1,
            "best_lap_s": 9.0, "mean_lap_s": 9.5, "max_slide_m_s": 0.01, "slide_time_fraction": 0.0,
            "least_clearance_m": 0.3, "wrong_way_time_s": 0.0}  # fmt: skip
    place = {"planner": planner, "assist": "none", "course": course, "max_speed": speed, "seed": seed}
    return RunRow(key=f"{planner} {seed}", place=place, setup={}, course_sha256="", origins=(Origin(sha256=None),),
                  car=CarFigures(**(none | figures)), trajectory_sha256=sha256 or str(seed))


CRASH = {"success": False, "end_reason": "crash", "best_lap_s": None, "mean_lap_s": None, "collisions": 1,
         "laps_completed": 0}  # fmt: skip


def test_a_cell_sums_up_the_runs_of_a_planner_on_a_course():
    last = CRASH | {"best_lap_s": 2.0, "mean_lap_s": 2.0, "least_clearance_m": 0.0, "wrong_way_time_s": None,
                    "slide_time_fraction": None}  # fmt: skip
    (cell, other) = cells_of([row(best_lap_s=9.0, mean_lap_s=12.0, wrong_way_time_s=1.0,
                                               slide_time_fraction=0.5), row("b", **CRASH),
            row(seed=1, best_lap_s=11.0, mean_lap_s=12.0, least_clearance_m=0.2, wrong_way_time_s=0.5,
                max_slide_m_s=0.4), row(seed=2, **last), row(seed=3, best_lap_s=14.0, mean_lap_s=15.0)])  # fmt: skip
    expected = {"planner": "a", "course": "oval", "runs": 4, "successes": 3, "ends": "1 crash, 3 finished",
                "laps_completed": 3, "laps_requested": 4, "collisions": 1, "best_lap_s": 11.0, "mean_lap_s": 13.0,
                "least_clearance_m": 0.0, "wrong_way_time_s": 1.5, "max_slide_m_s": 0.4,
                "slide_time_fraction": pytest.approx(0.5 / 3), "best_lap_s_of": 3, "best_lap_s_q25": 10.0,
                "best_lap_s_q75": 12.5, "score": None}  # fmt: skip
    assert {name: cell[name] for name in expected} == expected  # 9, 11 and 14 s of the successes
    assert (cell["successes_low"], cell["successes_high"]) == wilson(3, 4)
    found = [other[name] for name in ("planner", "best_lap_s", "best_lap_s_of", "best_lap_s_q25")]
    assert found == ["b", None, 0, None]


def test_runs_in_other_conditions_are_other_cells_whatever_the_conditions_are():
    rows = [row(seed=seed) for seed in range(4)]
    rows = [replace(each, place={**each.place, "lidar_noise": 0.01 * (seed % 2)}) for seed, each in enumerate(rows)]
    found = [(cell["lidar_noise"], cell["runs"]) for cell in cells_of(rows)]
    assert found == [(0.0, 2), (0.01, 2), ("all", 4)]


def test_what_is_of_several_courses_has_counts_and_no_lap_times():
    rows = [row(course=course, seed=seed, best_lap_s=lap) for course, lap in (("oval", 9.0), ("fast", 30.0))
            for seed in (0, 1)]  # fmt: skip
    *of_courses, of_all = cells_of(rows)
    assert [cell["best_lap_s"] for cell in of_courses] == [9.0, 30.0]
    assert (of_all["course"], of_all["successes"], of_all["best_lap_s"], of_all["mean_lap_s"]) == ("all", 4, None, None)


def test_the_ranking_is_by_assist_first_and_then_by_the_score():
    """A driver at half the pace of another one that gets round, too, has half its score."""
    rows = [row(planner, course=course, best_lap_s=lap, bound_s=8.0, time_s=lap, completion=1.0)
            for planner, lap in (("slow", 20.0), ("quick", 10.0)) for course in ("oval", "fast")]  # fmt: skip
    rows += [replace(each, place={**each.place, "assist": "full"}) for each in rows]
    found = [(cell["assist"], cell["planner"], cell["score"]) for cell in cells_of(rows) if cell["course"] == "all"]
    assert found == [("full", "quick", 80.0), ("full", "slow", 40.0), ("none", "quick", 80.0), ("none", "slow", 40.0)]
    assert list(table_of(cells_of(rows)).header[:2]) == ["planner", "assist"]


@each("given, score", [({"completion": 0.5, "laps_requested": 2, "time_s": 10.0}, 40.0),  # a lap, at 10 s
                       ({"completion": 0.75, "laps_requested": 2, "best_lap_s": 4.0, "time_s": 90.0}, 75.0),
                       ({"completion": 0.0, "laps_requested": 1, "time_s": 0.0}, 0.0)])  # fmt: skip
def test_a_score_is_the_way_times_the_bound_over_the_own_lap(given, score):
    assert CarFigures(end_reason="crash", bound_s=8.0, **given).score == pytest.approx(score)
    assert CarFigures(end_reason="crash", **given).score is None


def test_no_car_beats_the_bound_of_a_lap():
    circuit = fg.Setup.of("oval", max_speed=3.0)
    assert 0.8 * fg.load_track("oval").length / 3.0 < lap_bound(circuit) < fg.race(circuit).car.lap_times_s[1]
    scene = fg.Setup.of("scene:dead_end:1", max_speed=3.0)
    way = fg.load_track("scene:dead_end:1").length
    assert lap_bound(scene) == pytest.approx(way / 3.0 + 1.5 / CAR.max_acceleration)


def test_of_one_run_or_of_copies_of_it_there_are_no_intervals_and_no_quartiles():
    """Twelve runs that are alike are one: ten of ten is no interval from 72 to 100 %."""
    copies = [row(each, seed=seed, sha256="same") for each in ("a", "b") for seed in range(12)]
    for rows in (copies[::12], copies):
        for cell in cells_of(rows):
            assert (cell["successes_low"], cell["successes_high"]) == (None, None)
            assert (cell["best_lap_s"], cell["best_lap_s_q25"], cell["best_lap_s_q75"]) == (9.0, None, None)


def test_the_files_say_the_assist_first_and_in_a_column_and_have_intervals_and_counts(here):
    comparison = compare(GRID[:2], out="out")
    with open("out/table.csv", encoding="utf-8") as file:
        (first, _) = csv.DictReader(file)
    assert (first["successes_low"], first["successes_high"], first["best_lap_s_of"]) == ("", "", "0")  # two equal runs
    text = (here / "out" / "table.md").read_text("utf-8")
    assert text == comparison.markdown() and text.startswith("comparison: 4 runs, assist none\n")
    assert text.splitlines()[2].split("|")[2].strip() == "assist" and "Wilson's at 95 %" in text
    page = (here / "out" / "table.html").read_text("utf-8")
    for said in ("<h1>comparison: 4 runs, assist none</h1>", ">assist</th>", "Wilson&#x27;s", "<svg", "controller ="):
        assert said in page, said
    assert "Wilson" in comparison._repr_html_() and "assist none" in comparison._repr_html_()


def test_planners_are_compared_without_stages_unless_they_or_the_call_ask_for_some(here):
    short = {"obstacles": 0, "seed": 0, "time_limit": 0.2}
    planners = ["gap_finder", "gap_finder[assist=grip]", "planners.py:Gentle"]
    rows = compare(planners, **short).rows
    assert [row.place["assist"] for row in rows] == ["none", "grip", "none"]
    assert rows[0].trajectory_sha256 == fg.race("oval", laps=1, time_limit=0.2, assist="none").trajectory_sha256
    both = compare(planners[::2], assist=["none", "full"], out="both", **short)
    assert [row.place["assist"] for row in both.rows] == ["none", "full", "none"]
    assert both.rows[1].trajectory_sha256 == fg.race("oval", laps=1, time_limit=0.2).trajectory_sha256
    assert both.head == "comparison: 3 runs, assist none, full"
    words = "compare --controller gap_finder --track oval --laps 1 --time-limit 0.2 --seed 0 --workers 1 --out called"
    main([*words.split(), "--assist", "none", "--assist", "full"])
    text = (here / "called" / "table.html").read_text("utf-8")
    assert text.count("comparison: 2 runs, assist none, full") == 2 and "gap_finder, assist full, oval" in text


def test_a_file_is_called_as_races_call_it_and_a_second_of_its_name_by_its_path(here):
    for folder in ("maps", "others"):
        (here / folder / "deep").mkdir(parents=True)
        fg.export_track(fg.load_track("oval"), here / folder / "hall.csv")
    os.chdir(here / "maps" / "deep")
    tracks = ["../hall.csv", "../../others/hall.csv"]
    found = fg.compare(f"{here}/planners.py:Gentle", track=tracks, laps=1, time_limit=0.2, workers=1, out="out")
    assert [row.place["course"] for row in found.rows] == ["hall", "../../others/hall.csv"]
    assert found.rows[0].place["course"] == fg.load_track("../hall.csv").name
    planners = [f"{here}/planners.py:Gentle", "planners.py:Gentle"]
    (here / "maps" / "deep" / "planners.py").write_text(PLANNERS)
    found = fg.compare(planners, track="oval", laps=1, time_limit=0.2, workers=1, out="out")
    assert [row.planner for row in found.rows] == planners
    with pytest.raises(fg.SettingsError, match="is given twice"):
        fg.compare([planners[1], f"./{planners[1]}"], track="oval", out="out")
    assert set(files(here / "maps" / "deep" / "out")) == {
        "manifest.json", "runs.csv", "runs.jsonl", "table.csv", "table.html", "table.md"
    }  # fmt: skip


def test_each_friction_is_a_run_and_that_of_the_race(here):
    found = compare(["gap_finder", "gap_finder[lookahead=6]"], mu=[0.6, 1.0], obstacles=0, seed=0, time_limit=20.0)
    cells = {(cell["planner"], cell["mu"]): cell for cell in found.cells}
    assert len(cells) == 6  # of either friction, and of both
    for mu in (0.6, 1.0):
        alone = fg.race("oval", laps=1, mu=mu, assist="none", time_limit=20.0)
        assert cells["gap_finder", mu]["best_lap_s"] == min(alone.car.lap_times_s, default=None)


def test_a_scene_is_driven_once_with_each_seed():
    comparison = compare(["gap_finder"], track="scene:corridor_sparse", obstacles=2, laps=3)
    assert [row.place["course"] for row in comparison.rows] == ["scene:corridor_sparse"] * 2
    assert [row.place["seed"] for row in comparison.rows] == [0, 4]
    assert all(row.car.laps_requested == 1 for row in comparison.rows)
    assert len({row.trajectory_sha256 for row in comparison.rows}) == 2


# the command


SHORT = ["--track", "oval", "--laps", "1", "--time-limit", "0.6", "--workers", "1", "--out", "out"]


def command(*arguments):
    return [sys.executable, "-m", "fg_mujoco", "compare", *arguments]


def test_the_command_is_the_function(here, capsys):
    arguments = ["--controller", "planners.py:Gentle[speed=2,steering=0.1],planners.py:Broken", "--track",
        "oval,l_corridor", "--seed", "1:3", "--max-speed", "4", "--obstacles", "1", "--lidar-noise", "0.01", "--laps",
        "1", "--mu", "0.9", "--planner-mu", "off", "--time-limit", "0.3", "--workers", "1", "--out", "out"]  # fmt: skip
    assert main(["compare", *arguments]) == 0
    out, err = capsys.readouterr()
    expected = fg.compare(["planners.py:Gentle[speed=2,steering=0.1]", "planners.py:Broken"],
                          track=["oval", "l_corridor"], seed=[1, 2], max_speed=[4.0], obstacles=1, lidar_noise=0.01,
                          laps=1, mu=0.9, planner_mu=float("inf"), time_limit=0.3, workers=1, out="mine")  # fmt: skip
    assert files(here / "out") == files(here / "mine")
    said = f"mu 0.9; the planner has no limit\nplanners.py:Broken failed, first: {expected.rows[-1].car.message}\n"
    assert out == f"{expected.markdown()}\n8 runs; page: out/table.html\n{said}"
    assert "\x1b" not in err  # what planners print is there, and no progress


def test_ctrl_c_exits_130_and_the_same_command_goes_on(here):
    arguments = ["--controller", "planners.py:Slow", "--track", "oval", "--obstacles", "1", "--seed", "0:20"]
    arguments += ["--laps", "1", "--time-limit", "2", "--workers", "2", "--out", "out"]
    process = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               start_new_session=True)  # fmt: skip
    until = time.monotonic() + 100
    while not list(here.glob("out/runs.jsonl")) and time.monotonic() < until:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the workers get it too
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out == ""
    assert err == "fg-mujoco: out: interrupted; the same command goes on\n"
    found = len((here / "out/runs.jsonl").read_text().splitlines())
    assert 0 <= found < 20  # the line may just be on its way
    assert main(["compare", *arguments, "--json", "--workers", "1", "--seed", f"0:{found + 1}"]) == 0


# suites


@pytest.fixture
def suite(here):
    (here / "small.toml").write_text(SUITE)
    return "small.toml"


def test_a_study_of_a_suite_has_the_runs_of_races_and_their_scores(suite):
    found = study(suite, "straight", scored=True, out="out", workers=1)
    alone, guided = found.rows[0], found.rows[4]
    race = fg.race("oval", "straight", laps=1, max_speed=3.0, assist="none")
    assert alone.trajectory_sha256 == race.trajectory_sha256
    driven = race.car.column("progress_m")[-1] / race.world.track.length
    assert (alone.car.end_reason, alone.car.collisions) == ("crash", 1)
    assert alone.car.completion == pytest.approx(driven) and driven < 0.5
    lap = fg.race("oval", "straight", laps=1, max_speed=3.0).car.lap_times_s[0]
    assert (guided.place["assist"], guided.car.best_lap_s, guided.car.completion) == ("full", lap, 1.0)
    assert guided.car.score == pytest.approx(100.0 * lap_bound(fg.Setup.of("oval", max_speed=3.0)) / lap)
    scores = {(cell["assist"], cell["group"]): cell["score"] for cell in found.cells if cell["course"] == "all"}
    groups = [np.mean([row.car.score for row in found.rows if row.place["group"] == name
                       and row.place["assist"] == "full"]) for name in ("circuits", "boxes")]  # fmt: skip
    assert scores["full", "all"] == pytest.approx(np.mean(groups))
    assert scores["full", "circuits"] == pytest.approx(groups[0])


def test_bench_is_the_study_of_the_bundled_suite_with_scores(suite, here, capsys):
    assert main(["bench", "planners.py:Goes", "--suite", suite, "--workers", "1", "--out", "card", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["suite"], found["version"], found["runs"]) == ("small", 2, 4)  # one that has no stages: once
    assert {cell["assist"] for cell in found["table"]} == {"none"} and found["table"][-1]["score"] > 0.0
    assert main(["study", suite, "planners.py:Goes", "--out", "card"]) == 2  # which has no scores
    assert "accepted" in capsys.readouterr().err


def test_a_name_of_a_planner_is_text_on_the_page_and_why_it_failed_stands_there(suite, here):
    name = "a <b>.py"
    (here / name).write_text("def broken(scan, odometry):\n    raise ValueError('boom <i>')\n")
    found = study(suite, name, out="out", workers=1)
    page = (here / "out/table.html").read_text()
    assert "<b>.py" not in page and "boom &lt;i&gt;" in page and "boom" in found.rows[0].car.message
