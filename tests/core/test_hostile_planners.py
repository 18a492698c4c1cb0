"""A planner can fail in any way: it fails alone, in a line that names its file, and nothing takes it for a success."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.rollouts.drive_worlds import drive_worlds
from fg_mujoco.simulation.planner_adapter import plan
from fg_mujoco.simulation.planner_failure import without_exit
from fg_mujoco.simulation.settings import Scenario

pytestmark = pytest.mark.usefixtures("here")

PLANNER = """import ctypes, os, signal, sys, time
import numpy as np
import fg_mujoco as fg
class Mute(Exception):
    def __str__(self): raise RuntimeError("no text")
    __repr__ = __str__
class Masked(Exception):
    __class__ = property(lambda self: 1 / 0)
    __traceback__ = property(lambda self: 1 / 0)
    __cause__ = property(lambda self: 1 / 0)
class Meta(type):
    __name__ = property(lambda self: 1 / 0)
    __module__ = property(lambda self: 1 / 0)
class Nameless(Exception, metaclass=Meta):
    pass
class Two(float):
    def __float__(self): return float("nan")
class Changing(fg.DriveCommand):
    speed = property(lambda self: 1 / 0)
class Drifting(fg.DriveCommand):
    seen = 0
    @property
    def speed(self):
        type(self).seen += 1
        return 1.0 if type(self).seen % 2 else float("nan")
    @speed.setter
    def speed(self, value): pass
    def __init__(self): object.__setattr__(self, "steering_angle", 0.0)
class Unwritable:
    def __repr__(self): raise ValueError("no")
def forged(**values):
    command = object.__new__(fg.DriveCommand)
    for name, value in values.items():
        object.__setattr__(command, name, value)
    return command
def die(how):
    raise how
DO = {
    "exit": lambda: sys.exit(0),
    "os_exit": lambda: os._exit(0),
    "generator": lambda: die(GeneratorExit()),
    "base": lambda: die(BaseException("base")),
    "ctrl_c": lambda: die(KeyboardInterrupt()),
    "mute": lambda: die(Mute()),
    "masked": lambda: die(Masked("masked")),
    "nameless": lambda: die(Nameless("nameless")),
    "long": lambda: die(ValueError("x" * 100_000_000)),
    "memory": lambda: die(MemoryError()),
    "deep": lambda: DO["deep"](),
    "nan": lambda: forged(steering_angle=0.0, speed=float("nan")),
    "array": lambda: forged(steering_angle=0.0, speed=np.ones(3)),
    "text": lambda: forged(steering_angle="left", speed=1.0),
    "two": lambda: forged(steering_angle=0.0, speed=Two(1.0)),
    "bare": lambda: forged(),
    "changing": lambda: object.__new__(Changing),
    "none": lambda: None,
    "unwritable": lambda: Unwritable(),
    "huge": lambda: forged(steering_angle=0.0, speed=10**400),
    "hang": lambda: time.sleep(1e6),
    "killed": lambda: os.kill(os.getpid(), signal.SIGKILL),
    "segfault": lambda: ctypes.string_at(0),
    "c_exit": lambda: ctypes.CDLL(None)._exit(0),
}
class Planner:
    def __init__(self, max_speed): self.how = WHEN.get(max_speed)
    def reset(self): pass
    def __call__(self, scan, odometry):
        if self.how and odometry.stamp > 0.09:
            return DO[self.how]()
        return fg.DriveCommand(steering_angle=0.0, speed=1.0)
"""
RAISING = (
    "exit", "os_exit", "generator", "base", "ctrl_c", "mute", "masked", "nameless", "long", "memory", "deep",
)  # fmt: skip
ANSWERING = ("nan", "array", "text", "two", "bare", "changing", "none", "unwritable", "huge")


def planner(folder=".", **when):
    """Write a planner whose cars of these speeds, as v4="mute", fail in these ways; return its name."""
    text = f"WHEN = { {float(speed[1:]): how for speed, how in when.items()} }\n"
    path = os.path.normpath(f"{folder}/mine.py")
    with open(path, "w") as file:
        file.write(PLANNER + text)
    return f"{path}:Planner"


# -- races


@each("how", RAISING)
def test_whatever_a_planner_raises_ends_the_race_with_file_and_line(capsys, how, without_pictures):
    before = os._exit
    assert main(["race", "--controller", planner(v8=how), "--laps", "1", "--out", "run"]) == 1
    out, err = capsys.readouterr()
    assert "0 of 1, planner failed\n" in out and "(mine.py, line " in out and "mine.py" in err
    assert len(out) + len(err) < 100_000
    failure = fg.read_run("run").summary["planner_failure"]
    assert failure["file"] == "mine.py" and failure["time_s"] == pytest.approx(0.1)
    assert os._exit is before


@each("how", ANSWERING)
def test_whatever_is_no_command_ends_the_race(capsys, how):
    assert main(["race", "--controller", planner(v8=how), "--laps", "1"]) == 1
    out, _ = capsys.readouterr()
    assert "planner failed" in out and "(mine.py, line " in out


def test_a_command_whose_values_change_is_read_once():
    planner(v8="none")
    namespace = {}
    exec(PLANNER, namespace)
    simulation = fg.Simulation(fg.World("oval"))
    scan, odometry = simulation.reset()
    answer = namespace["Drifting"]()
    command = plan(lambda scan, odometry: answer, scan, odometry)
    assert type(command) is fg.DriveCommand and (command.speed, command.speed) == (1.0, 1.0)
    assert namespace["Drifting"].seen == 1


def test_os_exit_is_itself_again_afterwards_and_for_forks_all_the_time():
    before = os._exit
    with without_exit():
        with without_exit():
            pass
        with pytest.raises(SystemExit, match=r"os\._exit\(3\)"):
            os._exit(3)
        child = os.fork()
        if child == 0:
            os._exit(4)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 4
    assert os._exit is before


FORKS = """
class Forks:
    def reset(self): pass
    def __call__(self, scan, odometry):
        from fg_mujoco import DriveCommand
        if scan.stamp < 0.07: fork()
        return DriveCommand(steering_angle=0.0, speed=1.0)
"""


@each(
    ("command", "text", "ends"),
    [
        ("race", "def fork(): os.fork() or 1 / 0", "time_limit"),
        ("rollout", "os.fork()\ndef fork(): os.fork() or time.sleep(99)", "time_limit"),
        ("rollout", "def fork():\n    if os.fork(): os.kill(os.getpid(), 9)\n    time.sleep(99)", "worker_died"),
    ],
)
def test_a_fork_of_a_planner_drives_nothing_and_holds_nothing_up(command, text, ends, here):
    (here / "forks.py").write_text(f"import os, time\n{text}\n{FORKS}")
    line = [sys.executable, "-m", "fg_mujoco", command, "--controller", "forks.py:Forks", "--time-limit", "0.3"]
    line += ["--json", *(["--n", "2", "--workers", "2", "--out", "out"] if command == "rollout" else [])]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60)
    found = json.loads(done.stdout)  # once
    assert "Traceback" not in done.stderr
    assert found["end_reason"] == ends if command == "race" else found["end_reasons"] == {ends: 2}


# -- many worlds


def same(rows, others):
    return rows.tobytes() == others.tobytes()


@each("how", ("os_exit", "ctrl_c", "mute", "long", "nan", "deep"))
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
    """And SIGKILL that of a run, in the test of a comparison below, by the same `work_off`."""
    dying = {4: ("segfault", "by SIGSEGV"), 5: ("c_exit", "code 0")}
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
