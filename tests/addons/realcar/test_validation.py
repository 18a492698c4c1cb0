"""What `validate` says of drives whose car is known: ours, and an independent model's; and its windows and tables."""

from pathlib import Path

import numpy as np
import pytest

from refusals import refused

pytest.importorskip("scipy")

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.realcar.drives.reading import read_drive
from fg_mujoco.addons.realcar.validation.car_model import BEFORE, CarModel, Task
from fg_mujoco.addons.realcar.validation.validation import COMMANDS, HELD, validate
from fg_mujoco.addons.realcar.validation.windows import (
    ACCELERATE,
    HOLD_SPEED,
    PERIOD,
    motion_of,
    steady_states_of,
    windows_of,
)
from fg_mujoco.cli.main import main
from fg_mujoco.course.open_ground import OpenGround
from fg_mujoco.simulation.world import World
from fg_mujoco.vehicle.tires import Tires
from fg_mujoco.vehicle.vehicle import Vehicle

SHARED = Path(__file__).resolve().parent.joinpath("../../../../shared/data/real_drives").resolve()
CAR = Vehicle.load("f1tenth")


def task(steering, drive, start, seconds, *, kind):
    """One window, with the same commands in each of its ticks."""
    count = round(seconds / PERIOD)
    row = np.full((1, BEFORE + count), 1.0)
    return Task(starts=np.array([start]), counts=np.array([count]), steering=steering * row, drive=drive * row,
                kinds=np.array([kind]))  # fmt: skip


@pytest.fixture(scope="module")
def circle(tmp_path_factory):
    """A circle driven by our own car at friction 0.7: what its sensors recorded."""
    folder = tmp_path_factory.mktemp("runs") / "circle"
    result = fg.drive("circle[radius=2,speed=3]", mu=0.7)
    fg.write_run(result, folder, picture=False)
    return read_drive(folder)


@pytest.fixture(scope="module")
def own(circle):
    return validate([circle], mu=0.7)


def test_our_own_drive_agrees_with_our_own_car(own):
    """The recorded car is the model: errors are those of smoothing, and of a start without the springs' state."""
    for how in (COMMANDS, HELD):
        found = {each.signal: each for each in own.agreements[how, 1.0]}
        assert found["speed"].share < 0.02 and found["yaw rate"].share < 0.03
        assert found["position"].share < 0.03 and found["slip angle"].rms < 0.01
    state = own.steady[-1]
    assert state.model_yaw_rate == pytest.approx(state.yaw_rate, rel=0.02)
    assert own.plateau[1] == pytest.approx(own.plateau[0], rel=0.02)


def test_less_friction_than_the_car_had_is_seen(circle, own):
    slippery = validate([circle], mu=0.35)
    assert slippery.plateau[1] < 0.9 * slippery.plateau[0]
    here, there = (each.agreement("yaw rate", HELD, 1.0) for each in (own, slippery))
    assert there.rms > 3.0 * here.rms


def test_threads_change_no_bit(circle, own):
    again = validate([circle], mu=0.7, threads=2)
    assert again.agreements == own.agreements and again.steady == own.steady
    for key, (_, simulated) in own.driven.items():
        assert np.array_equal(simulated, again.driven[key][1], equal_nan=True)


def test_windows_follow_each_other_where_the_car_moves(circle):
    motion = motion_of(circle, CAR.parameters, "f1tenth")
    for length in (1.0, 2.0):
        windows = windows_of([motion], length)
        firsts = [window.first for window in windows]
        assert windows and np.all(np.diff(firsts) >= round(length / PERIOD))
        assert all(motion.forward_speed[first] > 1.0 for first in firsts)
    assert all(state.speed > 1.0 and abs(state.yaw_rate) > 0.3 for state in steady_states_of([motion]))


def slowed(car, speed):
    """By how much a car on its own tires slows as it rolls at a speed [m/s^2]."""
    own = World(OpenGround(seconds=1.0), car, tires=car.tires).parameters
    return own.rolling_resistance + own.rolling_damping * speed


@each("vehicle, asked", [("f1tenth", 2.0), ("ipz", 2.0), ("ipz", 0.0)])
def test_a_motor_accelerates_a_car_as_it_is_asked_less_its_drag_and_its_rolling_resistance(vehicle, asked):
    """Newton: its wheels' damping and its tires' rolling resistance slow a car, wheels and motor."""
    car = Vehicle.load(vehicle)
    model = CarModel(vehicle=car, tires=car.tires)
    start = (0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0)
    speed = model.simulate(task(0.0, asked, start, 1.0, kind=ACCELERATE))[0][:, 3]
    assert (speed[-1] - speed[30]) / 0.7 == pytest.approx(asked - slowed(car, speed[30:].mean()), abs=0.06)


def test_commands_that_are_accelerations_drive_the_model_as_its_map_says(tmp_path):
    """A car that speeds up by .8 of what it is sent 0.2 s before, less what slows it, and coasts at negative ones."""
    time = np.arange(0.0, 8.0, 0.02)
    sent = np.where(np.sin(1.5 * time) > 0.0, 1.0, -1.0)
    late = 0.8 * np.maximum(np.interp(time - 0.2, time, sent), 0.0)
    speed = 2.0 + np.cumsum(late - slowed(CAR, 2.0)) * 0.02  # wheels without damping
    x = np.cumsum(speed) * 0.02
    lines = ["t,v,r,d,a,x,y,yaw"]
    lines += [f"{t:.3f},{v:.5f},0,0,{a:.3f},{p:.5f},0,0" for t, v, a, p in zip(time, speed, sent, x, strict=True)]
    (tmp_path / "drive.csv").write_text("\n".join(lines))
    columns = {"time": "t", "speed": "v", "yaw_rate": "r", "steering": "d", "x": "x", "y": "y", "yaw": "yaw",
               "acceleration_command": {"column": "a", "unit": "m/s^2"}}  # fmt: skip
    file = tmp_path / "car.xml"
    numeric = '<custom><numeric name="acceleration_map" data="0.8 0 0.2"/>'
    file.write_text(CAR.text.replace("<custom>", numeric, 1))
    right, wrong = (validate([tmp_path / "drive.csv"], vehicle=vehicle,
                             columns=columns).agreement("speed", COMMANDS, 2.0) for vehicle in (file, "f1tenth"))
    assert right.share < 0.02 and wrong.share > 0.1
    with pytest.raises(fg.SettingsError, match="speed_command and acceleration_command are given"):
        read_drive(tmp_path / "drive.csv", columns=columns | {"speed_command": "v"})


def test_the_command_writes_figures_and_a_page(circle, here, capsys, page_of):
    words = ["validate", circle.name, "--mu", "0.7"]
    assert main([*words, "--report", "page.html", "--csv", "figures.csv"]) == 0
    said = capsys.readouterr().out
    assert "friction 0.7" in said and "recorded speed held, 1 s" in said
    lines = (here / "figures.csv").read_text().splitlines()
    assert lines[0].startswith("model,friction,driven_by,window_s,windows,signal,unit,rms,share_percent,worst")
    with page_of() as page:
        complaints = []
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto((here / "page.html").as_uri())
        page.wait_for_selector("canvas", state="attached")
        assert page.locator("h2").count() == 5 and complaints == []
    assert "exists" in refused(here, capsys, *words, "--csv", "figures.csv")


@pytest.mark.skipif(not SHARED.is_dir(), reason="the shared drives of a real car are not here")
def test_a_real_drive_is_validated_and_its_steady_states_found():
    """README.md of the drives, recorded values, its clock and gyro as they are: .2: 1.69/1.412; .2 here: 1.72/1.38."""
    found = validate([SHARED / "ipz8_steer_01.csv"], tires="slipx_reference", mu=0.66)
    state = found.steady[-1]
    assert state.steering == pytest.approx(0.2) and state.speed == pytest.approx(1.7, abs=0.1)
    assert state.yaw_rate / state.speed == pytest.approx(0.967 * 1.412 / 1.69, rel=0.03)
    assert np.isfinite([each.rms for each in found.agreements[HELD, 1.0]]).all()


def test_a_recorded_state_is_written_as_it_was():
    start = (1.0, -2.0, 0.5, 3.0, -0.2, 1.5, 0.2)
    model = CarModel(vehicle=CAR, tires=Tires.load("forzaeth_sim"), mu=0.66)
    found = model.simulate(task(0.2, 3.0, start, 0.1, kind=HOLD_SPEED))[0]
    assert found[0] == pytest.approx(start[:6]) and found[1, 5] == pytest.approx(1.5, abs=0.4)
    assert found[-1, 3] == pytest.approx(3.0, abs=0.1)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the shared drives of a real car are not here")
def test_a_second_in_which_a_real_car_hits_the_wall_is_no_window():
    """At 61.1 s it is thrown round: its speed falls from 3.5 to 1.6 m/s within .1 s, on tires that hold .8 g."""
    drive = read_drive(SHARED / "ipz20_race_03.csv")
    motion = motion_of(drive, Vehicle.load("ipz").parameters, "ipz")
    times = [motion.time[[each.first, each.first + each.count]] for each in windows_of([motion], 1.0)]
    assert not any(first < 61.1 < last for first, last in times)
    assert any(first < 60.0 < last for first, last in times)
    assert drive.checks.heading_offset.value == pytest.approx(-0.022, abs=0.004)
