"""A league: who beats whom, ratings, planners that fail, the proof of a heat, and a folder that is gone on with."""

import shutil
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from comparison_worlds import PLANNERS, files
from fg_mujoco.addons.arena.runs.run import CarFigures, RunRow, car_figures
from fg_mujoco.addons.arena.runs.turn import read_turn
from fg_mujoco.addons.arena.study.functions import league
from fg_mujoco.addons.arena.study.kinds import League
from fg_mujoco.addons.arena.study.plan import plan
from fg_mujoco.addons.arena.study.ratings import MEAN, POINTS, ratings
from fg_mujoco.addons.arena.study.suite import Group, Suite, read_suite
from fg_mujoco.errors import RunFolderError
from fg_mujoco.racing.setup import Setup

SHORT = {"track": "oval", "laps": 1, "time_limit": 1.2, "workers": 1}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PLANNERS)
    return tmp_path


@given(st.integers(0, 30), st.integers(1, 30))
def test_of_two_players_the_odds_are_firths_closed_form(won, more):
    lost = more if won == 0 else more - 1
    found = ratings(np.array([[0, won], [lost, 0]]))
    assert found.value[0] - found.value[1] == pytest.approx(POINTS * np.log((won + 0.5) / (lost + 0.5)), abs=1e-4)
    assert found.value.mean() == pytest.approx(MEAN)


def test_ratings_of_many_heats_are_those_of_hunters_iteration():
    """Of many heats the prior says nothing. Source: Hunter, MM algorithms for generalized Bradley-Terry models."""
    rng = np.random.default_rng(3)
    strength = np.array([0.8, 0.3, -0.2, -0.9])
    wins = np.zeros((4, 4))
    for i in range(4):
        for j in range(i):
            wins[i, j] = rng.binomial(40_000, 1.0 / (1.0 + np.exp(strength[j] - strength[i])))
            wins[j, i] = 40_000 - wins[i, j]
    gamma = np.ones(4)
    for _ in range(2000):
        gamma = wins.sum(axis=1) / ((wins + wins.T) / (gamma[:, None] + gamma)).sum(axis=1)
    expected = MEAN + POINTS * (np.log(gamma) - np.log(gamma).mean())
    assert ratings(wins).value == pytest.approx(expected, abs=0.01)


def test_nineteen_of_twenty_intervals_hold_the_true_rating():
    rng, strength, held = np.random.default_rng(5), np.array([0.9, 0.3, 0.0, -1.2]), []
    for _ in range(300):
        wins = np.zeros((4, 4))
        for i in range(4):
            for j in range(i):
                wins[i, j] = rng.binomial(12, 1.0 / (1.0 + np.exp(strength[j] - strength[i])))
                wins[j, i] = 12 - wins[i, j]
        found, true = ratings(wins), MEAN + POINTS * (strength - strength.mean())
        held.append((found.low <= true) & (true <= found.high))
    assert 0.93 < np.mean(held) < 0.98


def test_who_won_all_heats_has_a_finite_rating_and_who_met_nobody_has_none():
    found = ratings(np.array([[0, 6, 0], [0, 0, 0], [0, 0, 0]]))
    assert np.isfinite(found.value[:2]).all() and found.low[0] < found.value[0] < found.high[0]
    assert np.isnan([found.value[2], found.low[2], found.high[2]]).all()


def test_the_standings_are_by_points_and_then_by_wins():
    def car(planner, position, **given):
        plain = {"position": position or 9, "finished": bool(position), "points": 0, "overtakes": 0, "contacts": 0,
                 "at_fault": 0, "end_reason": "finished" if position else "crash"}  # fmt: skip
        return CarFigures(planner=planner, **plain | given)

    def heat(*cars):
        place = {"planner": " | ".join(car.planner for car in cars)}
        return RunRow(key="", place=place, setup={}, course_sha256="", origins=(), cars=cars)

    first, second, third = League.make_cells([heat(car("a", 2), car("b", 1, points=1)),
                                              heat(car("b", None), car("a", 1, points=1, contacts=2, at_fault=1)),
                                              heat(car("c", None), car("a", 1, points=1)),
                                              heat(car("c", None), car("b", None, end_reason="planner_failed"))])
    assert [(each["planner"], each["place"], each["points"]) for each in (first, second, third)] == [("a", 1, 2),
        ("b", 2, 1), ("c", 3, 0)]  # fmt: skip
    assert [first[name] for name in ("runs", "wins", "incidents", "at_fault")] == [3, 2, 2, 1]
    assert second["failures"] == 1 and second["finished"] == 1
    assert first["rating"] == pytest.approx(second["rating"])  # each beat the other once
    assert second["rating"] > third["rating"]


def test_each_group_drives_from_each_place_and_seeds_follow_the_planner():
    entries = [fg.Entry(controller=each) for each in ("gap_finder", "pure_pursuit", "wall_follow")]
    noisy = [replace(entry, effects=fg.LidarEffects(range_noise_std=0.01)) for entry in entries]

    def heats(cars, planners, *tracks):
        base = Setup(entries=(entries[0], replace(entries[0], name="other")), rules="roboracer_2026")
        group = Group(name="all", base=base, axes={"track": tracks}, seeds=(1, 2), heats=cars)
        return plan(Suite(name="league", groups=(group,)), planners)

    plain = heats(2, entries, "oval", "fast")
    assert len(plain) == 2 * 3 * 2 and {heat.place["seed"] for heat in plain} == {None}
    drawn = heats(3, noisy, "oval")
    assert [heat.planners for heat in drawn[::2]] == [("gap_finder", "pure_pursuit", "wall_follow"),
                                                      ("pure_pursuit", "wall_follow", "gap_finder"),
                                                      ("wall_follow", "gap_finder", "pure_pursuit")]  # fmt: skip
    seeds = [{entry.name: entry.seed for entry in heat.setup.entries} for heat in drawn]
    assert seeds[0] == seeds[2] == seeds[4] and len({*seeds[0].values(), *seeds[1].values()}) == 6


def test_a_car_has_a_point_for_each_that_finished_later_or_not_at_all():
    opponents = ["wall_follow", fg.Entry(controller="mine.py:Stands", start=fg.Start(s=-4.0, offset=0.7))]
    result = fg.race("oval", "gap_finder", laps=1, opponents=opponents, grid="behind", time_limit=12.0)
    cars = [car_figures(result, place, car.name, None) for place, car in enumerate(result.cars)]
    assert [car.finished for car in cars] == [True, True, False]
    by_position = sorted(cars, key=lambda car: car.position)
    assert [car.points for car in by_position] == [2, 1, 0] and [car.started for car in cars] == [1, 2, 3]


def test_a_suite_of_heats_sets_all_cars_as_its_group_says(here):
    (here / "cup.toml").write_text(
        'laps = 1\nrules = "roboracer_2026"\n[[groups]]\nname = "wet"\ntrack = "oval"\nheats = 2\nmu = [0.5, 0.7]\n'
    )
    heats = plan(read_suite("cup.toml"), ["gap_finder", "wall_follow"])
    assert [[entry.mu for entry in heat.setup.entries] for heat in heats] == [[0.5] * 2] * 2 + [[0.7] * 2] * 2
    assert {(heat.setup.rules, heat.setup.decision_limit) for heat in heats} == {("roboracer_2026", 1.0)}


def test_a_heat_is_proved_by_its_file_by_its_run_folder_and_by_its_hash(here):
    found = league(["mine.py:Stands", "mine.py:Goes"], out="out", keep_runs=True, **SHORT)
    for row in found.rows:
        report = fg.replay(here / "out/runs" / row.name)
        assert report.holds and report.trajectory_sha256 == row.trajectory_sha256
        again = fg.race(Setup.read(here / "out/heats" / f"{row.name}.toml"))
        assert again.trajectory_sha256 == row.trajectory_sha256
    (incident,) = found.rows[0].incidents or found.rows[1].incidents
    assert (incident.at_fault, incident.reason) == ("mine.py:Goes", "ran into a car that stands")
    moving = incident.poses[1 if found.rows[0].incidents else 0]
    touch = round((incident.time_s - incident.first_s) / incident.step_s)
    nose = moving[3 * touch] / 1000.0 + 0.41
    assert incident.x_m == pytest.approx(nose, abs=0.3)  # on the straight of the oval, along x


def test_the_league_is_the_same_with_any_workers_and_goes_on_where_it_was_left(here):
    """One of its planners takes too long for a decision."""
    planners = ["mine.py:Stands", "mine.py:Goes", "mine.py:Hangs"]
    settings = SHORT | {"time_limit": 0.4, "decision_limit": 0.2}
    one = league(planners, out="one", **settings)
    ends = {car.message for row in one.rows for car in row.cars if car.planner == "mine.py:Hangs"}
    assert ends == {"no command within 0.2 s at t = 0.075 s"}
    assert one.runs_driven == 6 and league(planners[:2], out="two", **settings).runs_driven == 2
    two = league(planners, out="two", **settings | {"workers": 2})
    assert two.runs_driven == 4
    kept = [files(here / name) for name in ("one", "two")]
    pages = [folder.pop("league.html").replace(b"one", b"two") for folder in kept]
    assert kept[0] == kept[1] and pages[0] == pages[1]
    lines = (here / "one/runs.jsonl").read_text().splitlines(keepends=True)
    (here / "one/runs.jsonl").write_text("".join(lines[:-1]) + lines[-1][:40])
    assert league(planners, out="one", **settings).runs_driven == 1
    with pytest.raises(RunFolderError, match="holds another league: rules is"):
        league(planners, out="one", rules="none", **settings)
    shutil.rmtree(here / "one")


LOOP = """
import itertools, multiprocessing, sys
from fg_mujoco.addons.arena.runs import turn

multiprocessing.parent_process = lambda: "as in a worker"
turn._LAST_RESORT = 0.1
turn.Turn(sys.argv[1], 0.1)(1)
sum(itertools.repeat(0))
"""


def test_a_planner_that_no_signal_interrupts_ends_with_its_process_and_is_named(tmp_path):
    path = str(tmp_path / "turn")
    ended = subprocess.run([sys.executable, "-c", LOOP, path], check=False)
    assert ended.returncode == -signal.SIGVTALRM and read_turn(path) == 1
