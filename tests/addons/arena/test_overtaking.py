"""The overtaking benchmark: what counts, who is to blame, who is ahead, and a folder that is gone on with."""

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
from fg_mujoco.addons.arena.overtaking.overtaking_tables import DIFFERENCES
from fg_mujoco.addons.arena.overtaking.slower_opponents import OPPONENTS, least_curvature, make_opponent
from fg_mujoco.errors import RunFolderError
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.rollouts.rollout_result import wilson
from fg_mujoco.simulation.engine import Engine
from fg_mujoco.simulation.planner_adapter import adapt
from fg_mujoco.simulation.settings import Start

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
