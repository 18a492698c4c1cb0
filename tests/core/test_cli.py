import json
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
import warnings
import weakref

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.controllers import BASELINES
from fg_mujoco.errors import SettingsError, TrackError, install_command
from fg_mujoco.interrupts import ended_in_order
from refusals import contents, refused
from terminals import read_to_the_end

pytestmark = pytest.mark.usefixtures("here")

STRAIGHT = """
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.setup import SETUP_KEYWORDS
class Straight:
    def __init__(self, max_speed):
        self.speed = max_speed
    def reset(self):
        print("ready")
    def __call__(self, scan, odometry):
        return DriveCommand(steering_angle=0.0, speed=self.speed)
"""


@pytest.mark.slow
def test_a_video_that_fails_after_the_race_leaves_the_run_folder_and_exits_1(here, capsys, monkeypatch):
    def full(*_):
        raise SettingsError("a.mp4: cannot be written: No space left on device")

    monkeypatch.setattr("fg_mujoco.cli.render.check_film", lambda *_: None)
    monkeypatch.setattr("fg_mujoco.cli.render.film_race", full)
    assert main(["race", "--time-limit", "0.5", "--out", "run", "--video", "a.mp4"]) == 1
    shown = capsys.readouterr()
    assert shown.err == "fg-mujoco: a.mp4: cannot be written: No space left on device\n"
    assert "written to" in shown.out and (here / "run" / "report.html").exists()


@pytest.mark.slow
def test_json_is_one_object_and_nothing_else(here, capfd):
    (here / "planner.py").write_text(STRAIGHT)  # it prints, too
    main(["race", "--json", "--laps", "1", "--controller", "planner.py:Straight", "--planner-mu", "off"])
    out, err = capfd.readouterr()

    def refuse(constant):
        raise AssertionError(constant)

    summary = json.loads(out, parse_constant=refuse)
    required = """track, controller, laps_requested, laps_completed, finished, end_reason, lap_times_s, collisions,
        max_slide_m_s, slide_time_fraction, mean_speed_m_s, max_speed_m_s, sim_time_s, wall_time_s, realtime_factor,
        seed, mu, planner_mu, trajectory_sha256"""
    assert {name.strip() for name in required.split(",")} <= set(summary)
    assert summary["track"] == "oval"
    assert summary["planner_mu"] is None  # infinity has no JSON
    assert summary["mu"] == 1.0489
    assert err == "ready\n"


def test_a_race_won_exits_0_and_says_so(capsys, here):
    assert main(["race", "--laps", "1"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for text in ("1 of 1", "lap 1", "collisions", "greatest sliding", "time sliding", "top speed", "mean speed"):
        assert text in out
    assert "real-time factor" in out
    assert contents(here) == {}


def test_a_controller_of_the_users_that_hits_the_wall_exits_1_and_is_written(here, capsys, without_pictures):
    (here / "planner.py").write_text(STRAIGHT)
    assert main(["race", "--controller", "planner.py:Straight", "--max-speed", "3", "--out", "runs/crash"]) == 1
    assert "crash" in capsys.readouterr().out
    run = fg.read_run(here / "runs" / "crash")
    assert run.summary["end_reason"] == "crash"
    assert run.summary["collisions"] == 1
    assert run.summary["finished"] is False
    assert run.column("command_speed_m_s") == pytest.approx(3.0)
    assert main(["replay", "runs/crash"]) == 0
    assert "bit-identical" in capsys.readouterr().out


class Thing:
    pass


def test_the_second_ctrl_c_ends_the_race_where_the_first_was_to_be_ignored(here, capsys):
    kills = "    while True: os.kill(os.getpid(), signal.SIGINT)\n"
    (here / "planner.py").write_text(f"import os, signal\ndef P(scan, odometry):\n{kills}")
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a shell does for what runs in the background
    try:
        assert main(["race", "--controller", "planner.py:P", "--json", "--decision-limit", "20"]) == 1
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
    assert json.loads(capsys.readouterr().out)["end_reason"] == "interrupted"


def test_a_refusal_is_one_line_whatever_numpy_has_warned_of(capsys, monkeypatch):
    def refuse(name):
        np.float64(1e308) * np.float64(1e308)
        raise TrackError("no such track")

    monkeypatch.setattr("fg_mujoco.cli.track.load_track", refuse)
    with warnings.catch_warnings(record=True) as shown:
        assert main(["track", "show", "oval"]) == 2
    assert capsys.readouterr().err == "fg-mujoco: no such track\n" and not shown


COMES = """
import os, signal, sys
class Finder:
    def find_spec(self, name, *rest):
        if name == {module!r}:
            {what}
sys.meta_path.insert(0, Finder())
sys.argv = ["/bin/fg-mujoco", "track", "list"]
from fg_mujoco.cli.main import main
sys.exit(main())
"""
CTRL_C = "os.kill(os.getpid(), signal.SIGINT)"


@each(
    "module, what, code",
    [
        ("mujoco", CTRL_C, -signal.SIGINT), ("fg_mujoco.cli.track", CTRL_C, 130),
        ("fg_mujoco.cli.track", "raise ImportError('initialization failed') from KeyboardInterrupt()", 130),
    ],
)  # fmt: skip
def test_ctrl_c_while_modules_are_imported_leaves_no_traceback(module, what, code):
    text = COMES.format(module=module, what=what)
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (code, "")


def test_ctrl_c_that_a_callback_has_swallowed_comes_again():
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # whatever ran before in this process
    thing = Thing()
    _ = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt), ended_in_order(threading.Event()):
        del thing
        for _ in range(600):  # an interrupt may be seen only once a sleep is over
            time.sleep(0.05)


def test_the_first_ctrl_c_says_what_it_waits_for(here, capfd):
    (here / "planner.py").write_text(
        "import os, signal\nfrom fg_mujoco.messages import STOP\ndef P(scan, odometry):\n"
        "    if scan.stamp >= WHEN: os.kill(os.getpid(), signal.SIGINT)\n    return STOP\nWHEN = 0.1\n"
    )
    assert main(["race", "--controller", "planner.py:P", "--json"]) == 1
    said = r"waiting for a command of the planner after t = 0\.\d+ s\. Ctrl-C once more ends the race at once\.\n"
    assert re.fullmatch(f"fg-mujoco: interrupted; {said}", capfd.readouterr().err)
    text = (here / "planner.py").read_text()
    (here / "planner.py").write_text(text.replace("WHEN = 0.1", "WHEN = 0.0"))
    assert main(["race", "--controller", "planner.py:P", "--json"]) == 1
    assert "waiting for the first tick: the world, and the planner's first command" in capfd.readouterr().err


def test_a_planner_that_never_answers_ends_the_race_and_what_was_driven_is_kept(here, capsys, without_pictures):
    (here / "planner.py").write_text(
        "from fg_mujoco.messages import STOP\ndef P(scan, odometry):\n"
        "    while scan.stamp > 0.11: pass\n    return STOP\n"
    )
    arguments = ["race", "--controller", "planner.py:P", "--decision-limit", "0.2", "--out", "run"]
    assert main(arguments) == 1
    out = capsys.readouterr().out
    assert "0 of 5, decision limit\n" in out and "no command within 0.2 s at t = 0.125 s\n" in out
    summary = fg.read_run("run").summary
    assert (summary["end_reason"], summary["finished"], summary["decision_limit_s"]) == ("decision_limit", False, 0.2)
    assert summary["settings"]["decision_limit"] == 0.2
    assert len(fg.read_run("run").ctrl) == 5 and main(["replay", "run"]) == 0


def test_without_extras_the_rest_is_written_and_the_commands_that_install_them_are_said(here, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["race", "--time-limit", "0.5", "--out", "run"]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 2
    assert install_command("plot") in err and install_command("report") in err
    assert {path.name for path in (here / "run").iterdir()} == {
        "summary.json", "scene.xml", "states.npz", "telemetry.csv",
    }  # fmt: skip
    assert main(["track", "show", "oval"]) == 2
    assert install_command("plot") in capsys.readouterr().err


@pytest.mark.slow
def test_progress_is_shown_on_a_terminal_and_not_in_a_pipe(here, capfd):
    crawls = "def P(scan, odometry): return DriveCommand(steering_angle=0.0, speed=0.1)\n"
    (here / "planner.py").write_text(f"from fg_mujoco.messages import *\n{crawls}")
    arguments = ["race", "--laps", "2", "--controller", "planner.py:P", "--time-limit", "20"]
    assert main(arguments) == 1 and capfd.readouterr().err == ""

    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "fg_mujoco", *arguments], stdout=subprocess.PIPE, stderr=theirs, text=True
    )
    os.close(theirs)
    shown = read_to_the_end(ours)
    assert "time limit" in process.communicate()[0]
    assert b"\rlap 1/2" in shown.replace(b"\x1b[K", b"")
    assert b"m/s" in shown
    assert b"\n" not in shown


@pytest.mark.slow
def test_a_reader_that_leaves_early_gets_no_traceback():
    process = subprocess.Popen(
        [sys.executable, "-m", "fg_mujoco", "track", "list"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.close()
    assert process.stderr.read() == b""
    process.wait()
    process.stderr.close()


@pytest.mark.slow
def test_track_new_writes_what_track_show_and_race_read(here, capsys):
    assert main(["track", "new", "--seed", "7", "out.csv"]) == 0
    drawn, made = fg.load_track("out.csv"), fg.generate_track(7)
    assert drawn.centreline == pytest.approx(made.centreline)
    assert "fg-mujoco track new --seed 7" in (here / "out.csv").read_text().splitlines()[0]
    assert main(["track", "show", "out.csv"]) == 0
    assert (here / "out.png").read_bytes().startswith(b"\x89PNG")
    assert main(["race", "--track", "out.csv", "--time-limit", "0.2"]) == 1


def test_track_new_replaces_a_file_only_by_force(here, capsys):
    (here / "out.csv").write_text("mine")
    assert "--force" in refused(here, capsys, "track", "new", "--seed", "7", "out.csv")
    assert main(["track", "new", "--seed", "7", "--force", "out.csv"]) == 0
    assert fg.load_track("out.csv").length > 0


def test_lists_name_everything_there_is(capsys):
    assert main(["track", "list"]) == 0
    assert [line.split(":")[0] for line in capsys.readouterr().out.splitlines()] == list(fg.track_names())
    assert main(["controllers"]) == 0
    heads = [line.split(":")[0] for line in capsys.readouterr().out.splitlines() if line and line[0] != " "]
    assert tuple(heads) == (*fg.controller_names(), *BASELINES)
