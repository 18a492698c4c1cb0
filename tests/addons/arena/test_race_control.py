"""Races of several cars: who touched whom, who passed whom, what the rules make of it, and what is left on disk."""

from __future__ import annotations

import json

import numpy as np
import pytest

from cases import each
from fg_mujoco import Entry, Start, race, read_run, replay, write_run
from fg_mujoco.addons.arena.race_control.race_control import OVERTAKE_HELD, OVERTAKE_LEAD
from fg_mujoco.cli.main import main
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.run_folder import SUMMARY


class Straight:
    """Drives ahead at one speed, steering by a fixed angle."""

    speed = 1.0
    steering_angle = 0.0

    def __init__(self, speed=1.0, brakes_at=1e9):
        self._speed, self._brakes_at = speed, brakes_at

    def __call__(self, scan, odometry):
        speed = self._speed if scan.stamp < self._brakes_at else 0.0
        return DriveCommand(steering_angle=0.0, speed=speed)

    def reset(self):
        """Nothing is remembered."""


class Raises(Straight):
    """Fails after half a second."""

    def __call__(self, scan, odometry):
        if scan.stamp > 0.5:
            raise ValueError("out of ideas")
        return super().__call__(scan, odometry)


def entry(name, speed, s, offset=0.0, **more):
    """Return a car that drives straight on, from `s` and `offset` [m]."""
    return Entry(name=name, controller=Straight(speed, **more), start=Start(s=s, offset=offset), max_speed=8.0)


@pytest.fixture(scope="module")
def overtaken():
    """A race in which one car passes another beside it, and nobody touches anybody."""
    entries = [entry("slow", 0.5, 1.5, -0.4), entry("fast", 1.5, 0.0, 0.4)]
    return race("oval", entries=entries, laps=1, time_limit=4.0)


def test_a_touch_on_a_course_whose_bends_have_sections_is_judged():
    """The table of such a course has more rows than that of its line."""
    (contact,) = race("l_corridor", entries=[entry("slow", 0.3, 1.5), entry("fast", 1.5, 0.0)], time_limit=2.0).contacts
    assert contact.at_fault == "fast"


def test_an_overtake_is_half_a_length_ahead_held_for_a_second(overtaken):
    (overtake,) = overtaken.overtakes
    assert (overtake.by, overtake.of) == ("fast", "slow")
    slow, fast = overtaken.cars
    lead = fast.column("progress_m") - slow.column("progress_m")
    time = slow.column("time_s")
    needed = OVERTAKE_LEAD * overtaken.world.car.parameters.length
    assert lead[time < overtake.time_s - 0.03].max() < needed
    assert lead[time > overtake.time_s + 0.03].min() > needed
    assert time[-1] > overtake.time_s + OVERTAKE_HELD
    assert overtaken.contacts == ()
    assert [car.position for car in (fast, slow)] == [1, 2]


def test_a_contact_has_its_closing_speed_its_impulse_and_whose_fault_it_was():
    result = race("oval", entries=[entry("ahead", 0.5, 1.2), entry("behind", 2.0, 0.0)], laps=1, time_limit=2.0)
    contact = result.contacts[0]
    assert contact.cars == ("ahead", "behind")
    assert contact.at_fault == "behind"
    ahead, behind = result.cars
    before = int(np.searchsorted(ahead.column("time_s"), contact.time_s))
    closing = behind.column("vx_m_s")[before] - ahead.column("vx_m_s")[before]
    assert contact.closing_speed_m_s == pytest.approx(closing, abs=0.02)
    # what the impulse is at least: both go on together afterwards, and drive against each other meanwhile
    mass = result.world.car.parameters.mass
    assert contact.impulse_Ns > 0.5 * mass * closing
    assert ahead.collisions_car == behind.collisions_car == len(result.contacts)
    assert (ahead.collisions_wall, behind.collisions_wall) == (0, 0)


def test_the_one_that_brakes_into_another_or_reverses_is_at_fault():
    result = race("oval", entries=[entry("backs", -1.0, 1.5), entry("stands", 0.0, 0.0)], laps=1, time_limit=2.5)
    assert result.contacts[0].at_fault == "backs"


@pytest.fixture(scope="module")
def warned():
    """A race in which a car drives into another again and again, under the rules."""
    entries = [entry("stands", 0.0, 3.5), entry("rams", 3.0, 0.0)]
    return race("oval", entries=entries, laps=1, time_limit=20.0, rules="roboracer_2026")


def test_behind_a_car_that_drives_on_it_is_3_metres_and_a_replay_knows(tmp_path):
    entries = [entry("drives", 1.0, 3.0), entry("rams", 4.0, 0.0)]
    result = race("oval", entries=entries, laps=1, time_limit=4.0, rules="roboracer_2026")
    drives, rams = result.cars
    at = result.restarts[0].tick
    gap = drives.column("progress_m")[at] - rams.column("progress_m")[at]
    assert gap == pytest.approx(3.0 + result.world.car.parameters.length, abs=0.15)
    assert drives.end_reason == "time_limit"
    write_run(result, tmp_path / "run", picture=False)  # which does not say what the time limit was
    report = replay(tmp_path / "run")
    assert report.holds, report.lines


def test_the_rules_warn_put_back_and_disqualify(warned):
    assert [warning.car for warning in warned.warnings] == ["rams"] * 3
    assert all(contact.displacement_m >= 0.05 for contact in warned.contacts[:1])
    stands, rams = warned.cars
    assert rams.end_reason == "disqualified"
    assert len(warned.restarts) == 2  # the third warning ends the race
    for restart in warned.restarts:
        at = restart.tick  # the first row of telemetry behind it
        gap = stands.column("progress_m")[at] - rams.column("progress_m")[at]
        assert gap == pytest.approx(2.0 + warned.world.car.parameters.length, abs=0.15)


@pytest.mark.slow
def test_a_race_with_restarts_replays_to_the_bit(warned, tmp_path):
    write_run(warned, tmp_path / "run", picture=False)
    report = replay(tmp_path / "run")
    assert report.holds, report.lines
    assert {"contacts", "overtakes", "warnings", "restarts", "cars"} <= set(report.proved[SUMMARY])
    run = read_run(tmp_path / "run")
    assert np.array_equal(run.others[0], warned.cars[1].telemetry, equal_nan=True)


@pytest.mark.slow
@each("key", ["contacts", "cars"])
def test_a_forged_figure_of_another_car_is_told(warned, tmp_path, key):
    write_run(warned, tmp_path / "run", picture=False)
    path = tmp_path / "run" / SUMMARY
    summary = json.loads(path.read_text("utf-8"))
    if key == "contacts":
        summary["contacts"][0]["at_fault"] = "stands"
    else:
        summary["cars"][1]["max_slide_m_s"] = 0.0
    path.write_text(json.dumps(summary), encoding="utf-8")
    report = replay(tmp_path / "run")
    assert [difference.name for difference in report.differences] == [f"{SUMMARY}, {key}"]


def test_a_planner_that_fails_stops_its_own_car_and_the_others_race_on():
    entries = [entry("drives", 1.0, 3.0), Entry(name="fails", controller=Raises(1.0), start=Start())]
    result = race("oval", entries=entries, laps=1, time_limit=3.0)
    drives, fails = result.cars
    assert (drives.end_reason, fails.end_reason) == ("time_limit", "planner_failed")
    assert fails.planner_failure is not None
    assert "out of ideas" in str(fails.planner_failure)
    assert fails.end_time_s == fails.planner_failure.time_s == pytest.approx(0.5)
    assert abs(fails.column("speed_m_s")[-1]) < 0.01  # it has braked, and stands there
    assert result.car.planner_failure is None


def test_a_mixed_field_has_its_vehicles_and_tires_and_can_start_behind(tmp_path, capsys, without_pictures):
    own = ["--opponent-vehicle", "nuc2", "--opponent-vehicle", "f1tenth", "--opponent-tires", "f1tenth_gym"]
    out = tmp_path / "run"
    arguments = ["race", "--time-limit", ".5", "--opponents", "wall_follow", "--opponents", "gap_finder", *own]
    assert main([*arguments, "--grid", "behind", "--out", str(out)]) == 1  # not driven to its end
    capsys.readouterr()
    run = read_run(out)
    first, second, third = run.summary["cars"]
    assert [car["vehicle"] for car in (first, second, third)] == ["f1tenth", "nuc2", "f1tenth"]
    assert [car["tires"] for car in (second, third)] == ["f1tenth_gym"] * 2 != first["tires"]
    assert [car["start"]["s"] for car in (first, second, third)] == pytest.approx([0.0, 1.6, 0.8])
    assert replay(out).holds


def test_a_race_with_opponents_on_the_command_line_can_be_raced_again(tmp_path, capsys, without_pictures):
    out = tmp_path / "run"
    arguments = ["race", "--time-limit", "2", "--laps", "1", "--opponents", "wall_follow", "--opponent-max-speed", "2"]
    assert main([*arguments, "--out", str(out)]) == 1  # not driven to its end
    assert "car_1" in capsys.readouterr().out
    again = tmp_path / "again"
    assert main(["race", "--config", str(out), "--out", str(again)]) == 1
    hashes = [json.loads((folder / SUMMARY).read_text("utf-8"))["trajectory_sha256"] for folder in (out, again)]
    assert hashes[0] == hashes[1]
