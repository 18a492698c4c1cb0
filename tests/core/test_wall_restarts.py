"""The rules autodrive_2026: a car that touches a wall starts again at the last checkpoint, ten times at most."""

import math

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import main
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.rules import RULES

_RULES = RULES["autodrive_2026"]


def straight_on(scan, odometry):
    """Drive at 4 m/s with the wheels a little to the left, which ends at a wall."""
    return DriveCommand(steering_angle=0.02, speed=4.0)


class StraightOnOnce:
    """The planner gap_finder, but for the time from 3.0 to 3.3 s, in which it goes straight on."""

    def __init__(self):
        car = fg.Vehicle.load().parameters
        self._planner = fg.make_controller("gap_finder", car=car, mu=1.0489, max_speed=8.0)

    def reset(self):
        self._planner.reset()

    def __call__(self, scan, odometry):
        command = self._planner(scan, odometry)
        return DriveCommand(steering_angle=0.4, speed=4.0) if 3.0 <= scan.stamp < 3.3 else command


def test_a_car_that_touches_a_wall_starts_again_standing_at_the_checkpoint_that_it_passed_last():
    result = fg.race("oval", controller=straight_on, laps=1, rules="autodrive_2026", time_limit=30.0)
    apart = fg.load_track("oval").length / _RULES.checkpoints
    progress, speed, time = (result.car.column(name) for name in ("progress_m", "speed_m_s", "time_s"))
    assert len(result.restarts) >= 3
    for restart in result.restarts:
        before = progress[restart.tick - 1] + 0.1  # [m] of the tick in which it touched
        assert restart.s_m == pytest.approx(math.floor(before / apart) * apart, abs=1e-6)
        if restart.tick < len(time):
            assert progress[restart.tick] == pytest.approx(restart.s_m, abs=0.05)
            assert abs(speed[restart.tick]) < 1e-9


def test_the_eleventh_touch_disqualifies():
    result = fg.race("oval", controller=straight_on, laps=1, rules="autodrive_2026")
    assert result.car.end_reason == "disqualified"
    assert len(result.restarts) == len(result.warnings) == _RULES.most_wall_contacts == 10
    assert result.car.collisions_wall == 11
    assert result.warnings[-1].reason == "contact 10 with a wall: 10 s, and back to the last checkpoint"
    without = fg.race("oval", controller=straight_on, laps=1)
    assert (without.car.end_reason, without.car.collisions_wall) == ("crash", 1)


def test_a_lap_goes_on_after_a_touch_and_its_time_runs_through():
    clean = fg.race("oval", controller="gap_finder", laps=2)
    result = fg.race("oval", controller=StraightOnOnce(), laps=2, rules="autodrive_2026")
    assert result.car.finished and result.car.collisions_wall == len(result.restarts) == 1
    assert sum(result.car.lap_times_s) == pytest.approx(result.car.end_time_s, abs=0.025)
    assert result.car.lap_times_s[0] > clean.car.lap_times_s[0] + 0.3


def test_a_race_without_a_touch_is_the_same_with_the_rules():
    plain, ruled = (fg.race("oval", laps=1, rules=rules) for rules in ("none", "autodrive_2026"))
    assert ruled.trajectory_sha256 == plain.trajectory_sha256
    assert ruled.car.lap_times_s == plain.car.lap_times_s


def test_two_cars_are_put_back_each_to_its_own_checkpoint():
    entries = [fg.Entry(controller=straight_on, name="a"), fg.Entry(controller="gap_finder", name="b")]
    result = fg.race("oval", entries=entries, laps=1, rules="autodrive_2026")
    assert {restart.car for restart in result.restarts} == {0}
    assert result.cars[1].finished and result.cars[1].collisions_wall == 0


@pytest.mark.usefixtures("without_pictures")
def test_a_race_with_restarts_is_proven_by_replay_and_told_with_its_penalties(tmp_path, capsys):
    planner = tmp_path / "straight_on.py"
    planner.write_text(
        "from fg_mujoco.messages import DriveCommand\n\n\n"
        "def straight_on(scan, odometry):\n    return DriveCommand(steering_angle=0.02, speed=4.0)\n"
    )
    out = str(tmp_path / "run")
    options = ["--controller", f"{planner}:straight_on", "--rules", "autodrive_2026", "--laps", "1", "--out", out]
    assert main(["race", *options]) == 1
    said = capsys.readouterr().out
    seconds = fg.read_run(out).summary["sim_time_s"]
    assert f"collisions        11: 110 s of penalties, {seconds + 110.0:.2f} s in all" in said
    assert fg.replay(out).holds
