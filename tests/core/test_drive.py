"""Drives without a planner: commands over time on open ground, against closed forms."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.lab.limits import stopping_distance
from fg_mujoco.lab.manoeuvres import MANOEUVRES, find_manoeuvre
from refusals import refused
from vehicle_worlds import open_file

CAR = fg.Vehicle.load().parameters
HEADER = "time_s,steering_angle_rad,speed_m_s\n"


def written(folder, text, name="commands.csv"):
    path = folder / name
    path.write_text(text)
    return path


def after(result, time, *names):
    """Return columns from a time on."""
    return [result.car.column(name)[result.car.column("time_s") >= time] for name in names]


# Closed forms


@each("radius", [2.0, -1.2])
def test_a_slow_circle_is_that_of_geometry(radius):
    """Of wheels that roll without slip: on ideal tires, and without a shaft, which makes axles of two circles slip."""
    result = fg.drive(f"circle[radius={radius},speed=0.5,turns=1]", vehicle=open_file(), tires="coulomb")
    vx, vy, yaw_rate, lateral, ahead, sideslip, steering = after(
        result, 4.0, "vx_m_s", "vy_m_s", "yaw_rate_rad_s", "ay_m_s2", "ax_m_s2", "sideslip_rad", "steering_angle_rad"
    )
    assert len(vx) > 100 and steering == pytest.approx(math.atan(CAR.wheelbase / radius), abs=1e-3)
    curvature = yaw_rate / vx
    assert curvature == pytest.approx(np.tan(steering) / CAR.wheelbase, rel=0.003)
    assert yaw_rate == pytest.approx(vx / radius, rel=0.005) and np.abs(vy).max() < 0.003
    assert lateral == pytest.approx(vx * yaw_rate, rel=0.005)
    assert ahead == pytest.approx(-CAR.rear_axle_distance * yaw_rate**2, abs=0.003)
    assert sideslip == pytest.approx(math.atan(CAR.rear_axle_distance / radius), abs=0.004)
    x, y = after(result, 4.0, "x_m", "y_m")
    middle = np.array([x.min() + x.max(), y.min() + y.max()]) / 2.0
    assert np.hypot(x - middle[0], y - middle[1]) == pytest.approx(abs(radius), rel=0.005)


@each("mu", [0.3, 0.6])
def test_a_full_stop_takes_the_way_of_wheels_that_lock(mu):
    """The shaft brakes both axles by what each holds; the servo needs its time to come to that."""
    figures = fg.handling(fg.drive("brake[speed=5]", mu=mu, tires="coulomb"))
    assert 1.0 < figures["braking_distance_m"] / stopping_distance(5.0, mu, CAR) < 1.05


def test_a_floor_that_is_a_patch_all_over_is_a_floor_of_its_friction():
    everywhere = {"x": 0.0, "y": 0.0, "length": 100.0, "width": 20.0, "mu": 0.5}
    figures = [fg.handling(fg.drive("brake", **floor)) for floor in ({"mu": 0.5}, {"patches": [everywhere]}, {})]
    assert figures[1]["braking_distance_m"] == pytest.approx(figures[0]["braking_distance_m"], rel=1e-6)
    assert figures[2]["braking_distance_m"] < 0.7 * figures[1]["braking_distance_m"]


def test_the_understeer_gradient_is_that_of_a_car_whose_steering_is_known(short_race):
    """Telemetry of a car that steers by L / R + K ay, at one speed: the gradient is K."""
    result = fg.drive("ramp_steer[begin=0.5,rate=0.1,angle=0.2]")
    columns = {name: fg.TELEMETRY.index(name) for name in fg.TELEMETRY}
    telemetry = result.car.telemetry.copy()
    lateral = telemetry[:, columns["vx_m_s"]] * telemetry[:, columns["yaw_rate_rad_s"]]
    curvature = telemetry[:, columns["yaw_rate_rad_s"]] / telemetry[:, columns["vx_m_s"]]
    telemetry[:, columns["vy_m_s"]] = 0.0
    telemetry[:, columns["ay_m_s2"]] = lateral
    telemetry[:, columns["steering_angle_rad"]] = np.arctan(CAR.wheelbase * curvature) + 0.004 * lateral
    told = replace(result, cars=(replace(result.car, telemetry=telemetry),))
    assert fg.handling(told)["understeer_gradient_rad_s2_m"] == pytest.approx(0.004, rel=1e-6)


# Commands


def test_a_drive_is_commanded_what_the_file_says_at_each_tick(tmp_path):
    path = written(tmp_path, HEADER + "0,0,1\n0.33,0.2,1.5\n1,-0.1,2\n")
    result = fg.drive(path)
    time = result.car.column("time_s")
    assert len(time) == 40 and result.car.end_reason == "finished" and result.car.finished
    expected = np.interp(time, [0.0, 0.33, 1.0], [0.0, 0.2, -0.1])
    np.testing.assert_array_equal(result.car.column("command_steering_rad"), expected)
    np.testing.assert_array_equal(
        result.car.column("command_speed_m_s"), np.interp(time, [0.0, 0.33, 1.0], [1.0, 1.5, 2.0])
    )
    assert result.car.column("vx_m_s")[0] == 1.0  # it rolls at the first speed
    assert fg.drive(str(path), start=fg.Start()).car.column("vx_m_s")[0] == 0.0
    assert result.car.controller == str(path)


def test_the_commands_of_a_race_drive_the_same_trajectory_bit_for_bit(lap):
    """On open ground, from the start of the race: what no wall has touched."""
    x, y, heading = lap.world.track.start_pose()
    columns = [lap.car.column(name) for name in ("time_s", "command_steering_rad", "command_speed_m_s")]
    commands = fg.Commands(time=columns[0], steering_angle=columns[1], speed=columns[2])
    driven = fg.drive(commands, start=fg.Start(s=x, offset=y, heading=heading))
    ticks = len(driven.ctrl)
    assert ticks == len(lap.ctrl) - 1 > 300
    assert driven.ctrl.tobytes() == lap.ctrl[:ticks].tobytes()
    assert driven.states.tobytes() == lap.states[: ticks + 1].tobytes()


# Settings


def test_every_manoeuvre_is_driven_and_says_what_it_measured():
    for name, kind in MANOEUVRES.items():
        assert str(find_manoeuvre(name)) == name == kind.name
        commands = find_manoeuvre(name).commands(CAR, 1.0)
        assert commands.time[0] == 0.0 and commands.steering_angle[0] == 0.0
        assert np.abs(commands.steering_angle).max() <= CAR.max_steering_angle
    told = str(find_manoeuvre("circle[radius=3]", speed=2.5))
    assert find_manoeuvre(told) == find_manoeuvre("circle[radius=3,speed=2.5]")


# Folders


def test_a_run_folder_is_replayed_bit_for_bit_and_gives_the_same_figures(tmp_path, capsys):
    folder = tmp_path / "run"
    assert main(["drive", "ramp_steer[rate=0.2]", "--out", str(folder), "--mu", "0.8"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("ramp_steer[rate=0.2], f1tenth, mu 0.8\n")
    for row in ("duration", "lateral acceleration", "sideslip", "yaw rate", "understeer gradient", "clamped commands"):
        assert f"\n  {row}" in said
    assert main(["replay", str(folder)]) == 0 and "bit-identical" in capsys.readouterr().out
    run = fg.read_run(folder)
    assert run.summary["controller"] == "ramp_steer[rate=0.2]" and not (folder / "controller.py").exists()
    assert fg.handling(run) == fg.handling(fg.drive("ramp_steer[rate=0.2]", mu=0.8))
    with (folder / "telemetry.csv").open() as file:
        assert {"vx_m_s", "vy_m_s", "sideslip_rad", "ax_m_s2", "ay_m_s2"} <= set(next(csv.reader(file)))
    if (folder / "report.html").exists():
        page = (folder / "report.html").read_text()
        assert "Open ground has no laps" in page and "decisions over" not in page
        assert "<span>greatest lateral acceleration</span>" in page and "<span>best lap</span>" not in page


# Bad input


@each(
    ("text", "said"),
    [
        (
            "time_s,speed_m_s\n0,1\n1,1\n",
            "has no column steering_angle_rad; accepted: time_s, steering_angle_rad, speed_m_s",
        ),
        (
            HEADER.replace("speed_m_s", "speed_mps") + "0,0,1\n",
            "column 'speed_mps', which is unknown; .* mean 'speed_m_s'",
        ),
        (HEADER + "0,0,1\n1,nan,1\n", "line 3 is '1,nan,1'; accepted: 3 finite numbers"),
        (HEADER + "0,0,1\n\n1,0\n", "line 4 is '1,0'; accepted: 3 finite numbers"),
        (
            HEADER + "0,0,1\n1,0,1\n1,0,1\n",
            "time_s in row 3 is 1, after 1 in the row before; accepted: times that rise",
        ),
        (HEADER + "0,0,1\n", "1 row; accepted: two rows or more"),
        ("", "has no column time_s, steering_angle_rad, speed_m_s"),
        (HEADER + "0,0,1\n1e9,0,1\n", "lasts 1e\\+09 s; accepted: up to 86400 s"),
    ],
)
def test_a_file_that_is_none_of_commands_is_refused_in_one_line(tmp_path, capsys, text, said):
    path = written(tmp_path, text)
    line = refused(tmp_path, capsys, "drive", str(path))
    assert str(path) in line
    with pytest.raises(fg.SettingsError, match=said):
        fg.Commands.read(path)
