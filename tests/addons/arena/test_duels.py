"""Duels behind slower cars: what counts, who is to blame, lanes in closed form, and suites of them."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from comparison_worlds import PLANNERS
from fg_mujoco.addons.arena.runs.duels import AHEAD_FOR, Duel, Duels, alone, closed_track, pace
from fg_mujoco.addons.arena.runs.run import Origin
from fg_mujoco.addons.arena.runs.slower_cars import (
    LANES,
    OPPONENTS,
    Scaled,
    lane_line,
    least_curvature,
    make_opponent,
    start_on,
)
from fg_mujoco.addons.arena.study.functions import study
from fg_mujoco.addons.arena.study.plan import plan
from fg_mujoco.addons.arena.study.suite import read_suite
from fg_mujoco.cli.main import main
from fg_mujoco.messages import DriveCommand
from fg_mujoco.rollouts.shares import wilson

SUITE = '[[groups]]\nname = "all"\ntrack = "oval"\nopponent = "centreline"\nlaps = 2\nseeds = [0, 1]\n'
EXAMPLES = Path(__file__).parents[3] / "examples" / "scenarios"
CAR = fg.Vehicle.load().parameters


def duel(planner="overtaker", track="oval", opponent="centreline", seed=1, ratio=(0.3, 0.9), *, knows="", **placed):
    place = {"planner": planner, "assist": "full", "course": track, "opponent": opponent}
    if placed:
        place |= {"speed": 0.5, "start_m": 10.0, "headway_m": 3.0, "offset_m": 0.0} | placed
    else:
        place["seed"] = seed
    setup = fg.Setup.of(track, controller=planner, time_limit=place.pop("seconds", None), knows=knows)
    return Duel(place=place, setup=setup, course_sha256="", origins=(Origin(sha256=None),),
                duels=Duels(opponent=[opponent], ratio=ratio, speed=[place["speed"]] if placed else ()))  # fmt: skip


def figures(*arguments, **given):
    row = duel(*arguments, **given).drive()
    return dict(row.figures) | {"message": row.car.message}


@each("successes, count, low, high", [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (85, 100, 0.7672, 0.9069),
                                     (10, 10, 0.7225, 1.0)])  # fmt: skip
def test_intervals_are_wilsons(successes, count, low, high):
    assert wilson(successes, count) == pytest.approx((low, high), abs=1e-4)


def test_the_line_of_least_curvature_keeps_off_the_walls_and_bends_less():
    track = fg.load_track("hairpins")
    line = least_curvature(track, CAR)
    s, offset = track.project(line)
    room = np.where(offset > 0.0, np.interp(s, track.arc_length, track.corridor_left), 0.0)
    room += np.where(offset <= 0.0, np.interp(s, track.arc_length, track.corridor_right), 0.0)
    assert np.all(np.abs(offset) < room - 0.5 * CAR.width - 0.1)

    def bending(points):
        return float((np.diff(points, 2, axis=0) ** 2).sum())

    middle = track.position(np.arange(len(line)) * track.length / len(line), 0.0)
    assert bending(line) < 0.7 * bending(middle)


def test_a_lane_uses_its_part_of_the_room_between_the_walls():
    track, bounds = fg.load_track("oval"), {}
    for lane, (low, high) in LANES.items():
        places, offsets = track.project(lane_line(track, CAR, lane))
        room = np.interp(places, track.arc_length, track.corridor_left, period=track.length) - 0.5 * CAR.width - 0.15
        assert (offsets >= low * room - 0.02).all() and (offsets <= high * room + 0.02).all()
        bounds[lane] = offsets.mean()
    assert bounds["right"] < bounds["middle"] < bounds["left"]
    start = start_on(track, CAR, "left", 5.0)
    assert start.s == pytest.approx(5.0, abs=0.3) and start.offset > 0.1


@each("kind, tolerance", [("reactive", 0.03), ("centreline", 0.15)])
def test_an_opponent_takes_the_longer_the_less_its_ratio(kind, tolerance, tmp_path):
    """The gap finder takes the planner's line, but joins its raceline elsewhere; the centreline is longer."""
    setup = fg.Setup.of("oval", controller="gap_finder")
    track, context = closed_track(setup), setup.first.context(CAR, closed_track(setup).map_line)
    opponent = make_opponent(kind, track, pace(alone(setup)), 0.5, context, tmp_path)
    laps = [fg.race("oval", planner, laps=2).car.lap_times_s[1] for planner in (opponent, "gap_finder")]
    assert laps[0] == pytest.approx(laps[1] / 0.5, rel=tolerance)


def test_the_opponents_speed_is_a_share_of_what_its_planner_commands():
    class Fixed:
        def reset(self):
            self.began = True

        def __call__(self, scan, odometry):
            return DriveCommand(steering_angle=0.2, speed=4.0)

    assert Scaled(Fixed(), 0.6)(None, None) == DriveCommand(steering_angle=0.2, speed=2.4)


def test_all_planners_meet_the_same_opponents():
    draws = [duel(name, opponent="blocking", seed=3).draw(57.0) for name in ("overtaker", "gap_finder")]
    assert draws[0] == draws[1]
    others = [duel("gap_finder", opponent=kind, seed=seed).draw(57.0) for kind in OPPONENTS for seed in range(5)]
    assert len(set(others)) == 20
    assert all(0.3 <= ratio <= 0.9 and 2.0 <= headway <= 10.0 for _, headway, ratio in others)


@each("kind", ["centreline", "blocking"])
def test_an_overtake_is_half_a_length_for_a_second_where_the_cars_are(kind):
    """The lead is worked out once more, from where the cars stand on the map."""
    driven = duel(opponent=kind, ratio=(0.4, 0.5))
    result, watch, _, start = driven.race()
    row, track = driven.drive(), result.world.track
    assert row.figures["outcome"] == "overtaken" and row.trajectory_sha256 == result.trajectory_sha256
    places = [track.project(np.stack([car.column("x_m"), car.column("y_m")], axis=1))[0] for car in result.cars]
    leads = [math.remainder(own - other, track.length) for own, other in zip(*places, strict=True)]
    drawn, headway, _ = driven.draw(track.length)
    assert start == drawn and leads[0] == pytest.approx(-headway, abs=0.02)
    first = next(tick for tick, lead in enumerate(leads) if lead >= 0.5 * CAR.length)
    led_from = result.cars[0].column("time_s")[first]
    assert row.figures["taken_s"] - AHEAD_FOR == pytest.approx(led_from, abs=0.03)
    assert leads[-1] < 2.0 + 8.0 * AHEAD_FOR  # not by a headway besides
    alone = fg.race("oval", "overtaker", start_s=start, laps=3).car
    in_last_tick = watch.driven - result.car.column("progress_m")[-1]
    assert 0.0 < in_last_tick < 8.0 * result.world.lidar.beams.period
    taken = np.interp(watch.driven, alone.column("progress_m"), alone.column("time_s"))
    assert row.figures["time_lost_s"] == pytest.approx(row.figures["taken_s"] - taken, abs=1e-6)


def test_the_overtaker_keeps_behind_where_there_is_no_room(tmp_path):
    """A ring as wide as two and a half cars, and the other in its middle."""
    turns = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
    ring = np.column_stack((6.0 * np.cos(turns), 6.0 * np.sin(turns), np.full((120, 2), 0.4)))
    np.savetxt(tmp_path / "ring.csv", ring, delimiter=",", header="x_m, y_m, w_tr_right_m, w_tr_left_m")
    found = figures(track=str(tmp_path / "ring.csv"), seed=0, ratio=(0.5, 0.5))
    assert (found["outcome"], found["message"]) == ("behind", None)


def test_a_study_of_duels_has_a_cell_of_their_outcomes(tmp_path):
    (tmp_path / "duels.toml").write_text(SUITE)
    found = study(tmp_path / "duels.toml", "overtaker", out=tmp_path / "a", workers=1)
    (cell,) = found.cells
    assert (cell["course"], cell["assist"], cell["runs"]) == ("oval", "none", 2) and "safe" in cell
    assert cell["successes"] == sum(row.figures["outcome"] == "overtaken" for row in found.rows)


def test_a_duel_that_is_decided_is_no_failure_and_its_opponents_line_no_news(tmp_path, capsys):
    (tmp_path / "duels.toml").write_text(SUITE.replace("centreline", "raceline").replace("0, 1", "0"))
    assert main(["study", str(tmp_path / "duels.toml"), "overtaker", "--workers", "1"]) == 0
    said = capsys.readouterr()
    assert "failed" not in said.out and said.err == ""


def test_a_planner_that_knows_its_opponent_is_told_where_it_is(tmp_path):
    told = tmp_path / "told.py"
    told.write_text("from fg_mujoco.messages import DriveCommand\n\n\n"
                    "def plan(scan, odometry):\n    x, y = odometry.readings['opponents'].values[:2]\n"
                    "    return DriveCommand(steering_angle=0.0, speed=float(x == x))\n")  # fmt: skip
    result, *_ = duel(f"{told}:plan", seconds=0.5, knows="opponents", start_m=5.0, opponent="middle").race()
    assert result.car.column("command_speed_m_s")[1:].all() and result.car.planner_failure is None


def test_the_example_has_the_2400_duels_of_its_source_each_once():
    suite = read_suite(EXAMPLES / "overtaking.toml")
    runs = plan(suite, ["overtaker"])
    assert len({run.key for run in runs}) == len(runs) == 50 * 3 * 4 * 4
    assert {run.seconds for run in runs} == {8.0}
    length = fg.load_track("hairpins").length
    starts = sorted({run.place["start_m"] for run in runs if run.place["course"] == "hairpins"})
    assert starts == pytest.approx([length * k / 50 for k in range(50)], abs=1e-6)
    few = plan(suite, ["overtaker"], every=24)
    assert len(few) == 100 and {run.place["speed"] for run in few} == {0.5, 0.6, 0.7, 0.8}
    assert {run.place["opponent"] for run in few} == {"right", "middle", "left"}
    both = plan(replace(suite, assists=("safe", "full")), ["overtaker"], every=24)  # the same lots again, for each
    assert [run.place | {"assist": ""} for run in both] == 2 * [run.place | {"assist": ""} for run in few]


def test_a_planner_that_stands_is_safe_and_behind_and_one_that_rams_is_not(tmp_path):
    planners = tmp_path / "planners.py"
    planners.write_text(PLANNERS)
    placed = {"track": "hairpins", "opponent": "raceline"}
    stood = figures(f"{planners}:Stands", **placed, seconds=2.0)
    assert stood["outcome"] == "behind" and stood["taken_s"] == pytest.approx(2.0) and stood["ahead_m"] < -3.0
    rammed = figures("pure_pursuit", track="hairpins", opponent="middle", speed=0.3)  # which sees nobody
    assert (rammed["outcome"], rammed["to_blame"]) == ("touch", "planner")
    hit = figures(f"{planners}:Gentle[speed=8]", **placed, headway_m=20.0)
    assert hit["outcome"] == "wall" and "hit the" in hit["message"]
    failed = figures(f"{planners}:Broken", **placed, seconds=1.0)
    assert failed["outcome"] == "stopped" and "no more" in failed["message"]


def test_the_overtaker_passes_a_slow_opponent_and_stays_behind_one_that_is_faster_than_it():
    passed = figures(track="hairpins", opponent="raceline", speed=0.5)
    assert passed["outcome"] == "overtaken" and passed["ahead_m"] > 5.0 and passed["taken_s"] == pytest.approx(8.0)
    faster = figures(track="hairpins", opponent="raceline", speed=1.0, headway_m=12.0, seconds=2.0)
    assert faster["outcome"] == "behind"
