"""Labs of a course: each kind of check has planners that pass and that trip it; files that fail; the bundled labs."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from comparison_worlds import PLANNERS, recorded_here
from fg_mujoco.addons.arena.runs import graded_drive, recorded_commands
from fg_mujoco.addons.arena.runs.checks import CHECKS, nearest_distances
from fg_mujoco.addons.arena.runs.checks import Drive as CheckedDrive
from fg_mujoco.addons.arena.study.functions import study
from fg_mujoco.addons.arena.study.suite import read_suite
from fg_mujoco.cli.main import main
from fg_mujoco.course.course import outline
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.racing.race import race_setup
from fg_mujoco.racing.resolved import ground_of

LABS = Path(__file__).parents[3] / "examples/labs"
FILES = {"good.py": "from fg_mujoco.messages import STOP\n\nclass Stops:\n    def reset(self): pass\n"
         "    def __call__(self, scan, odometry): return STOP\n", "syntax.py": "def (:\n",
         "raises.py": "def plan(scan, odometry):\n    return 1 / 0\n",
         "answers.py": "def plan(scan, odometry):\n    return 'left'\n",
         "late.py": "from fg_mujoco.messages import STOP\n\ndef plan(scan, odometry):\n"
         "    if scan.stamp > 0.1: raise ValueError('late')\n    return STOP\n",
         "hangs.py": "import time\n\ndef plan(scan, odometry):\n    time.sleep(30.0)\n",
         "kills.py": "import os, signal\n\ndef plan(scan, odometry):\n    os.kill(os.getpid(), signal.SIGKILL)\n",
         "exits.py": "import sys\nsys.exit(7)\n", "empty.py": "",
         "two.py": "class One:\n    def reset(self): pass\n    def __call__(self, scan, odometry): pass\n\n"
         "class Two(One): pass\n"}  # fmt: skip
WALL = "obstacles = [{kind = 'box', x = 5.0, y = 0.0, length = 0.2, width = 2.0}]"
AMONG = "opponents = ['mine.py:Steady[speed=1]']\ntime_limit = 3\nlaps = 1\ngrid = 'behind'"
CORRIDOR = "track = 'scene:corridor_sparse:0'\nlaps = 1"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PLANNERS)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def patch_record(monkeypatch, apart=lambda planner: False):
    """Let planners be driven in this process, but for those that are said to have one of their own."""
    each_own = recorded_commands.record

    def record(planner, setup):
        return (each_own if apart(planner) else recorded_here)(planner, setup)

    monkeypatch.setattr(graded_drive, "record", record)


def verdicts(lab, planner):
    """What the checks of a lab say of a planner that is raced here, without a process of its own."""
    found, suite = [], read_suite(lab)
    (assist,) = suite.assists
    for group in suite.groups:
        choice = ControllerChoice.of(planner)
        first = replace(
            group.base.first, controller=choice.source, planner_settings=dict(choice.settings), assist=assist
        )
        result = race_setup(replace(group.base, entries=(first, *group.base.entries[1:])))
        drive = CheckedDrive(result=result, ground=ground_of(group.base))
        found += [(each.points, each.check.judge(drive)) for each in group.checks]
    return found


@each("kind, own, drive, good, bad, measured",
      [("finishes", "", CORRIDOR, "gap_finder", "mine.py:Steady", "0 of 1 in"),
       ("no_crash", "", CORRIDOR, "gap_finder", "mine.py:Steady[steering=0.2]", "crash: hit"),
       ("no_crash", "least_progress_m = 2", "time_limit = 2", "mine.py:Steady", "mine.py:Steady[speed=0]",
        "but only 0.0 m driven"),
       ("no_slide", "least_progress_m = 3\nmost_share = 0.2", "time_limit = 2", "mine.py:Steady",
        "mine.py:Steady[speed=8,steering=0.4]", "% of the time"),
       ("lap_time", "most_s = 9.78", "laps = 1", "follow_the_gap", "pure_pursuit", "best lap 9.8"),
       ("mean_speed", "least_m_s = 1.5\nleast_progress_m = 1", "time_limit = 2", "mine.py:Steady",
        "mine.py:Steady[speed=1]", "0.9"),
       ("keeps_clear", "least_m = 0.3\nleast_progress_m = 3", "time_limit = 2", "mine.py:Steady",
        "mine.py:Steady[steering=0.05]", "at the nearest"),
       ("follows_wall", "distance_m = 1.1\nwithin_m = 0.2\nleast_progress_m = 4\nafter_m = 0.5", "time_limit = 3",
        "mine.py:Steady", "mine.py:Steady[steering=0.05]", "of the time, mostly"),
       ("stops_before", "least_speed_m_s = 1.9\nmost_m = 0.8", f"{WALL}\ntime_limit = 4",
        "mine.py:Steady[brakes_at=2.0]", "mine.py:Steady[brakes_at=1.0]", "stands 2."),
       ("stops_before", "least_speed_m_s = 1.9", f"{WALL}\ntime_limit = 3", "mine.py:Steady[brakes_at=2.1]",
        "mine.py:Steady", "does not stand: crash: hit obstacle"),
       ("stopping_distance", "from_m_s = 1.9\nmost_m = 0.5", "time_limit = 3", "mine.py:Steady[brakes_at=1]",
        "mine.py:Steady[brakes_at=1,slows=2]", "1.0"),  # 1.9^2 / (2 * 2) = 0.90, and up to 1.9 * 0.1 of the servo's lag
       ("stopping_distance", "from_m_s = 1.9\nmost_m = 0.5", "time_limit = 2", "mine.py:Steady[brakes_at=1]",
        "mine.py:Steady", "does not stop: time limit"),
       ("wins", "", "opponents = ['mine.py:Steady[speed=0.2]']\ntime_limit = 8\n" + CORRIDOR, "gap_finder",
        "mine.py:Steady[speed=0]", "time limit"),
       ("no_fault", "least_progress_m = 1", AMONG, "mine.py:Steady[speed=0.8]", "mine.py:Steady[speed=4]",
        "1 of 1 contacts: ran into the car ahead")])  # fmt: skip
def test_each_check_has_a_planner_that_passes_and_one_that_trips_it(kind, own, drive, good, bad, measured):
    text = f"assists = ['full']\n[[checks]]\ncheck = '{kind}'\npoints = 3\n{own}\n{drive}\n"
    Path("lab.toml").write_text(text)
    ((points, passed),), ((_, tripped),) = verdicts("lab.toml", good), verdicts("lab.toml", bad)
    assert points == 3.0 and passed.passed, passed.measured
    assert not tripped.passed and measured in tripped.measured


@settings(max_examples=25)
@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=5),
       st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=3, max_size=5))  # fmt: skip
def test_the_distance_from_a_wall_is_that_to_the_nearest_of_many_points_of_it(points, corners):
    segments, shares = outline(np.array(corners)), np.linspace(0.0, 1.0, 401)
    along = segments[:, None, :2] + shares[:, None] * (segments[:, None, 2:] - segments[:, None, :2])
    expected = [min(math.dist(point, each) for each in along.reshape(-1, 2)) for point in points]
    assert nearest_distances(np.array(points), segments) == pytest.approx(expected, abs=0.02)


LAB = """
name = "A lab"
laps = 1
time_limit = 0.2
decision_limit = 0.3
passing = 2

[[checks]]
check = "no_crash"
least_progress_m = 0
points = 2

[[checks]]
check = "finishes"
track = "fast"
"""
ONE = LAB.partition("\n[[checks]]\ncheck = \"finishes\"")[0]


def test_a_file_that_fails_in_any_way_has_no_points_and_a_reason_and_the_others_go_on(here, capsys, monkeypatch):
    (here / "lab.toml").write_text(ONE)
    apart = ("raises.py", "hangs.py", "kills.py", "exits.py")
    patch_record(monkeypatch, lambda planner: planner in apart)
    planners = [*FILES, "nothing.py", "two.py:Two", "gap_finder[wide=2]"]
    assert main(["study", "lab.toml", *planners, "--out", "out", "--workers", "1", "--json"]) == 1
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    table = {row["planner"]: row for row in json.loads(out)["table"] if row["check"] == "all"}
    assert table["good.py"]["points"] == 2 and table["good.py"]["measured"] is None
    page = (here / "out" / "table.html").read_text()
    for planner, said in (("syntax.py", "SyntaxError"),
                          ("raises.py", "ZeroDivisionError: division by zero (raises.py, line 2)"),
                          ("late.py", "ValueError: late (late.py, line 4)"), ("answers.py", "'left'"),
                          ("hangs.py", "no command within 0.3 s"), ("kills.py", "the worker ended by SIGKILL"),
                          ("exits.py", "SystemExit: 7"), ("empty.py", "there is no class in the file"),
                          ("two.py", "accepted: two.py:One, two.py:Two"), ("nothing.py", "there is no file nothing.py"),
                          ("two.py:Two", "None"), ("gap_finder[wide=2]", "has no setting 'wide'")):  # fmt: skip
        assert table[planner]["points"] == 0 and said in table[planner]["measured"], planner
        assert said.replace("'", "&#x27;") in page


CHANGES = """
import gc
from fg_mujoco.messages import STOP
from fg_mujoco.addons.arena.runs import checks, graded_drive, recorded_commands
for kind in checks.CHECKS.values():
    kind.judge = lambda self, drive: checks.Verdict(passed=not drive.speeds.any(), measured="mine")
graded_drive.record = graded_drive.race_setup = recorded_commands.RecordedCommands = None
def stand(scan, odometry):
    for each in gc.get_objects():
        if type(each).__name__ == "Engine": each.monitor.timers["laps_completed"] = 1
    return STOP
"""
HOSTILE = {"stuck.py": ("import time\nwhile True:\n    try: time.sleep(99)\n    except BaseException: pass\n",
                        "nothing"),
           "ctrl_c.py": ("def plan(scan, odometry): raise KeyboardInterrupt\n", "KeyboardInterrupt"),
           "forks.py": ("import os, time\nif os.fork():\n    os.kill(os.getpid(), 9)\ntime.sleep(60)\n",
                        "the worker ended by SIGKILL")}  # fmt: skip
WRITES = """
import inspect, os, time
import numpy as np
frame = inspect.currentframe()
while "folder" not in frame.f_locals: frame = frame.f_back
def plan(scan, odometry): pass
os.chdir(frame.f_locals["folder"])
{record}
time.sleep(60)
"""
RECORDS = {"text": "open('aside.npz', 'w').write('x')",
           "nan": "np.savez('aside.npz', commands=np.full((9, 3), np.nan), end=np.frombuffer(b'null', np.uint8))",
           "short": "np.savez('aside.npz', commands=np.zeros((1, 3)), end=np.frombuffer(b'null', np.uint8))"}
UNREADABLE = {
    "pickle": "np.savez('aside.npz', commands=np.array([print], object), end=np.zeros(1, np.uint8))",
    "words": "np.savez('aside.npz', commands=np.array([['a', 'b', 'c']]), end=np.frombuffer(b'null', np.uint8))",
    "end": "np.savez('aside.npz', commands=np.zeros((1, 3)), end=np.frombuffer(b'[1, 2]', np.uint8))",
}  # fmt: skip


def test_a_planner_that_changes_the_grading_in_its_process_changes_nothing(here):
    (here / "changes.py").write_text(CHANGES)
    (here / "lab.toml").write_text(ONE.replace("least_progress_m = 0", "least_progress_m = 0.05"))
    planners = ["mine.py:Steady", "changes.py", "mine.py:Steady[speed=1]"]
    found = study("lab.toml", planners, out="out", workers=1)
    assert [each["points"] for each in found.sums] == [2, 0, 2]
    assert "mine" not in {check.measured for check in found.rows[1].checks}
    raced = fg.race("oval", "mine.py:Steady", laps=1, time_limit=0.2)
    assert found.rows[0].trajectory_sha256 == raced.trajectory_sha256


@each("name", HOSTILE)
def test_a_planner_whose_process_does_not_answer_fails_alone(here, name, monkeypatch):
    monkeypatch.setattr(recorded_commands, "_SILENT", 4.0)
    patch_record(monkeypatch, lambda planner: planner == name)
    text, said = HOSTILE[name]
    (here / name).write_text(text)
    (here / "lab.toml").write_text(ONE)
    bad, good = study("lab.toml", [name, "good.py"], out="out", workers=1).sums
    assert (bad["points"], good["points"]) == (0, 2) and said in bad["measured"]


def test_a_record_that_a_planner_wrote_itself_has_no_points(here):
    for name, text in UNREADABLE.items():
        exec(text, {"np": np})
        read = recorded_commands._read(here / "aside.npz")
        assert (read.failed, len(read.commands)) == ("worker_died", 0) and read.message, name
    for name, text in RECORDS.items():
        (here / f"{name}.py").write_text(WRITES.format(record=f"{text}; os.replace('aside.npz', 'record.npz')"))
    (here / "lab.toml").write_text(ONE)
    found = study("lab.toml", [f"{name}.py" for name in RECORDS], out="out", workers=1).sums
    assert [each["points"] for each in found] == [0] * len(RECORDS) and all(each["measured"] for each in found)


def test_an_error_in_a_check_fails_that_drive(here, monkeypatch):
    patch_record(monkeypatch)
    monkeypatch.setattr(CHECKS["finishes"], "judge", lambda self, drive: {}["steering"])
    (here / "lab.toml").write_text(LAB)
    (found,) = study("lab.toml", "good.py", out="out", workers=1).sums
    assert found["points"] == 2 and found["measured"] == "the drive cannot be judged: KeyError: 'steering'"


def test_a_planner_is_graded_again_when_its_code_or_its_check_has_changed(here, monkeypatch):
    patch_record(monkeypatch)
    (here / "lab.toml").write_text(ONE)
    assert study("lab.toml", ["good.py", "raises.py"], out="out", workers=1).runs_driven == 2
    assert study("lab.toml", ["good.py", "raises.py"], out="out", workers=1).runs_driven == 0
    (here / "raises.py").write_text(FILES["good.py"])
    again = study("lab.toml", ["good.py", "raises.py"], out="out", workers=1)
    assert again.runs_driven == 1 and [each["points"] for each in again.sums] == [2, 2]
    (here / "lab.toml").write_text(ONE.replace("points = 2", "points = 4"))
    assert study("lab.toml", ["good.py"], out="out", workers=1).sums[0]["points"] == 4


@each("lab, planner", [
    ("lab2_emergency_braking", f"{LABS / 'emergency_brake.py'}:EmergencyBrake"),
    ("lab3_wall_following", "wall_follow"), ("lab4_follow_the_gap", "gap_finder"),
    ("lab6_pure_pursuit", "pure_pursuit"), ("race_head_to_head", "overtaker"),
])  # fmt: skip
def test_bundled_planners_pass_the_example_of_their_lab(here, lab, planner):
    found = verdicts(LABS / f"{lab}.toml", planner)
    assert all(verdict.passed for _, verdict in found) and sum(points for points, _ in found) == 100, found
