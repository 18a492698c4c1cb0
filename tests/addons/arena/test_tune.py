"""Settings of a planner that are drawn, driven under the same conditions, and ranked."""

import json
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.arena.tuning import tune
from fg_mujoco.cli.main import main
from fg_mujoco.racing.planners import ControllerChoice
from fg_mujoco.rollouts.shares import wilson

pytest.importorskip("scipy")

PLANNERS = '''
import numpy as np
from fg_mujoco.messages import DriveCommand


def plan(scan, odometry, *, speed=2.0, blind=False, farthest=10, side="none"):
    """Steer towards the depth of the view, faster by 0.1 m/s a tick."""
    depth = np.nan_to_num(scan.ranges, posinf=scan.range_max).clip(0.0, farthest) ** 3
    steering = 0.0 if blind else float(np.average(scan.bearings, weights=depth + 1e-6))
    steering += {"none": 0.0, "left": 0.01}[side]
    return DriveCommand(steering_angle=steering, speed=min(speed, odometry.speed + 0.1))


class Mine:
    def __init__(self, max_speed, gain=0.5, speed=2.0):
        self.gain, self.speed = gain, speed

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        return plan(scan, odometry, speed=self.speed)
'''


@pytest.fixture(autouse=True)
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PLANNERS)
    return "mine.py"


def tuned(words, planner="mine.py:plan"):
    return main(["tune", planner, "--executor", "threads", *words.split()])


def test_the_safest_is_first_and_half_the_speed_is_behind_where_both_are_safe():
    found = tune("mine.py:plan", {"speed": [2.0, 4.0, 5.0], "blind": [False, True]}, mu=0.8, runs=24, conditions=4)
    speeds = [(row["planner.speed"], row["planner.blind"], row["safe"]) for row in found.rows]
    assert speeds[:2] == [(4.0, False, 4), (2.0, False, 4)] and speeds[2][:2] == (5.0, False) and speeds[2][2] < 4
    assert {blind for _, blind, _ in speeds[3:]} == {True} and {safe for *_, safe in speeds[3:]} == {0}
    assert found.rows[1]["own"] and found.best == '--controller "mine.py:plan[speed=4.0,blind=false]" --assist none'
    assert "assist none" in found.head and found.rows[1]["behind_s"] > 2.0 * found.rows[1]["noise_s"] > 0.0
    assert found.rows[2]["mean_lap_s"] < found.rows[0]["mean_lap_s"]  # faster, and not safe
    for row in found.rows:  # again, by plain arithmetic
        same = [found.rollout[name] == row[name] for name in ("planner.speed", "planner.blind")]
        own = found.rollout.worlds[same[0] & same[1]]
        ended = [w for w in own if w["end_reason"] == "finished" and w["collisions"] == 0]
        safe = [w for w in ended if w["max_slide_m_s"] == 0.0]
        assert (row["runs"], row["safe"]) == (len(own), len(safe))
        assert (row["safe_low"], row["safe_high"]) == wilson(len(safe), len(own))
        if safe:
            assert row["mean_lap_s"] == pytest.approx(np.mean(own["first_lap_s"]))


def test_each_draw_has_the_same_conditions_and_a_world_is_raced_again_with_the_same_bits():
    settings = {"speed": "1:2", "farthest": "8:12"}
    found = tune("mine.py:plan", settings, mu=(0.5, 1.0), runs=32, conditions=4, time_limit=4.0)
    worlds = found.rollout
    for name in ("mu", "start_s", "seed"):
        table = worlds[name].reshape(8, 4)
        assert (table == table[0]).all() and len(set(table[0].tolist())) == 4, name
    # of a Halton sequence each four points in a row lie in different quarters (base 2)
    assert sorted(np.floor((worlds["mu"][:4] - 0.5) * 8.0).tolist()) == [0.0, 1.0, 2.0, 3.0]
    drawn = worlds.worlds.reshape(8, 4)[1:, 0]  # behind the planner's own
    assert len(set(np.floor((drawn["planner.speed"] - 1.0) * 8.0).tolist())) == 7
    whole = worlds["planner.farthest"]
    assert whole.dtype.kind == "i" and set(whole.tolist()) <= set(range(8, 13))
    alone = fg.race(worlds.setup(6))
    assert (alone.sim_time_s, alone.car.max_slide_m_s) == (worlds["sim_time_s"][6], worlds["max_slide_m_s"][6])


def test_the_same_seed_gives_the_same_files_with_one_worker_and_two_and_a_finished_folder_is_read():
    words = "--set speed=1:2 --set side=none|left --mu .8:1 --runs 12 --conditions 2 --time-limit 4"
    assert tuned(f"{words} --workers 1 --out one") == tuned(f"{words} --workers 2 --out two --executor processes") == 1
    names = ("table.csv", "table.md", "worlds.csv")
    assert [Path("one", n).read_bytes() for n in names] == [Path("two", n).read_bytes() for n in names]
    assert Path("one/settings.png").stat().st_size > 10_000
    before = Path("one/summary.json").read_bytes()
    assert tuned(f"{words} --out one") == 1 and Path("one/summary.json").read_bytes() == before
    assert tuned(f"{words} --seed 1 --out three") == 1
    assert Path("three/table.csv").read_bytes() != Path("one/table.csv").read_bytes()


def test_the_line_to_paste_is_read_back_and_there_is_none_if_no_draw_is_safe(capsys):
    assert tuned("--set gain=.4:.6 --set max_speed=3:4 --runs 4 --conditions 2 --json", "mine.py:Mine") == 0
    found = json.loads(capsys.readouterr().out)
    words = shlex.split(found["best"])
    assert words[0] == "--controller" and words[2:4] == ["--assist", "none"] and words[4] == "--max-speed"
    choice = ControllerChoice.of(words[1])
    assert dict(choice.settings) == {"gain": found["draws"][0]["planner.gain"]}
    assert float(words[5]) == found["draws"][0]["max_speed"]
    assert tuned("--set gain=.4:.6 --planner-mu .6 --runs 4 --conditions 2", "mine.py:Mine") == 0
    assert capsys.readouterr().out.endswith(" --assist none --planner-mu 0.6\n")  # of the runs' own options
    assert tuned("--set speed=1:2 --runs 4 --conditions 2", "mine.py:plan[blind=true]") == 1
    said = capsys.readouterr().out
    assert "no draw is safe in all of its runs" in said and "--controller" not in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "no setting of 'mine.py:plan' is given; accepted: LOW:HIGH or A|B, for some of speed, blind"),
        ("--set speeed=1:2", "has no setting 'speeed'; accepted: speed, blind, farthest, side; did you mean"),
        ("--set speed=2:1", "set speed: range 2.0:1.0; accepted: finite LOW:HIGH, LOW first"),
        ("--set speed=fast|2", "set speed: fast|2 has values of several kinds"),
        ("--set farthest=1.5:4", "set farthest: 1.5:4.0; accepted: whole numbers"),
        ("--set blind=0:1", "setting blind is 0.0; accepted: True, False"),
        ("--set speed", "--set 'speed'; accepted: NAME=LOW:HIGH or NAME=A|B"),
        ("--set speed=1:2 --runs 15", "--runs is 15; accepted: "),
        ("--set speed=1:2 --conditions 0", "--conditions is 0; accepted: "),
        ("--set speed=1:2 --mu 1:.5", "range 1.0:0.5"),
        ("--set speed=1:2 --assist grip", "decides by itself, and assist is 'grip'; accepted: none"),
    ],
)
def test_what_cannot_be_tuned_is_refused_in_a_line(words, said, capsys):
    assert tuned(words) == 2
    err = capsys.readouterr().err
    assert said in err and err.count("\n") <= 2, err


def test_bounds_that_a_bundled_planner_refuses_and_another_folder_are_refused(capsys):
    assert tuned("--set clearance=-1:.3", "gap_finder") == 2
    assert "setting clearance is -1.0; accepted: a number from 0" in capsys.readouterr().err
    words = "--set speed=1:2 --runs 4 --conditions 2 --time-limit 1 --out there"
    assert tuned(words) == 1
    assert tuned(f"{words} --seed 1") == 2
    assert "there: holds another rollout" in capsys.readouterr().err


def test_scipy_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(fg.MissingExtraError, match="draws of settings need SciPy"):
        tune("mine.py:plan", {"speed": (1.0, 2.0)})
