"""Run folders from bags: what a car recorded, in what runs have, and nothing that nobody knows."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fg_mujoco as fg
from bag_worlds import robot_odometry, robot_scan, write_bag
from fg_mujoco.addons.ros.bag_writer import export_bag
from fg_mujoco.cli.main import main
from fg_mujoco.simulation.course_loading import load_track


@pytest.fixture(scope="module")
def lap(tmp_path_factory):
    """A little more than a lap of the oval, and the folder that is made of its bag."""
    folder = tmp_path_factory.mktemp("lap")
    result = fg.race("oval", laps=2, max_speed=4.0, time_limit=17.0)
    fg.write_run(result, folder / "run", picture=False)
    export_bag(folder / "run", folder / "lap.mcap")
    (folder / "out").mkdir()  # an empty folder is as good as none
    assert (
        main(["bag", str(folder / "lap.mcap"), "--map", str(folder / "made.yaml"), "--out", str(folder / "out")]) == 0
    )
    return result, folder


def test_the_drive_is_the_one_that_was_driven(lap):
    result, folder = lap
    run = fg.read_run(folder / "out")
    count = min(len(run.ctrl), len(result.car.telemetry))
    assert count >= len(result.car.telemetry) - 2
    for name, tolerance in (("x_m", 0.01), ("y_m", 0.01), ("speed_m_s", 0.15), ("yaw_rate_rad_s", 0.2)):
        off = run.column(name)[3:count] - result.car.column(name)[3:count]
        assert np.abs(off).max() < tolerance, name
    heading = run.column("heading_rad")[:count] - result.car.column("heading_rad")[:count]
    assert np.abs(np.remainder(heading + math.pi, math.tau) - math.pi).max() < 0.01
    np.testing.assert_allclose(
        run.column("command_speed_m_s")[:count], result.car.column("command_speed_m_s")[:count], atol=1e-5
    )
    assert run.states[:count, 0] == pytest.approx(result.states[:count, 0])


def test_its_laps_are_those_of_the_course_that_was_mapped(lap):
    result, folder = lap
    summary = fg.read_run(folder / "out").summary
    assert summary["laps_completed"] == 1
    assert summary["lap_times_s"][0] == pytest.approx(result.car.lap_times_s[0], rel=0.02)
    assert summary["track"] == "made"
    assert load_track(str(folder / "made.yaml")).length == pytest.approx(load_track("oval").length, rel=0.01)


def test_what_nobody_knows_is_not_there(lap):
    run = fg.read_run(lap[1] / "out")
    for name in (
        "slide_rear_left_m_s",
        "friction_use_front_left",
        "fx_rear_left_N",
        "slip_angle_rear_left_rad",
        "ay_m_s2",
    ):
        assert np.isnan(run.column(name)).all()
    for name in ("max_slide_m_s", "slide_time_fraction", "wall_time_s", "realtime_factor"):
        assert run.summary[name] is None
    assert run.summary["end_reason"] == "recorded"
    assert run.summary["controller"] == "bag:lap.mcap"
    assert run.summary["decision_times"]["decisions"] == 0


def test_reports_and_debugging_are_made_of_it(lap, tmp_path, capsys):
    folder = lap[1] / "out"
    page = tmp_path / "page.html"
    assert main(["report", str(folder), "--no-clip", "--out", str(page)]) == 0
    text = page.read_text()
    assert "what its tires did, and whether it touched anything, is not known" in text
    assert "<span>greatest sliding</span>" not in text
    assert "no tire slid" not in text and "Not known: a car recorded this run" in text
    assert "<td>nan" not in text and "<td>-</td><td>-</td></tr>" in text
    assert "<span>collisions</span>" not in text
    assert main(["debug", str(folder), "--at", "5", "--out", str(tmp_path / "debug.html")]) == 0
    assert "A car recorded this drive" in capsys.readouterr().err


def test_a_planner_runs_over_the_scans_that_the_car_recorded(lap, tmp_path):
    """The recorded ones, not ones of the map: as over the bag itself."""
    out = {}
    for source in (lap[1] / "out", lap[1] / "lap.mcap"):
        path = tmp_path / f"{source.stem}.csv"
        assert main(["replay-scans", str(source), "--controller", "gap_finder", "--out", str(path)]) == 0
        out[source.stem] = np.loadtxt(path, delimiter=",", skiprows=1)
    count = len(out["out"])
    assert count >= len(out["lap"]) - 2
    steering = out["out"][:count, 2] - out["lap"][:count, 2]
    assert np.abs(steering).mean() < 0.01  # the speeds are those of the path


def test_it_is_not_replayed_or_identified_as_if_it_were_simulated(lap, tmp_path, capsys):
    folder = str(lap[1] / "out")
    assert main(["replay", folder]) == 2
    assert "was recorded by a car, and not simulated" in capsys.readouterr().err
    assert main(["identify", folder, "--out", str(tmp_path / "tires.toml")]) == 2
    assert "is made of a bag's poses; accepted: the bag" in capsys.readouterr().err


def test_a_bag_without_a_course_leaves_no_folder(tmp_path, capsys):
    epoch, step = 1_700_000_000_000_000_000, 100_000_000
    entries = [("/scan", epoch, robot_scan(np.full(60, 1.5), first=-0.6, step=0.02, time=epoch))]
    entries += [("/odom", epoch + k, robot_odometry(epoch + k, frame="map")) for k in (0, step)]
    bag = write_bag(tmp_path / "bag", entries)
    assert main(["bag", str(bag), "--out", str(tmp_path / "out")]) == 2
    assert "Traceback" not in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
