"""The overtaking benchmark: what counts, who is to blame, who is ahead, and a folder that is gone on with."""

import json
import math
from dataclasses import fields, replace

import numpy as np
import pytest

import fg_mujoco as fg
from comparison_worlds import files
from fg_mujoco.addons.arena.overtaking.duel import (
    AHEAD_FOR,
    Duel,
    DuelFigures,
    DuelKey,
    DuelRow,
    DuelSettings,
    drive_duel,
    pace,
)
from fg_mujoco.addons.arena.overtaking.overtaking import overtake
from fg_mujoco.addons.arena.overtaking.overtaking_tables import DIFFERENCES, make_cells
from fg_mujoco.addons.arena.overtaking.slower_opponents import OPPONENTS, Pace, least_curvature, make_opponent
from fg_mujoco.cli.main import main
from fg_mujoco.errors import RunFolderError, SettingsError, TrackError
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.rollouts.intervals import wilson
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.planner_adapter import adapt
from fg_mujoco.simulation.settings import Start
from refusals import refused

SHORT = {"track": ["oval"], "opponents": ["centreline"], "workers": 1, "pictures": False}


@pytest.mark.parametrize(
    ("successes", "count", "low", "high"),
    [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (85, 100, 0.7672, 0.9069), (10, 10, 0.7225, 1.0)],
)
def test_intervals_are_wilsons(successes, count, low, high):
    assert wilson(successes, count) == pytest.approx((low, high), abs=1e-4)


def test_the_line_of_least_curvature_keeps_off_the_walls_and_bends_less():
    track, car = fg.load_track("hairpins"), fg.World("oval").parameters
    line = least_curvature(track, car)
    s, offset = track.project(line)
    room = np.where(offset > 0.0, np.interp(s, track.arc_length, track.corridor_left), 0.0)
    room += np.where(offset <= 0.0, np.interp(s, track.arc_length, track.corridor_right), 0.0)
    assert np.all(np.abs(offset) < room - 0.5 * car.width - 0.1)

    def bending(points):
        return float((np.diff(points, 2, axis=0) ** 2).sum())

    middle = track.position(np.arange(len(line)) * track.length / len(line), 0.0)
    assert bending(line) < 0.7 * bending(middle)


@pytest.mark.parametrize(("kind", "tolerance"), [("reactive", 0.02), ("centreline", 0.15)])
def test_an_opponent_takes_the_longer_the_less_its_ratio(kind, tolerance, tmp_path):
    """The gap finder takes the planner's line, if it is the planner; the centreline is longer than that line."""
    own = pace("oval", ControllerChoice.of("gap_finder"), DuelSettings())
    world = fg.World("oval")
    context = DuelSettings().context(world)
    opponent = make_opponent(kind, world.track, own, 0.5, context, tmp_path)
    laps = []
    for planners in (
        [opponent],
        [fg.make_controller("gap_finder", car=world.parameters, mu=world.car.mu, max_speed=8.0)],
    ):
        engine = Engine(world, laps=2)
        engine.planners = adapt(planners)
        engine.place([Start()])
        while engine.running.any():
            engine.tick()
        laps.append(float(engine.monitor.lap_times[0, 1]))
    assert laps[0] == pytest.approx(laps[1] / 0.5, rel=tolerance)


def test_a_pace_goes_round():
    own = Pace(np.array([1.0, 9.0]), np.array([2.0, 4.0]), 10.0)
    assert own.at(10.0) == pytest.approx(3.0)
    assert own.at(21.0) == pytest.approx(2.0)


def test_all_planners_meet_the_same_opponents():
    settings = DuelSettings()
    draws = [
        Duel(DuelKey(name, None, "oval", "blocking", 3), ControllerChoice.of(name), settings).draw(57.0)
        for name in ("overtaker", "gap_finder")
    ]
    assert draws[0] == draws[1]
    others = [Duel(DuelKey("a", None, "oval", k, s), None, settings).draw(57.0) for k in OPPONENTS for s in range(5)]
    assert len(set(others)) == 20
    assert all(0.3 <= ratio <= 0.9 and 2.0 <= headway <= 10.0 for _, headway, ratio in others)


@pytest.mark.parametrize("kind", ["centreline", "blocking"])
def test_an_overtake_is_half_a_length_for_a_second_where_the_cars_are(kind):
    """The lead is worked out once more, from where the cars stand on the map."""
    settings = DuelSettings(slowest=0.4, fastest=0.5)
    duel = Duel(DuelKey("overtaker", None, "oval", kind, 1), ControllerChoice.of("overtaker"), settings)
    leads = {}

    def watch(engine):
        track = engine.world.track
        places = [float(track.project([engine.free_joint(row)[0][:2]])[0][0]) for row in (0, 1)]
        leads[engine.time(0)] = math.remainder(places[0] - places[1], track.length)

    found = drive_duel(duel, watch)
    assert found.outcome == "overtaken"
    assert leads[0.0] == pytest.approx(-found.headway_m, abs=0.02)
    half = 0.5 * fg.World("oval").parameters.length
    led = [time for time, lead in leads.items() if lead >= half]
    assert found.time_s - AHEAD_FOR == pytest.approx(led[0], abs=0.03)
    assert leads[max(leads)] < 2.0 + 8.0 * AHEAD_FOR  # not by a headway besides


def test_a_study_goes_on_where_it_stopped(tmp_path):
    first = overtake(["overtaker"], seed=[0], out=tmp_path / "a", **SHORT)
    assert (first.runs_driven, len(first.rows)) == (1, 1)
    longer = overtake(["overtaker"], seed=[0, 1], out=tmp_path / "a", **SHORT)
    assert (longer.runs_driven, len(longer.rows)) == (1, 2)
    assert longer.rows[0] == first.rows[0]
    (cell,) = [cell for cell in longer.cells if cell.track == "all" and cell.opponent == "all"]
    assert cell.duels == 2
    assert {"duels.csv", "duels.jsonl", "manifest.json", "table.csv", "table.md"} <= set(files(tmp_path / "a"))
    with pytest.raises(RunFolderError, match="accepted"):
        overtake(["overtaker"], seed=[0], out=tmp_path / "a", laps=1, **SHORT)


def test_a_damaged_line_is_driven_again(tmp_path):
    first = overtake(["gap_finder"], seed=[0], out=tmp_path, **SHORT)
    path = tmp_path / "duels.jsonl"
    path.write_text(path.read_text().replace('"planner": "gap_finder"', '"planner": "another"'))
    with pytest.warns(UserWarning, match="is damaged"):
        again = overtake(["gap_finder"], seed=[0], out=tmp_path, **SHORT)
    assert again.runs_driven == 1
    same = [
        {name: value for name, value in row.as_dict().items() if not name.startswith("decision")}
        for row in (first.rows[0], again.rows[0])
    ]
    assert same[0] == same[1]


def test_a_planner_that_cannot_drive_is_a_row(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(
        "from fg_mujoco.messages import DriveCommand\n"
        "class Stands:\n"
        "    def reset(self): pass\n"
        "    def __call__(self, scan, odometry): return DriveCommand(steering_angle=0.0, speed=0.0)\n"
    )
    study = overtake(["mine.py:Stands"], seed=[0], out=tmp_path / "out", **SHORT)
    assert study.rows[0].figures.outcome == "failed"
    assert "does not drive two laps" in study.rows[0].figures.message
    assert math.isclose(make_cells(study.rows)[0].share, 0.0)


def test_the_command_is_the_function(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    arguments = ["--track", "oval", "--opponents", "centreline", "--seed", "0:1", "--speed-ratio", ".4:.5"]
    arguments += ["--knows", "opponents"]
    assert main(["overtake", *arguments, "--controller", "gap_finder", "--workers", "1", "--out", "out", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["duels"], summary["table"][0]["planner"]) == (1, "gap_finder")
    assert (tmp_path / "out" / "table.png").is_file()
    assert json.loads((tmp_path / "out" / "manifest.json").read_text("utf-8"))["settings"]["knows"] == "opponents"
    assert main(["overtake", *arguments, "--controller", "gap_finder", "--workers", "1", "--out", "out"]) == 0
    out = capsys.readouterr().out
    assert "1 duels, 1 of them by an earlier call; written to out" in out and "Wilson's at 95 %" in out
    assert (tmp_path / "out" / "differences.csv").read_text("utf-8").count("\n") == 1  # of one planner none
    assert "| median time lost [s] | quartiles [s] | of overtakes | median decision [us] |" in " ".join(out.split())


def test_a_planner_that_knows_its_opponent_is_told_where_it_is():
    settings = DuelSettings(base=fg.Setup(entries=[fg.Entry(knows="opponents")]))
    planner, told = ControllerChoice.of("gap_finder"), []

    def watch(engine):
        told.append((engine.readings(0)["opponents"], engine.odometry["pose"][1].tolist(), engine.readings(1)))
        if len(told) == 20:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        drive_duel(Duel(DuelKey("gap_finder", None, "oval", "raceline", 1), planner, settings), watch)
    for reading, pose, of_opponent in told[1:]:
        assert reading.values[:3].tolist() == pose and not of_opponent


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--speed-ratio", ".9:.3"], "--speed-ratio is 0.9:0.3; accepted: FIRST:LAST, above 0 and at most 1"),
        (["--opponents", "ghost"], "opponent 'ghost'; accepted: centreline, raceline, reactive, blocking"),
        (["--track", "scene:dead_end:0"], "is no circuit; accepted: a closed track"),
        (["--controller", "overtakes"], "overtaker"),
        (["--seed", "1,1"], "seed 1 is given twice"),
    ],
)
def test_what_cannot_be_driven_is_refused_in_a_line(tmp_path, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(tmp_path)
    assert said in refused(tmp_path, capsys, "overtake", *arguments, "--out", "out")


def test_times_lost_are_of_the_overtakes_alone_and_it_is_said_of_how_many():
    nothing = dict.fromkeys(field.name for field in fields(DuelFigures))
    lost = [("overtaken", 1.0), ("overtaken", 2.0), ("overtaken", 6.0), ("overtaken", math.nan), ("behind", 40.0)]
    rows = [
        DuelRow(
            DuelKey("a", None, "oval", "centreline", seed),
            DuelFigures(**nothing | {"outcome": how, "time_lost_s": seconds}),
        )
        for seed, (how, seconds) in enumerate(lost)
    ]
    cell = make_cells(rows)[-1]
    assert (cell.overtaken, cell.time_lost_count) == (4, 3)
    assert (cell.time_lost_s, cell.time_lost_q25_s, cell.time_lost_q75_s) == (2.0, 1.5, 4.0)


def test_differences_are_within_pairs_of_duels():
    nothing = dict.fromkeys(field.name for field in fields(DuelFigures))
    rows = [
        DuelRow(
            DuelKey(planner, None, track, "centreline", seed),
            DuelFigures(**nothing | {"outcome": how, "time_lost_s": seconds + later}),
        )
        for planner, later in (("a", 0.0), ("b", 0.25))
        for track in ("oval", "tight")
        for seed, (how, seconds) in enumerate([("overtaken", 1.0), ("overtaken", 4.0), ("overtaken", 9.0)])
    ]
    rows.append(replace(rows[0], key=replace(rows[0].key, seed=9)))  # which b has not driven
    found = DIFFERENCES.of(rows)
    assert [(each["planner"], each["reference"], each["track"], each["pairs"]) for each in found] == [
        ("b", "a", "all", 6), ("b", "a", "oval", 3), ("b", "a", "tight", 3)
    ]  # fmt: skip
    assert (found[0]["share_difference"], found[0]["time_pairs"], found[0]["time_lost_difference_s"]) == (0.0, 6, 0.25)
    assert (found[0]["time_lost_difference_low_s"], found[0]["time_lost_difference_high_s"]) == (0.25, 0.25)
    assert found[1]["time_lost_difference_low_s"] is None  # of three pairs there is no such interval
    low, high = (f"{100.0 * found[0][f'share_difference_{end}']:+.0f}" for end in ("low", "high"))
    line = " ".join(DIFFERENCES.table(found).markdown().splitlines()[2].split())
    assert line == f"| b | a | 6 | +0 | {low} to {high} | 6 | +0.25 | +0.25 to +0.25 |"
    assert DIFFERENCES.table(()) is None


def test_errors_are_of_the_one_tree():
    with pytest.raises(SettingsError):
        DuelSettings(slowest=0.0)
    with pytest.raises(TrackError):
        overtake(track=["scene:dead_end:0"], out="nowhere", pictures=False)
