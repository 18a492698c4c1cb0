"""The live view of several cars: one by planner or keys, the others by their planners."""

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.look.live.browser_shapes import world_shapes
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.racing.setup import Setup
from fg_mujoco.simulation.telemetry import TELEMETRY

RIVALS = (fg.Entry(controller="disparity_extender", max_speed=2.0), fg.Entry(max_speed=3.0, vehicle="nuc2"))


def drive(session, ticks):
    for _ in range(ticks):
        session.tick()


def places(session):
    return session.world.cars[0].pose(session.simulation.data), session.world.cars[1].pose(session.simulation.data)


def test_session_drives_as_a_race_of_the_same_cars_does():
    session = LiveSession(Setup.of(max_speed=4.0, opponents=RIVALS))
    race = fg.race("oval", entries=[fg.Entry(max_speed=4.0), *RIVALS], laps=1, time_limit=2.0)
    drive(session, 79)
    np.testing.assert_array_equal(session.simulation.state[: session.world.model.nq + 1],
                                  race.states[79, : session.world.model.nq + 1])  # fmt: skip
    row = race.car.telemetry[78]
    first = TELEMETRY.index("friction_use_front_left")
    assert session.friction_utilisation == np.nanmax(row[first : first + 4])


def test_keys_drive_the_own_car_and_planners_the_others():
    session = LiveSession(Setup.of(opponents=RIVALS[:1]))
    before = places(session)
    session.by_hand = True
    drive(session, 40)
    own, rival = places(session)
    assert own[:2] == pytest.approx(before[0][:2], abs=0.05)  # no key was pressed
    assert rival[0] > before[1][0] + 0.5
    for _ in range(4):
        session.key("faster")
    drive(session, 40)
    assert session.simulation.speed > 1.0


def test_other_tires_of_the_own_car_leave_all_where_they_are():
    session = LiveSession(Setup.of(opponents=RIVALS[:1]))
    drive(session, 30)
    before = places(session)
    session.change("mu", 0.4)
    session.paused = True
    session.tick()
    assert session.world.cars[0].mu == 0.4 and session.world.cars[1].mu == pytest.approx(1.0489)
    for was, now in zip(before, places(session), strict=True):
        assert now == pytest.approx(was)
    session.paused = False
    drive(session, 20)
    assert places(session)[1][0] > before[1][0] + 0.3


def test_opponent_that_crashes_stands_and_is_told_of():
    rival = fg.Entry(controller=OnAnArc(), start=fg.Start(s=3.0))
    session = LiveSession(Setup.of(opponents=(rival,)))
    session.by_hand = True
    for _ in range(400):
        session.tick()
        if session.message:
            break
    assert session.message == "car_1 crashed"
    session.simulation.engine.commands[1] = 0.0, 5.0
    drive(session, 60)
    stands = places(session)[1]
    drive(session, 20)
    assert places(session)[1] == pytest.approx(stands, abs=1e-3)


class OnAnArc:
    """Drives on an arc, into whatever is there."""

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.1, speed=4.0)


def test_browser_has_the_shapes_of_all_cars():
    session = LiveSession(Setup.of(opponents=RIVALS))
    model, shapes = world_shapes(session.world)
    bodies = {model.body(shape.body).name for shape in shapes}
    assert {"car/base_link", "car_1/base_link", "car_2/base_link"} <= bodies
