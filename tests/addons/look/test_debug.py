"""The reasons that planners tell are right, and `fg-mujoco debug` shows recorded decisions to the bit, and safely."""

import json
import math
import re
import shutil

import numpy as np
import pytest

import fg_mujoco as fg
from browsers import opened
from cases import each
from fg_mujoco.addons.look.debug.decisions import Witness
from fg_mujoco.cli.main import main
from fg_mujoco.controllers.control.steering import pursue
from fg_mujoco.controllers.gap_finder import GapFinder, GapFinderSettings
from fg_mujoco.controllers.perception.scan_filters import valid_ranges, widen_all
from fg_mujoco.controllers.safety.braking_trajectories import BrakingTrajectories
from fg_mujoco.controllers.safety.friction_limiter import EVASIVE, FrictionLimiter
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.car import WHEELS
from pages import MARKUP, Page
from scan_worlds import CAR, MU, corridor, odometry_of, scan_of

LAW = {"assist": "safe"}


def decision(scan, speed=0.0, angle=0.0, mu=MU, top=8.0, **settings):
    """What a planner that has just been made decides, as `debug` looks at it."""
    planner = GapFinder(CAR, mu, top, GapFinderSettings(**settings))
    witness, odometry = Witness(planner, CAR), odometry_of(speed, angle)
    answer = witness.decide(scan, odometry, None)
    return witness.look(0, scan, odometry, answer, answer)


def test_a_wall_ahead_is_held_by_sight_at_the_speed_from_which_the_car_can_stop():
    scan = corridor(1.0, 1.0, ahead=5.0)
    seen = decision(scan, speed=3.0, **LAW)
    trajectories = BrakingTrajectories(CAR, FrictionLimiter(CAR, MU, EVASIVE), 8.0)
    widened = widen_all(valid_ranges(scan.ranges, scan.range_max), scan.angle_increment, trajectories.radius)
    by_hand = trajectories.safe_speed(widened, scan.angle_min, scan.angle_increment, 3.0, 0.0)
    assert 3.0 < by_hand < 8.0
    assert (seen.speed_step.name, seen.speed_step.speed) == ("sight", by_hand)
    assert f"{by_hand:.2f} m/s, chosen by sight" in seen.why_speed


@each("mu", [0.15, 0.3])
def test_a_bend_on_little_grip_is_held_by_the_friction_limiter(mu):
    ranges = np.full(1081, 2.5)
    ranges[720:880] = 9.0  # the opening is to the left
    seen = decision(scan_of(ranges), speed=0.5, mu=mu, assist="limiter", method="refined")
    steering = {step.name: step.steering_angle for step in seen.steps}["planner"]
    bearing = math.atan2(seen.goal[1], seen.goal[0] - CAR.lidar_offset)
    assert steering == pytest.approx(pursue(bearing, 1.0, CAR.lidar_offset, CAR.wheelbase), rel=1e-9)
    law = math.sqrt(CAR.gravity * mu * 0.95 * CAR.wheelbase / math.tan(abs(steering)))
    assert seen.speed_step.name == "friction limiter"
    assert seen.speed_step.speed == pytest.approx(law, rel=1e-12)
    assert law < 3.0


def test_the_safety_filter_brakes_where_no_stop_is_free_and_is_told():
    scan = corridor(1.0, 1.0, ahead=1.2)
    seen = decision(scan, speed=7.0, **LAW)
    assert (seen.speed_step.name, seen.speed_step.speed) == ("safety filter", 0.0)
    without = decision(scan, speed=7.0, assist="mean_range,distance_ahead,sight,limiter")
    assert without.speed_step.name == "sight"
    assert "safety filter" not in {step.name for step in without.steps}


def test_without_a_goal_the_car_brakes_and_says_so():
    seen = decision(scan_of(np.zeros(1081)), speed=2.0, angle=0.1, **LAW)
    assert (seen.speed_step.name, seen.speed_step.speed) == ("no reference", 0.0)
    assert (seen.steering_step.name, seen.steering_step.steering_angle) == ("no reference", 0.1)
    assert seen.goal is None


def test_a_command_beyond_the_car_s_limits_is_held_by_the_car():
    class Wild:
        def reset(self):
            pass

        def __call__(self, scan, odometry):
            return DriveCommand(steering_angle=-1.0, speed=99.0)

    scan, odometry = corridor(1.0, 1.0), odometry_of(1.0, 0.0)
    witness = Witness(Wild(), CAR)
    answer = witness.decide(scan, odometry, None)
    seen = witness.look(0, scan, odometry, answer, answer)
    assert [step.name for step in seen.steps] == ["planner", "clamped by the car"]
    assert (seen.steering_step.steering_angle, seen.speed_step.speed) == (-CAR.max_steering_angle, CAR.max_speed)


@each("course, planner, seconds",
      [("scene:u_turn_trap:3", "gap_finder", 8.0),
       ("serpentine", "follow_the_gap[assist=safe]", 9.0),
       ("hairpins", "pure_pursuit", 4.0)])  # fmt: skip
def test_the_last_step_is_the_recorded_command_to_the_bit(course, planner, seconds):
    race = fg.race(course, planner, laps=1, time_limit=seconds)
    seen = fg.debug(race, window=seconds)
    assert len(seen.decisions) == len(race.car.telemetry) and seen.notes == ()
    commands = np.column_stack([race.car.column(name) for name in ("command_steering_rad", "command_speed_m_s")])
    shown = [(d.command.steering_angle, d.command.speed) for d in seen.decisions]
    answered = [(d.answer.steering_angle, d.answer.speed) for d in seen.decisions]
    told = [(d.steps[-1].steering_angle, d.steps[-1].speed) for d in seen.decisions]
    assert np.array_equal(shown, commands) and np.array_equal(answered, commands) and np.array_equal(told, commands)
    times = race.car.telemetry[:, 0]
    assert [d.time for d in seen.decisions] == times.tolist()
    assert [d.tick for d in seen.decisions] == list(range(len(times)))


RAISES = """
from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.car import WHEELS
class Bad:
    def reset(self): self.n = 0
    def intermediate_scans(self, scan): return {{{name!r}: scan.ranges.clip(0.0, 3.0)}}
    def reasons(self): return [({name!r}, 0.6, 2.0, {name!r}), ("slow start", 0.6, 0.1 * self.n)]
    def motion(self): return [(0.0, 0.0), (1.0, 0.1)]
    def __call__(self, scan, odometry):
        self.n += 1
        open({marker!r}, "w").close()
        if self.n > 8: raise ValueError({name!r})
        return DriveCommand(steering_angle=0.6, speed=0.1 * self.n)
"""


@pytest.fixture
def failed(tmp_path, monkeypatch, without_pictures):
    """A run folder of a planner that raised, and whose every text is markup; tmp_path / "marker" says that it ran."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.py").write_text(RAISES.format(name=MARKUP, marker=str(tmp_path / "marker")))
    assert main(["race", "--controller", "bad.py:Bad", "--out", "run"]) == 1
    (tmp_path / "marker").unlink()
    return tmp_path / "run"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    race = fg.race("oval", "gap_finder", laps=1, time_limit=2.0)
    return fg.write_run(race, tmp_path_factory.mktemp("runs") / "oval", picture=False)


def test_no_planner_of_a_run_is_imported_that_is_not_named(failed, capsys):
    capsys.readouterr()
    assert main(["debug", str(failed)]) == 0
    assert "accepted: --controller bad.py:Bad" in capsys.readouterr().err
    assert not (failed.parent / "marker").exists()
    seen = fg.debug(failed)
    assert [set(d.scans) for d in seen.decisions] == [{"raw"}] * 9
    assert seen.decisions[-2].command.speed == 0.8 and seen.decisions[-2].answer is None


def test_a_failed_planner_is_shown_with_its_exception_at_the_end(failed, capsys):
    seen = fg.debug(failed, controller="bad.py:Bad")
    assert (failed.parent / "marker").exists() and seen.notes == ()
    assert seen.chosen is seen.decisions[-1] and seen.chosen.command is None
    assert "ValueError" in seen.chosen.failure and "bad.py" in seen.chosen.failure
    assert seen.chosen.time == json.loads((failed / "summary.json").read_text())["planner_failure"]["time_s"]
    before = seen.decisions[-2]
    assert before.answer == before.command
    assert (before.speed_step.name, before.speed_step.speed) == ("slow start", 0.8)
    assert before.steering_step.name == "clamped by the car"
    assert before.scans["raw"].max() > 3.0 and len(before.motion) == 2


def test_a_planner_that_answers_otherwise_is_not_shown_as_the_one_that_raced(folder, tmp_path):
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    summary = json.loads((copy / "summary.json").read_text())
    (copy / "summary.json").write_text(json.dumps(summary | {"planner_settings": {"clearance": 0.4}}))
    (note,) = fg.debug(copy, controller="gap_finder").notes
    assert "answers now another command" in note
    (note,) = fg.debug(copy, controller="no_such_planner").notes
    assert "no_such_planner" in note


def test_no_text_of_a_run_or_of_its_planner_becomes_markup(failed):
    summary = json.loads((failed / "summary.json").read_text())
    summary["track"] = summary["vehicle"] = summary["end_reason"] = MARKUP
    (failed / "summary.json").write_text(json.dumps(summary))
    seen = fg.debug(failed, controller="bad.py:Bad")
    page = seen.write_page(failed / "page.html").read_text("utf-8")
    parsed = Page(page)
    assert "<script>alert" not in page and "<img" not in page and parsed.loads == []
    assert len(parsed.scripts) == 2 and parsed.runs_its_own_scripts_alone()
    assert "default-src 'none'" in parsed.policy and "unsafe-eval" not in parsed.policy
    assert page.count("&lt;script&gt;alert(1)") >= 2


def test_keys_step_through_the_decisions_in_a_browser(folder, tmp_path, page_of):
    seen = fg.debug(folder, at=1.0, window=1.0, controller="gap_finder")
    path = seen.write_page(tmp_path / "debug.html")
    with opened(page_of, path) as page:

        def shown():
            return int(page.get_attribute("#moment", "data-tick"))

        def check(place):
            each = seen.decisions[place]
            assert shown() == each.tick
            command = json.loads(page.get_attribute("#moment", "data-command"))
            assert command == [each.command.steering_angle, each.command.speed]  # to the last bit
            assert page.inner_text("#speed") == f"{each.command.speed:.2f} m/s"
            assert page.inner_text("#speed_by") == each.speed_step.name
            assert page.inner_text("#speed_why") == each.why_speed

        check(20)
        page.keyboard.press("ArrowRight")
        check(21)
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("ArrowLeft")
        check(19)
        page.keyboard.press("Shift+ArrowRight")
        check(29)
        page.keyboard.press("End")
        page.keyboard.press("ArrowRight")
        check(39)
        page.keyboard.press("Home")
        check(0)
        page.click("#forward")
        check(1)
        page.click("#back")
        check(0)
        page.fill("#slider", "7")
        check(7)
        before = page.locator("#top").screenshot()
        page.click("[data-switch='zoom'][value='3']")
        assert page.locator("#top").screenshot() != before


class Skids:
    """Spins its wheels up on wet ground, and then steers."""

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        return DriveCommand(steering_angle=0.4 if odometry.stamp > 1.0 else 0.0, speed=8.0)


def in_page(path):
    """Return the data of a page."""
    return json.loads(re.search(r'id="report-data">(.*?)</script>', path.read_text("utf-8"), re.DOTALL)[1])


def test_for_every_planner_the_page_has_how_the_car_moves(tmp_path, page_of):
    for planner in ("gap_finder", Skids()):  # whose page is opened, too
        race = fg.race("oval", planner, laps=1, time_limit=1.6, mu=0.4)
        path = fg.debug(race, at=1.2, window=0.4).write_page(tmp_path / "debug.html")
        data, column = in_page(path), race.car.column
        for place, told in enumerate(data["decisions"]):
            tick, (ground, sideslip, tires) = told["tick"], told["motion_of_car"]
            assert ground == pytest.approx(math.hypot(column("vx_m_s")[tick], column("vy_m_s")[tick]), abs=1e-4)
            assert sideslip == pytest.approx(column("sideslip_rad")[tick], abs=1e-5)
            for (slide, use), wheel in zip(tires, WHEELS, strict=True):
                assert slide == pytest.approx(column(f"slide_{wheel}_m_s")[tick], abs=1e-4)
                assert use == pytest.approx(column(f"friction_utilisation_{wheel}")[tick], abs=1e-3)
            now = data["before"] + place
            driven = np.array(data["driven"][now - data["ahead"] : now + data["ahead"] + 1])
            there = slice(tick - 20, tick + 21)
            assert driven == pytest.approx(np.column_stack((column("x_m")[there], column("y_m")[there])), abs=1e-3)
    tick = data["decisions"][data["at"]]["tick"]
    with opened(page_of, path) as page:
        rows = dict(page.eval_on_selector_all("table.motion tbody tr", "r => r.map(e => e.innerText.split('\\t'))"))
        assert rows["speed of the odometry"] == f"{data['decisions'][data['at']]['speed']:.2f} m/s"
        assert rows["sideslip"] == f"{math.degrees(column('sideslip_rad')[tick]):.1f}°"
        slides = page.locator("table.tires td.slides").count()
    assert slides == sum(column(f"slide_{wheel}_m_s")[tick] > 0.01 for wheel in WHEELS) > 0


def test_a_failed_decision_shows_its_exception_as_text_in_a_browser(failed, page_of):
    path = fg.debug(failed, controller="bad.py:Bad").write_page(failed / "debug.html")
    with opened(page_of, path) as page:
        assert MARKUP in page.inner_text("#failure") and page.inner_text("#speed") == "none"
        page.keyboard.press("ArrowLeft")
        assert not page.is_visible("#failure")
        assert page.inner_text("#speed_by") == "slow start" and MARKUP in page.inner_text("#steps")
        assert MARKUP[:50] in page.inner_text("#layers")
        assert page.locator("img").count() == 0
