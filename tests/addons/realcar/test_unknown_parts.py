"""Which part of a model is not known, by drives in which one is wrong; and drives as F1Tenth-INI writes them."""

from types import SimpleNamespace

import numpy as np
from test_recorded_drives import motion, write

from cases import each
from fg_mujoco.addons.realcar.drives.reading import read_drive
from fg_mujoco.addons.realcar.validation.unknown import unknown_parts
from fg_mujoco.addons.realcar.validation.windows import Window

GRIP, COUNT, WINDOWS = 8.0, 100, 20
TIME = 0.01 * np.arange(WINDOWS * COUNT + 1)
SPEED = np.full(len(TIME), 2.0)
TURN = 1.2 * np.sin(1.3 * TIME)  # [rad/s]: 2.4 m/s^2 at most


def said(*, gyro=TURN, slip=0.0 * TURN, model=TURN, speed=SPEED):
    """What is said of one drive; the model follows `model` without slip."""
    drive = SimpleNamespace(gyro=gyro, forward_speed=speed, slip_angle=slip, drive=SimpleNamespace(name="d.csv"))
    windows = [Window(drive=0, first=k * COUNT, count=COUNT) for k in range(WINDOWS)]
    simulated = np.zeros((WINDOWS, COUNT + 1, 6))
    for k, window in enumerate(windows):
        rows = slice(window.first, window.first + COUNT + 1)
        simulated[k, :, 3], simulated[k, :, 5] = speed[rows], model[rows]
    return unknown_parts([drive], windows, simulated, rear=0.0, grip=GRIP)


FAST = np.full(len(TIME), 3.0)
SPIN = np.where((TIME > 5.0) & (TIME < 6.0), 1.0, 0.0)


@each(
    ("given", "words"),
    [
        ({"gyro": 1.05 * TURN}, None),
        ({"gyro": 1.3 * np.interp(TIME - 0.05, TIME, TURN)},
         "servo map, with 100% of the squared error: below the limit the car turns 1.30 times as fast, 0.05 s later"),
        ({"gyro": 2.0 * TURN, "model": 1.6 * TURN, "speed": FAST}, "not known is the floor"),
        ({"gyro": TURN + 3.0 * SPIN, "slip": 0.6 * SPIN}, "fork, with 100% of the squared error: in 1 of 20 windows"),
    ],
)  # fmt: skip
def test_the_part_that_is_wrong_is_named(given, words):
    lines = said(**given)
    assert lines == () if words is None else (len(lines) == 1 and words in lines[0]), lines


INI = {
    "time_s": "time", "speed_m_s": "linear_vel_x", "yaw_rate_rad_s": "angular_vel_z", "x_m": "pose_x", "y_m": "pose_y",
    "steering_rad": "angular_control_executed", "speed_command_m_s": "translational_control_executed",
    "yaw_rad": "pose_theta",
}  # fmt: skip


def test_a_drive_of_ini_is_read_below_its_comments_and_by_its_long_names(tmp_path):
    plain = write(tmp_path / "plain.csv", motion())
    header, *rows = plain.read_text().splitlines()
    names = ",".join(INI[name] for name in header.split(","))
    comments = '# This is F1TENTH simulation\n# Starting position :,"[3.62, 6.26, 0.378]"\n#\n# Data:\n'
    lines = [f"{names},LIDAR_0040,LIDAR_0540", *(f"{row},65.533,2.5" for row in rows)]
    (tmp_path / "ini.csv").write_text(comments + "\n".join(lines) + "\n")
    drive, same = read_drive(tmp_path / "ini.csv"), read_drive(plain)
    assert (drive.layout, drive.acceleration_command is None) == ("ini", False)
    np.testing.assert_array_equal(drive.steering.values, same.steering.values)
    older = (tmp_path / "ini.csv").read_text().replace("_control_executed", "_control_calculated")
    (tmp_path / "older.csv").write_text(older)
    assert read_drive(tmp_path / "older.csv").layout == "ini_2024"
    assert drive.beams is not None and (drive.beams.ranges == (np.inf, 2.5)).all()
