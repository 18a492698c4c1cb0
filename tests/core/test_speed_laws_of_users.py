"""Speed laws of the lab: plain functions of four arguments, whose answers are checked."""

import math
import re

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.laps import drive_laps
from fg_mujoco.lab.speed_laws import LAWS, load_law
from refusals import refused

CAR = fg.Vehicle.load().parameters
MINE = """
import math
def law(steering_angle, odometry, car, mu): return 0.5 + odometry.speed * 0.0
def none(steering_angle, odometry, car, mu): return None
def nan(steering_angle, odometry, car, mu): return math.nan
def negative(steering_angle, odometry, car, mu): return -1.0
def many(steering_angle, odometry, car, mu): return [1.0]
def yes(steering_angle, odometry, car, mu): return True
def raises(steering_angle, odometry, car, mu): return 1 / 0
def late(steering_angle, odometry, car, mu): return math.nan if odometry.speed > 1.5 else 9.0
def endless(steering_angle, odometry, car, mu): return 10**400
def other(speed): return 1.0
number = 3
"""


@pytest.fixture
def mine(tmp_path):
    (tmp_path / "my.py").write_text(MINE)
    return str(tmp_path / "my.py")


def odometry(speed=2.0):
    zero = np.zeros(3)
    return fg.Odometry(stamp=0.0, speed=speed, steering_angle=0.0, angular_velocity=zero, linear_acceleration=zero,
                       wheel_speeds=np.full(4, speed))  # fmt: skip


def test_the_bundled_laws_are_the_fields_formula_its_steps_and_our_limiters():
    answers = {name: load_law(name)(-0.2, odometry(), CAR, 0.7) for name in LAWS.names()}
    formula = math.sqrt(9.81 * 0.7 * 0.3302 / math.tan(0.2))
    assert answers["friction"] == pytest.approx(formula, rel=1e-9)
    assert answers["field"] == 1.0
    share = FrictionLimiter(CAR, 0.7).settings.lateral_use
    assert answers["limiter"] == pytest.approx(math.sqrt(share) * formula, rel=1e-6)
    assert load_law("friction")(0.0, odometry(), CAR, 0.7) == math.inf


@each(
    ("name", "said"),
    [("none", "answers None"), ("nan", "answers nan"), ("negative", "answers -1.0"), ("many", "answers [1.0]"),
     ("yes", "answers True"), ("raises", "raises ZeroDivisionError: division by zero"), ("other", "takes (speed)"),
     ("number", "is a int"), ("endless", "OverflowError"), ("lw", "accepted: ")],
)  # fmt: skip
def test_a_law_that_is_none_is_refused_in_one_line_before_anything_is_driven(tmp_path, mine, capsys, name, said):
    assert said in refused(tmp_path, capsys, "friction", "skidpad", "--law", f"{mine}:{name}")


@each("workers", ["1", "2"])
def test_a_law_that_answers_no_speed_in_the_course_of_a_cell_is_refused_in_one_line(tmp_path, mine, capsys, workers):
    arguments = ["friction", "skidpad", "--law", f"{mine}:late", "--steering", "0.3,0.4", "--workers", workers]
    ends = r" m/s and mu 0\.94\d* answers nan; accepted: one number from 0 on \[m/s\]; inf: no limit\n$"
    assert re.search(ends, refused(tmp_path, capsys, *arguments))


def test_a_name_that_is_none_is_refused(tmp_path, capsys):
    assert "did you mean 'friction'" in refused(tmp_path, capsys, "friction", "skidpad", "--law", "fricton")
    assert "there is no file" in refused(tmp_path, capsys, "friction", "skidpad", "--law", "nowhere.py:law")


def test_a_law_of_a_file_limits_the_laps_of_a_planner_and_travels_to_workers(mine, capsys):
    own, _ = drive_laps(LabSettings(law=f"{mine}:law"), "oval", 0.8, 0.8, 2)
    assert 0.4 < own.max_speed_m_s < 0.505
    arguments = ["friction", "skidpad", "--law", f"{mine}:law", "--mu", "0.5,0.6", "--steering", "0.2"]
    assert main([*arguments, "--workers", "2"]) == 0
    assert "is safe on 2 of 2 circles" in capsys.readouterr().out
