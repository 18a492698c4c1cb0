"""Suites of overtaking scenarios: which a file has, how one ends, lanes in closed form, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.arena.overtaking.duel import DuelSettings
from fg_mujoco.addons.arena.overtaking.scenario import LANES, Scaled, Scenario, ScenarioKey, lane_line, start_on
from fg_mujoco.addons.arena.overtaking.scenario_suite import Suite, plan_suite
from fg_mujoco.cli.main import main
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.planners import ControllerChoice

EXAMPLES = Path(__file__).parents[3] / "examples" / "scenarios"
_CAR = fg.Vehicle.load().parameters
_SETTINGS = DuelSettings(base=fg.Setup(laps=1000))


def scenario(planner="overtaker", *, track="hairpins", lane="raceline", speed=0.5, start=10.0, headway=3.0, offset=0.0,
             seconds=8.0):  # fmt: skip
    key = ScenarioKey(planner, None, track, lane, speed, start, headway, offset)
    return Scenario(key, ControllerChoice.of(planner), _SETTINGS, seconds).drive().figures


def write(tmp_path, text):
    path = tmp_path / "suite.toml"
    path.write_text(text)
    return path


def test_the_example_has_the_2400_scenarios_of_its_source_each_once():
    suite = Suite.read(EXAMPLES / "overtaking.toml")
    keys = [each.key for each in plan_suite(suite, [ControllerChoice.of("overtaker")], _SETTINGS)]
    assert len(set(keys)) == len(keys) == 50 * 3 * 4 * 4
    assert suite.seconds == 8.0
    length = fg.load_track("hairpins").length
    starts = sorted({key.start_m for key in keys if key.track == "hairpins"})
    assert starts == pytest.approx([length * k / 50 for k in range(50)], abs=1e-6)


def test_one_in_so_many_are_drawn_from_all_groups_and_always_the_same():
    suite, planners = Suite.read(EXAMPLES / "overtaking.toml"), [ControllerChoice.of("overtaker")]
    keys = [each.key for each in plan_suite(suite, planners, _SETTINGS, 24)]
    assert len(keys) == 100
    assert {key.speed for key in keys} == {0.5, 0.6, 0.7, 0.8}
    assert {key.lane for key in keys} == {"right", "middle", "left"}
    assert keys == [each.key for each in plan_suite(suite, planners, _SETTINGS, 24)]


def test_a_lane_uses_its_part_of_the_room_between_the_walls():
    track = fg.load_track("oval")
    bounds = {}
    for lane, (low, high) in LANES.items():
        places, offsets = track.project(lane_line("oval", _CAR, lane))
        room = np.interp(places, track.arc_length, track.corridor_left, period=track.length) - 0.5 * _CAR.width - 0.15
        assert (offsets >= low * room - 0.02).all() and (offsets <= high * room + 0.02).all()
        bounds[lane] = offsets.mean()
    assert bounds["right"] < bounds["middle"] < bounds["left"]
    start = start_on("oval", _CAR, "left", 5.0)
    assert start.s == pytest.approx(5.0, abs=0.3) and start.offset > 0.1


def test_the_opponents_speed_is_a_share_of_what_its_planner_commands():
    class Fixed:
        def reset(self):
            self.began = True

        def __call__(self, scan, odometry):
            return DriveCommand(steering_angle=0.2, speed=4.0)

    assert Scaled(Fixed(), 0.6)(None, None) == DriveCommand(steering_angle=0.2, speed=2.4)


def test_a_planner_that_stands_is_safe_and_behind_and_one_that_rams_is_not(tmp_path):
    planners = tmp_path / "planners.py"
    planners.write_text(
        "from fg_mujoco.messages import DriveCommand\n\n\n"
        "def stand(scan, odometry):\n    return DriveCommand(steering_angle=0.0, speed=0.0)\n\n\n"
        "def ram(scan, odometry):\n    return DriveCommand(steering_angle=0.0, speed=8.0)\n\n\n"
        "def fail(scan, odometry):\n    return 1 / 0\n"
    )
    stood = scenario(f"{planners}:stand", seconds=2.0)
    assert stood.outcome == "behind" and stood.time_s == pytest.approx(2.0) and stood.ahead_m < -3.0
    rammed = scenario("pure_pursuit", lane="middle", speed=0.3)  # which sees nobody
    assert (rammed.outcome, rammed.to_blame) == ("touch", "planner")
    hit = scenario(f"{planners}:ram", headway=20.0)
    assert hit.outcome == "wall" and "planner: crash" in hit.message
    failed = scenario(f"{planners}:fail", seconds=1.0)
    assert failed.outcome == "stopped" and "division by zero" in failed.message


def test_the_overtaker_passes_a_slow_opponent_and_stays_behind_one_that_is_faster_than_it():
    passed = scenario(speed=0.5)
    assert passed.outcome == "overtaken" and passed.ahead_m > 5.0 and passed.time_s == pytest.approx(8.0)
    assert scenario(speed=1.0, headway=12.0, seconds=2.0).outcome == "behind"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seconds = 8.0\n", "scenarios is missing, or is no table; accepted: one or more tables [[scenarios]]"),
        ('[[scenarios]]\ntrack = "oval"\n', "scenarios lacks starts"),
        ('[[scenarios]]\ntrack = "oval"\nstarts = 0\n', "starts is 0; accepted: a whole number from 1"),
        ('[[scenarios]]\ntrack = "oval"\nstarts = 1000000000000\n', "accepted: a whole number from 1 to 100000"),
        (f'[[scenarios]]\ntrack = "oval"\nstarts = {"9" * 400}\n', "accepted: whole numbers from -922"),
        (f'[[scenarios]]\ntrack = "oval"\nstarts = 1000\nspeed = [1, 1, 1]\noffset = {[0] * 99}\n', "make 297000"),
        ('[[scenarios]]\ntrack = "oval"\nstarts = 1\nlane = [[1]]\n', "lane [1]; accepted: "),
        ('[[scenarios]]\ntrack = []\nstarts = 1\n', "track is empty; accepted"),
        ('[[scenarios]]\ntrack = "oval"\nstarts = ["a"]\n', "starts has 'a'; accepted"),
        ('[[scenarios]]\ntrack = "oval"\nstarts = 1\nlane = "midle"\n', "did you mean 'middle'?"),
        ('[[scenarios]]\ntrack = "oval"\nstarts = 1\nspeeds = [0.5]\n', "speeds is no key here"),
        ('[[scenarios]]\ntrack = "oval"\nstarts = 1\nspeed = [-0.5]\n', "speed has -0.5; accepted: numbers above 0"),
        ('[[scenarios]]\ntrack = "oval"\nstarts = 1\nheadway = []\n', "headway is empty; accepted"),
        ('[[scenarios]]\ntrack = 3\nstarts = 1\n', "track is 3; accepted: one or more names or paths"),
        ('seconds = -1\n[[scenarios]]\ntrack = "oval"\nstarts = 1\n', "seconds is -1; accepted: 0.1 to 600"),
        ('[[scenarios]]\ntrack = "scene:gap"\nstarts = 1\n', "scene"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_suite_is_refused_in_one_line(tmp_path, capsys, text, said):
    assert main(["scenarios", str(write(tmp_path, text)), "--out", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1 and said in printed
    assert not (tmp_path / "out").exists()
