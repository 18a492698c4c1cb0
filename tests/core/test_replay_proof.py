"""A replay says which part of a folder it proves, which it cannot, and what is forged."""

import json
import re
import shutil
import signal

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from conftest import plain_runs
from fg_mujoco.cli.main import main
from fg_mujoco.course.centreline_csv import write_centreline
from fg_mujoco.racing.result import EVENTS
from fg_mujoco.racing.run_folder import read_summary
from fg_mujoco.simulation.telemetry import TELEMETRY
from fg_mujoco.vehicle.car import WHEELS
from forging import without_checksums
from map_oracles import draw_map, ring
from vehicle_worlds import made_file

TELLTALE = (
    "max_slide_m_s", "max_lateral_slide_m_s", "slide_time_fraction", "mean_speed_m_s", "max_speed_m_s", "collisions",
    "sim_time_s", "mu", "trajectory_sha256", "track", "obstacles", "laps_completed", "lap_times_s", "finished",
    "end_reason", "wrong_way", "crash", "jumps", "stuck", "cars", *EVENTS,
)  # fmt: skip
"""The figures that a replay is to prove."""

PLANNER = """
import os
import signal
from fg_mujoco.messages import DriveCommand
def command(steering_angle, speed):
    return DriveCommand(steering_angle=steering_angle, speed=speed)
def crasher(scan, odometry):
    return command(0.3, 6.0)
def reverser(scan, odometry):
    return command(0.0, 1.5 if odometry.stamp < 1.5 else -2.5)
def beyond(scan, odometry):
    return command(0.9 if odometry.stamp < 0.1 else 0.0, 1.0)
def failing(scan, odometry):
    return command(0.0, 1.0 / (odometry.stamp < 0.2))
def interrupted(scan, odometry):
    if odometry.stamp > 0.2:
        os.kill(os.getpid(), signal.SIGINT)
    return command(0.0, 1.0)
def standing(scan, odometry):
    return command(0.0, 0.0)
"""


@pytest.fixture(scope="module")
def raced(tmp_path_factory):
    """One lap of the oval, as `race --out` writes it."""
    folder = tmp_path_factory.mktemp("raced") / "lap"
    with plain_runs():
        main(["race", "--laps", "1", "--out", str(folder)])
    return folder


@pytest.fixture
def folder(raced, tmp_path):
    """A copy to forge."""
    return without_checksums(shutil.copytree(raced, tmp_path / "run"))


@pytest.fixture
def here(tmp_path, monkeypatch, without_pictures):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(PLANNER, "utf-8")
    return tmp_path


def forge(folder, **changes):
    path = folder / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text("utf-8")) | changes), "utf-8")


def forge_telemetry(folder, rows, value):
    """Write another value into a row of each column of the telemetry; `rows` are by the columns' names, from 0."""
    lines = (folder / "telemetry.csv").read_text("utf-8").splitlines()
    for name, row in rows.items():
        values = lines[row + 1].split(",")
        values[TELEMETRY.index(name)] = value
        lines[row + 1] = ",".join(values)
    (folder / "telemetry.csv").write_text("\n".join(lines) + "\n", "utf-8")


def forge_states(folder, **changes):
    with np.load(folder / "states.npz") as file:
        arrays = dict(file)
    np.savez_compressed(folder / "states.npz", **(arrays | {name: f(arrays[name]) for name, f in changes.items()}))


def told(folder):
    """Return the names of what differs in a folder that is forged."""
    report = fg.replay(folder)
    assert not report.holds
    return [difference.name for difference in report.differences]


def test_a_lap_is_proved_but_for_what_no_simulation_tells(raced):
    report = fg.replay(raced)
    assert report.holds and report.identical and report.differences == ()
    assert report.proved["states.npz"] == ("time", "state", "ctrl")
    assert report.proved["telemetry.csv"] == TELEMETRY
    assert set(report.proved["summary.json"]) == set(TELLTALE)
    summary = read_summary(raced)
    keys = set(report.unproved) & set(summary)
    assert keys | set(TELLTALE) == set(summary) and not keys & set(TELLTALE)
    assert {"wall_time_s", "mujoco_version", "controller", "settings", "clamped_commands"} <= keys


@each(
    ("steering", "said"),
    [
        ("0.01", "planner asked again: the same commands in all 8 decisions"),
        ("0.01 * (time.perf_counter() % 1.0)", "planner asked again: other commands in 8 of 8 decisions; it depends"),
    ],
)
def test_the_command_says_whether_the_planner_decides_the_same_again(
    tmp_path, monkeypatch, capsys, without_pictures, steering, said
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(
        "import time\nfrom fg_mujoco.messages import DriveCommand\ndef mine(scan, odometry):\n"
        f"    return DriveCommand(steering_angle={steering}, speed=1.0)\n"
    )
    main(["race", "--controller", "mine.py:mine", "--time-limit", "0.2", "--out", "run"])
    capsys.readouterr()
    assert main(["replay", "run", "--controller", "mine.py:mine"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "8 ticks of the recorded commands" in lines[0] and lines[-1].strip().startswith(said)
    assert main(["replay", "run", "--controller", "none.py:mine"]) == 0
    assert "planner not asked again: " in capsys.readouterr().out


PLACE = {"time_s": 1.0, "x_m": 0.0, "y_m": 0.0, "lap": 1, "s_m": 0.5}
SLID = {f"slid_{wheel}_s": 0.0 for wheel in WHEELS}
CRASH = PLACE | SLID | {"into": "obstacle 0", "geom": "obstacle_0", "speed_m_s": 1.0, "sideslip_rad": 0.0}
RECORDS = {"wrong_way": PLACE | {"speed_m_s": 1.0}, "crash": CRASH}
CONTACT = {"impulse_Ns": 1.0, "closing_speed_m_s": 1.0, "displacement_m": 0.0, "x_m": 0.0, "y_m": 0.0}
FLIGHT = {"time_s": 1.0, "lasted_s": 0.2, "x_m": 0.0, "y_m": 0.0, "speed_m_s": 1.0, "lap": 1, "landing_load_N": None}
RECORDS |= {
    "jumps": [FLIGHT],
    "stuck": {"x_m": 0.0, "y_m": 0.0, "lap": 1, "carried": 0.5},
    "overtakes": [{"time_s": 1.0, "by": "car_0", "of": "car_1", "s_m": 1.0}],
    "contacts": [{"time_s": 1.0, "cars": ["car_0", "car_1"], "at_fault": "car_0", "reason": "", **CONTACT}],
    "warnings": [{"time_s": 1.0, "car": "car_0", "reason": "contact"}],
    "restarts": [{"time_s": 1.0, "tick": 40, "car": 0, "s_m": 1.0, "offset_m": 0.0}],
}


def other(value):
    """Return another value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return {"oval": "hairpins", "finished": "time_limit"}.get(value, "0" * 64)
    if isinstance(value, list):
        return [other(value[0])]
    if isinstance(value, dict):
        return value | {"lap_times_s": [1.0]}
    return value + 1 if isinstance(value, int) else float(np.nextafter(value, 9.0))


MADE_WITH = ("track", "obstacles", "mu", "cars")
"""Figures that the race is made with again, so that others differ where one of them is forged."""


@each("names", [*((name,) for name in MADE_WITH), tuple(name for name in TELLTALE if name not in MADE_WITH)])
def test_forged_figures_are_told_with_both_values_and_exit_1(folder, names, capsys):
    summary = read_summary(folder)
    forged = {name: RECORDS[name] if name in RECORDS else other(summary[name]) for name in names}
    forge(folder, **forged)
    assert main(["replay", str(folder)]) == 1
    out = capsys.readouterr().out.splitlines()
    lines = [line for line in out if line.startswith("  DIFFERS: ")]
    for name in names:
        recorded, recomputed = (json.dumps(each[name], sort_keys=True) for each in (forged, summary))
        assert f"  DIFFERS: summary.json, {name}: recorded {recorded}, recomputed {recomputed}" in lines
    assert {line.split(": ")[1] for line in lines} <= {f"summary.json, {name}" for name in (*names, "cars")}
    (proved,) = (line for line in out if line.startswith("  proved: summary.json: "))
    assert not set(names) & set(re.findall(r"\w+", proved))


def test_a_forged_column_is_told_by_its_row(folder):
    """Each column, all in one folder, and each in a row of its own."""
    rows = {name: 30 + number for number, name in enumerate(TELEMETRY)}
    forge_telemetry(folder, rows, "0.123")
    found = {difference.name: difference.recorded for difference in fg.replay(folder).differences}
    assert list(found) == [f"telemetry.csv, {name}" for name in TELEMETRY]
    for name, row in rows.items():
        recorded = found[f"telemetry.csv, {name}"]
        assert f"row {row + 1}, the first of 1" in recorded and "0.123" in recorded


def test_a_forged_time_is_told(folder):
    forge_states(folder, time=lambda time: time * 1.0000000001)
    assert told(folder) == ["states.npz, time"]


def test_ticks_behind_the_end_of_the_race_are_told(folder):
    settings = read_summary(folder)["settings"]
    forge(folder, settings=settings | {"time_limit": 2.0})
    assert "states.npz, ticks" in told(folder)
    assert "80, then over: time_limit" in fg.replay(folder).differences[0].recomputed


def test_a_race_on_another_course_than_it_says_is_told(folder):
    settings = read_summary(folder)["settings"]
    forge(folder, track="hairpins", settings=settings | {"track": "hairpins"})
    report = fg.replay(folder)
    assert not report.holds
    (difference,) = report.differences
    assert difference.name == "summary.json, track" and "other walls than scene.xml" in difference.recomputed
    assert "other walls than scene.xml" in report.unproved["lap_times_s"]


RACES = {
    "crash": ("--controller", "mine.py:crasher"),
    "wrong way": ("--controller", "mine.py:reverser"),
    "planner failed": ("--controller", "mine.py:failing"),
    "interrupted": ("--controller", "mine.py:interrupted"),
    "no progress": ("--controller", "mine.py:standing"),
    "beyond the limits": ("--controller", "mine.py:beyond", "--time-limit", "0.5"),
    "moving obstacles": ("--track", "scene:crossing_box:3", "--time-limit", "3"),
    "a scene to its goal": ("--track", "scene:narrow_gap_150"),
    "random obstacles": ("--obstacles", "3", "--time-limit", "3"),
    "noise, latency, distortion": (
        "--lidar-noise", "0.02", "--lidar-latency", "0.05", "--motion-distortion", "--time-limit", "2",
    ),
    "drift and other friction": ("--odometry-drift", "0.05", "--mu", "0.4", "--planner-mu", "off", "--time-limit", "3"),
    "rangefinders": ("--lidar", "rangefinder", "--time-limit", "0.3"),
    "a random track": ("--track", "random:7", "--time-limit", "1"),
    "a vehicle's file": ("--vehicle", "VEHICLE", "--track", "scene:narrow_gap_150", "--time-limit", "2"),
    "a track's file": ("--track", "mine.csv", "--time-limit", "1"),
    "a map": ("--track", "map.yaml", "--time-limit", "1"),
}  # fmt: skip


@each("name", RACES)
def test_every_kind_of_race_is_proved(name, here, capsys):
    arguments = [made_file() if argument == "VEHICLE" else argument for argument in RACES[name]]
    if name == "a map":
        pytest.importorskip("skimage", reason="no scikit-image here: pip install -e '.[maps]'")
        draw_map(here, ring(), name="map")
    write_centreline(fg.load_track("hairpins"), here / "mine.csv")
    main(["race", *arguments, "--out", "run"])
    report = fg.replay("run")
    assert report.holds, report.lines
    by_hand = {"end_reason"} if name in ("planner failed", "interrupted") else set()
    assert set(report.proved["summary.json"]) == set(TELLTALE) - by_hand
    assert report.proved["telemetry.csv"] == TELEMETRY
    assert ("failed_scan.npz" in report.unproved) == (name == "planner failed")
    expected = {"crash": "crash", "wrong way": "wrong_way", "no progress": "no_progress", "interrupted": "interrupted"}
    assert read_summary("run")["end_reason"] == expected.get(name, read_summary("run")["end_reason"])


ENDS = {
    "crasher": [("crash", {"speed_m_s": 0.1}), ("crash", {"into": "obstacle 0"}), ("collisions", 0)],
    "reverser": [("wrong_way", {"s_m": 9.0})],
    "interrupted": [("end_reason", "finished"), ("end_reason", "time_limit")],
    "beyond": [("clamped_commands", 0)],
}


@each("planner", ENDS)
def test_what_ended_a_race_cannot_be_forged(planner, here):
    main(["race", "--controller", f"mine.py:{planner}", "--time-limit", "15", "--out", "run"])
    summary = read_summary("run")
    for name, change in ENDS[planner]:
        forge(here / "run", **summary | {name: summary[name] | change if isinstance(change, dict) else change})
        assert f"summary.json, {name}" in told("run"), change


def test_a_race_of_python_is_proved_but_for_a_limit_that_nobody_wrote_down(short_race, tmp_path):
    report = fg.replay(fg.write_run(short_race, tmp_path / "run", picture=False))
    assert report.holds
    assert set(report.proved["summary.json"]) == set(TELLTALE) - {"end_reason"}
    named = fg.write_run(fg.race("oval", laps=1, time_limit=0.2), tmp_path / "named", picture=False)
    assert set(fg.replay(named).proved["summary.json"]) == set(TELLTALE)


def test_a_race_that_was_interrupted_before_its_first_tick_is_proved(tmp_path):
    def interrupt(scan, odometry):
        signal.raise_signal(signal.SIGINT)

    result = fg.race("oval", interrupt)
    assert result.car.end_reason == "interrupted" and not len(result.ctrl)
    report = fg.replay(fg.write_run(result, tmp_path / "run", picture=False))
    assert report.holds, report.lines


@each("ended", ["History.append", "judge", "tick"])
def test_ctrl_c_between_two_parts_of_a_tick_leaves_whole_ticks(ended, tmp_path, monkeypatch):
    """As a second Ctrl-C can, which ends a race at any place."""
    from fg_mujoco.racing import race
    from fg_mujoco.racing.result import History
    from fg_mujoco.simulation.engine import Engine
    from fg_mujoco.simulation.world_batch import WorldBatch

    owners = {"History.append": (History, "append"), "judge": (Engine, "judge"), "tick": (WorldBatch, "tick")}
    owner, name = owners[ended]
    whole, driven = getattr(owner, name), []

    def interrupted(self, *arguments):
        if name == "tick":
            found = whole(self, *arguments)
            driven.extend(range(found[1]))  # several ticks are one call
            if len(driven) >= 10:
                signal.raise_signal(signal.SIGINT)  # it came in while compiled code ran
            return found
        driven.append(None)
        if len(driven) == 10:
            raise KeyboardInterrupt
        whole(self)

    monkeypatch.setattr(owner, name, interrupted)
    drift = 0.0 if name == "tick" else 1e-3  # with a drift, what a tick consists of is called one by one
    result = race.race("oval", laps=1, odometry_drift=drift)
    monkeypatch.undo()
    assert result.car.end_reason == "interrupted"
    assert len(result.ctrl) == (len(driven) if name == "tick" else 10) < 300
    report = fg.replay(fg.write_run(result, tmp_path / "run", picture=False))
    assert report.holds, report.lines
