"""A planner that raises, ends its worker or answers nonsense fails alone, in a line that names its file."""

import os
import re

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.rollouts.drive_worlds import drive_worlds
from fg_mujoco.simulation.settings import Scenario

pytestmark = pytest.mark.usefixtures("here")

PLANNER = """import ctypes, os, sys, time
import numpy as np
import fg_mujoco as fg
def forged(**values):
    command = object.__new__(fg.DriveCommand)
    for name, value in values.items():
        object.__setattr__(command, name, value)
    return command
def die(how):
    raise how
DO = {
    "exit": lambda: sys.exit(0),
    "base": lambda: die(BaseException("base")),
    "generator": lambda: die(GeneratorExit()),
    "memory": lambda: die(MemoryError()),
    "deep": lambda: DO["deep"](),
    "nan": lambda: forged(steering_angle=0.0, speed=float("nan")),
    "array": lambda: forged(steering_angle=0.0, speed=np.ones(3)),
    "text": lambda: forged(steering_angle="left", speed=1.0),
    "bare": lambda: forged(),
    "none": lambda: None,
    "huge": lambda: forged(steering_angle=0.0, speed=10**400),
    "hang": lambda: time.sleep(1e6),
    "segfault": lambda: ctypes.string_at(0),
    "os_exit": lambda: os._exit(0),
}
class Planner:
    def __init__(self, max_speed): self.how = WHEN.get(max_speed)
    def reset(self): pass
    def __call__(self, scan, odometry):
        if self.how and odometry.stamp > 0.09:
            return DO[self.how]()
        return fg.DriveCommand(steering_angle=0.0, speed=1.0)
"""
RAISING = ("exit", "base", "generator", "memory", "deep")
ANSWERING = ("nan", "array", "text", "bare", "none", "huge")


def planner(folder=".", **when):
    """Write a planner whose cars of these speeds, as v4="exit", fail in these ways; return its name."""
    text = f"WHEN = { {float(speed[1:]): how for speed, how in when.items()} }\n"
    path = os.path.normpath(f"{folder}/mine.py")
    with open(path, "w") as file:
        file.write(PLANNER + text)
    return f"{path}:Planner"


# -- races


@each("how", RAISING)
def test_whatever_a_planner_raises_ends_the_race_with_file_and_line(capsys, how, without_pictures):
    assert main(["race", "--controller", planner(v8=how), "--laps", "1", "--out", "run"]) == 1
    out, err = capsys.readouterr()
    assert "0 of 1, planner failed\n" in out and "(mine.py, line " in out and "mine.py" in err
    failure = fg.read_run("run").summary["planner_failure"]
    assert failure["file"] == "mine.py" and failure["time_s"] == pytest.approx(0.1)


@each("how", ANSWERING)
def test_whatever_is_no_command_ends_the_race(capsys, how):
    assert main(["race", "--controller", planner(v8=how), "--laps", "1"]) == 1
    out, _ = capsys.readouterr()
    assert "planner failed" in out and "(mine.py, line " in out


# -- many worlds


def same(rows, others):
    return rows.tobytes() == others.tobytes()


@each("how", ("exit", "nan", "deep"))
def test_in_a_batch_it_is_the_failure_of_that_world(how):
    scenarios = [Scenario(max_speed=speed) for speed in (3.0, 4.0, 5.0)]
    honest = drive_worlds(scenarios, planner(), time_limit=0.3)
    rows = drive_worlds(scenarios, planner(v4=how), time_limit=0.3).rows
    assert rows["end_reason"].tolist() == ["time_limit", "planner_failed", "time_limit"]
    assert same(rows[[0, 2]], honest.rows[[0, 2]])


def test_a_planner_that_cannot_be_built_in_one_world_is_that_worlds_failure():
    with open("picky.py", "w") as file:
        file.write(
            "import fg_mujoco as fg\nclass Picky:\n"
            "    def __init__(self, max_speed):\n        if max_speed == 4.0: raise GeneratorExit\n"
            "    def reset(self): pass\n"
            "    def __call__(self, scan, odometry): return fg.DriveCommand(steering_angle=0.0, speed=1.0)\n"
        )
    result = fg.rollout(
        "oval", "picky.py:Picky", n=8, randomize={"max_speed": [3, 4]}, time_limit=0.3, record="telemetry",
        executor=fg.Executor(chunk=8),
    )
    assert {*zip(result["max_speed"], result["end_reason"], strict=True)} == {(3, "time_limit"), (4, "planner_failed")}
    failed = int(np.flatnonzero(result["max_speed"] == 4)[0])
    assert len(result.telemetry(failed)) == 0 and np.isnan(result["mean_speed_m_s"][failed])


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    """The worlds of ROLLOUT whose planners do not fail."""
    source = planner(tmp_path_factory.mktemp("honest"))
    return fg.rollout("oval", source, n=4, randomize={"max_speed": "3|4|5"}, time_limit=0.3, workers=1)


ROLLOUT = ["--n", "4", "--randomize", "max_speed=3|4|5", "--time-limit", "0.3", "--chunk", "3", "--out", "out"]


def test_a_worker_that_dies_is_the_failure_of_its_worlds(here, capfd, honest):
    dying = {4: ("segfault", "by SIGSEGV"), 5: ("os_exit", "code 0")}
    hit = np.isin(honest["max_speed"], list(dying))
    assert set(dying) < set(honest["max_speed"])
    mine = planner(**{f"v{speed}": how for speed, (how, _) in dying.items()})
    assert main(["rollout", "--controller", mine, *ROLLOUT, "--workers", "2"]) == 1
    out, err = capfd.readouterr()
    assert f"{hit.sum()} worker died" in out
    for world in np.flatnonzero(hit):
        said = dying[int(honest["max_speed"][world])][1]
        assert re.search(f"warning: world {world}, seed {honest['seed'][world]}: the worker ended .*{said}", err)
    result = fg.read_rollout("out")
    assert result["end_reason"][hit].tolist() == ["worker_died"] * int(hit.sum())
    assert same(result.worlds[~hit], honest.worlds[~hit])
    assert main(["rollout", "--controller", "mine.py:Planner", *ROLLOUT]) == 1  # found there, and not forgotten
    assert "4 worlds of an earlier call" in capfd.readouterr().out


def test_a_planner_that_hangs_ends_its_world_by_the_decision_limit(capfd, honest):
    hit = honest["max_speed"] == 4
    assert main(["rollout", "--controller", planner(v4="hang"), *ROLLOUT, "--decision-limit", "0.5"]) == 0
    assert f"{hit.sum()} decision limit" in capfd.readouterr().out
    result = fg.read_rollout("out")
    assert same(result.worlds[~hit], honest.worlds[~hit])
    with pytest.raises(fg.SettingsError, match="decision_limit is 0"):
        fg.rollout("oval", n=1, decision_limit=0)
