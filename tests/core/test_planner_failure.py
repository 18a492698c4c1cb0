"""A planner that fails is told by its line and its own traceback, and the run up to there is kept with the scan."""

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.racing.run_folder import read_failed_scan

PLANNER = """import numpy as np
import fg_mujoco as fg
from fg_mujoco.controllers.control.stages import Stage
from fg_mujoco.controllers.control.planner import GoalPlanner
from fg_mujoco.controllers.gap_finder import GapFinder, GapFinderSettings
class Late:
    def reset(self):
        pass

    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=self.steer(scan, odometry), speed=1.0)

    def steer(self, scan, odometry):
        if odometry.stamp > 0.49:
            return np.average(scan.bearings, weights=scan.ranges[:3])  # line 15
        return 0.0


class BadReset(Late):
    def reset(self):
        raise RuntimeError("no map")  # line 21


class BadBuild(Late):
    def __init__(self, car):
        self.speed = car.top_speed  # line 26


class Goal(GoalPlanner):
    Settings = GapFinderSettings

    @staticmethod
    def goal(geometry, ranges, car, settings, debug):
        if len(ranges) > 3:
            raise ValueError("too many")  # line 35
        return 0.0, 1.0


class Typo(GoalPlanner):
    Settings = GapFinderSettings

    @staticmethod
    def goal(geometry, ranges, car, settings, debug):
        return ranges.angle, 1.0  # line 44



def creep(tick):
    tick.command[1] = undefined_name  # line 49



def crawl(tick):
    tick.command[1] = tick.memory.no_such_field  # line 54


class Name(GapFinder):
    def own_stages(self):
        return {"creep": Stage(after_driving=creep)}


class Field(GapFinder):
    def own_stages(self):
        return {"crawl": Stage(after_driving=crawl)}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PLANNER)
    return tmp_path


def failing(name):
    """The race of one of the planners in the file, which fails."""
    with pytest.warns(UserWarning, match=rf"^controller mine\.py:{name} failed: .* \(mine\.py, line \d+\), t = "):
        return fg.race("oval", f"mine.py:{name}", laps=1)


@pytest.mark.slow
def test_the_command_says_the_line_and_writes_the_run_up_to_there(here, capsys):
    pytest.importorskip("bokeh", reason="no bokeh here: pip install -e '.[report]'")
    assert main(["race", "--controller", "mine.py:Late", "--out", "runs/late"]) == 1
    out, err = capsys.readouterr()
    said = "TypeError: Axis must be specified when shapes of a and weights differ. (mine.py, line 15), t = 0.500 s"
    assert f"  planner failed    {said}\n" in out
    assert "0 of 5, planner failed\n" in out
    assert out.splitlines()[-1] == "  report            runs/late/report.html"
    assert err.startswith('Traceback of the planner:\n  File "mine.py", line 11, in __call__\n')
    assert err.index("line 11") < err.index('  File "mine.py", line 15, in steer\n') < err.index("numpy")
    assert "planner_adapter.py" not in err and "cli/main.py" not in err

    run = fg.read_run("runs/late")
    assert (run.summary["end_reason"], run.summary["finished"], len(run.ctrl)) == ("planner_failed", False, 20)
    failure = run.summary["planner_failure"]
    assert (failure["file"], failure["line"], failure["scan"]) == ("mine.py", 15, "failed_scan.npz")
    assert failure["time_s"] == pytest.approx(0.5) and failure["traceback"] in err
    page = (here / "runs/late/report.html").read_text()
    assert "(mine.py, line 15)" in page and "in steer" in page and "failed_scan.npz" in page
    assert main(["replay", "runs/late"]) == 0


def test_the_scan_that_did_it_is_the_one_that_the_car_sensed_there(here):
    result = failing("Late")
    failure = result.car.planner_failure
    fg.write_run(result, "run", picture=False)
    scan, odometry = read_failed_scan("run")
    assert (scan.ranges == failure.scan.ranges).all() and scan.stamp == odometry.stamp == failure.time_s
    simulation = fg.Simulation(fg.World("oval"))
    sensed, told = simulation.reset()
    for _ in range(20):
        sensed, told = simulation.step(fg.DriveCommand(steering_angle=0.0, speed=1.0))
    assert (scan.ranges == sensed.ranges).all()
    assert (odometry.wheel_speeds == told.wheel_speeds).all() and odometry.speed == told.speed
    with np.load("run/failed_scan.npz") as file:
        assert {"ranges", "angle_min", "angle_increment", "odometry_speed", "odometry_steering_angle"} <= set(file)
    planner = fg.make_controller("mine.py:Late", car=simulation.world.parameters, mu=1.0, max_speed=8.0)
    with pytest.raises(TypeError, match="Axis must be specified"):
        planner(scan, odometry)


@pytest.mark.slow
def test_the_line_in_a_goal_is_told():
    failure = failing("Goal").car.planner_failure
    assert (failure.error, failure.file, failure.line) == ("ValueError: too many", "mine.py", 35)
    assert "mine.py" in failure.traceback and "planner_adapter" not in failure.traceback
    assert len(failure.scan.ranges) == 1081
    typo = failing("Typo").car.planner_failure
    assert typo.line == 44 and typo.error == "AttributeError: 'numpy.ndarray' object has no attribute 'angle'"


@pytest.mark.slow
@each(
    ("name", "line", "said"),
    (
        ("Name", 49, "NameError: name 'undefined_name' is not defined"),
        ("Field", 54, "AttributeError: 'Record' object has no attribute 'no_such_field'"),
    ),
)
def test_the_line_in_a_stage_is_told(name, line, said):
    failure = failing(name).car.planner_failure
    assert (failure.error, failure.file, failure.line) == (said, "mine.py", line)
    assert failure.traceback.splitlines()[1].startswith(f'  File "mine.py", line {line}, in c')


@each(
    ("name", "said"),
    (("BadReset", "RuntimeError: no map (mine.py, line 21)"), ("BadBuild", "attribute 'top_speed' (mine.py, line 26)")),
)
def test_what_fails_before_the_race_has_its_line_and_is_refused(here, capsys, name, said):
    assert main(["race", "--controller", f"mine.py:{name}", "--out", "run"]) == 2
    assert said in capsys.readouterr().err
    assert not (here / "run").exists()
