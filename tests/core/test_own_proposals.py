"""A stage of one's own proposes motions to the judge: what is free is driven, what no car can follow is left out."""

import math

import numpy as np

import fg_mujoco as fg
from cases import each
from fg_mujoco.controllers.control.decision import propose
from fg_mujoco.controllers.control.stages import Stage, Tick
from fg_mujoco.controllers.gap_finder import GapFinder
from scan_worlds import CAR, corridor, odometry_of


def arc(curvature):
    """A motion of 5 m along an arc."""
    path = np.zeros((20, 4))
    for k in range(20):
        turned = 0.25 * (k + 1) * curvature
        path[k, 0], path[k, 2], path[k, 3] = 0.25 * (k + 1) * math.cos(0.5 * turned), turned, curvature
        path[k, 1] = path[k, 0] * math.tan(0.5 * turned)
    return path


def ahead(tick: Tick) -> None:
    propose(tick, arc(0.0), 1.5)


def thousand(tick: Tick) -> None:
    for _ in range(1000):
        propose(tick, arc(0.0), 8.0)


def not_finite(tick: Tick) -> None:
    propose(tick, arc(0.1) * math.nan, 1.0)
    propose(tick, arc(0.1), math.inf)


def no_points(tick: Tick) -> None:
    propose(tick, arc(0.1)[:0], 1.0)
    propose(tick, arc(0.1)[:, :3].copy(), 1.0)


def too_sharp(tick: Tick) -> None:
    propose(tick, arc(1.1 * math.tan(tick.driver.car.max_steering_angle) / tick.driver.car.wheelbase), 1.0)


def reverses(tick: Tick) -> None:
    propose(tick, arc(0.0), -1.0)


def planner(step, assist="full"):
    class Proposing(GapFinder):
        def own_stages(self):
            return {"proposing": Stage(text="proposes", after_guidance=step)}

    return Proposing(CAR, 0.94, 8.0, assist=assist)


def said(driver, name):
    return [reason.text for reason in driver.reasons() if reason.name == f"proposal: {name}"]


@each(("far", "driven"), [(20.0, True), (0.35, False)])
def test_a_motion_is_driven_if_the_car_can_stop_on_it(far, driven):
    driver = planner(ahead)
    command = driver(corridor(3.0, 3.0, far), odometry_of(1.5))
    (text,) = said(driver, "of a stage")
    assert ("is driven" in text) == driven == ("meets nothing" in text)
    assert (command.steering_angle == 0.0 and command.speed > 1.45) == driven


@each(
    ("step", "fault"),
    [(not_finite, "not finite"), (no_points, "no points"), (too_sharp, "sharply"), (reverses, "below 0")],
)
def test_what_no_car_can_follow_is_left_out_and_changes_no_bit(step, fault):
    driver, alone = planner(step), GapFinder(CAR, 0.94, 8.0)
    for ahead_of_car in (9.0, 4.0, 1.5):
        scan, odometry = corridor(1.0, 1.2, ahead_of_car), odometry_of(3.0)
        assert driver(scan, odometry) == alone(scan, odometry)
        assert len(said(driver, "left out")) == 1 and fault in said(driver, "left out")[0]
    assert fg.race("oval", planner(step), laps=1).trajectory_sha256 == fg.race("oval", alone, laps=1).trajectory_sha256


def test_more_than_eight_in_a_tick_are_left_out():
    driver = planner(thousand)
    driver(corridor(3.0, 3.0, 0.6), odometry_of(4.0))  # none of them is free
    (text,) = said(driver, "left out")
    assert "eight were proposed before" in text and "and 991 more" in text


def test_a_motion_without_a_judge_without_odometry_or_without_a_scan_is_left_out():
    for assist, scan, odometry in (
        ("grip", corridor(3.0, 3.0, 20.0), odometry_of(1.5)),
        ("full", corridor(3.0, 3.0, 20.0), odometry_of(math.nan)),
    ):
        driver = planner(ahead, assist)
        command = driver(scan, odometry)
        assert "no odometry" in said(driver, "left out")[0] and not said(driver, "of a stage")
        assert math.isfinite(command.speed)
