"""Whose fault a touch is: of two cars that meet in every way that cars meet, by hand."""

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.racing.fault import approach
from fg_mujoco.simulation.telemetry import TELEMETRY

CAR = fg.World("oval").parameters


def row(x, y, vx, vy=0.0, heading=0.0, yaw_rate=0.0):
    """A row of telemetry of a car whose chassis has its middle there [m]; velocities along its heading [m/s]."""
    values = np.zeros(len(TELEMETRY))
    ahead = 0.5 * CAR.length - CAR.rear_overhang
    place = x - ahead * np.cos(heading), y - ahead * np.sin(heading)
    given = {"x_m": place[0], "y_m": place[1], "heading_rad": heading, "vx_m_s": vx, "vy_m_s": vy}
    for name, value in (given | {"yaw_rate_rad_s": yaw_rate}).items():
        values[TELEMETRY.index(name)] = value
    return values


WAYS = {
    "the first runs into the one ahead": (row(0, 0, 5), row(0.6, 0, 3), -0.6, 0, 2.0),
    "the first reverses into one that stands behind": (row(0.6, 0, -1), row(0, 0, 0), 0.6, 0, 1.0),
    "the first comes over into the one beside it": (row(0, 0, 5, 0.8), row(0, 0.35, 4), 0.0, 0, 0.8),
    "both come nearer alike, and the first is behind": (row(0, 0, 5, 0.3), row(0, 0.35, 5, -0.3), -0.1, 0, 0.6),
    "they meet head on, the first faster": (row(0, 0, 3), row(0.6, 0, 2, heading=np.pi), -0.6, 0, 5.0),
    "the first turns its nose in": (row(0, 0, 4, yaw_rate=3.0), row(0, 0.35, 4), 0.0, 0, None),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_at_fault_is_the_one_that_comes_nearer_faster_whoever_is_named_first(way):
    first, second, lead, fault, closing = WAYS[way]
    found = approach(first, second, (CAR, CAR), lead=lead)
    turned = approach(second, first, (CAR, CAR), lead=-lead)
    assert (found[0], turned[0]) == (fault, 1 - fault)
    assert found[1] == pytest.approx(turned[1])
    if closing is None:  # its middle is so far ahead of base_link, which goes straight on
        closing = 3.0 * (0.5 * CAR.length - CAR.rear_overhang)
    assert found[1] == pytest.approx(closing, abs=1e-6)


def test_it_does_not_depend_on_where_the_map_has_its_axes():
    def turned(car, angle):
        car = car.copy()
        x, y = TELEMETRY.index("x_m"), TELEMETRY.index("y_m")
        cos, sin = np.cos(angle), np.sin(angle)
        car[[x, y]] = cos * car[x] - sin * car[y], sin * car[x] + cos * car[y]
        car[TELEMETRY.index("heading_rad")] += angle
        return car

    for first, second, lead, fault, _ in WAYS.values():
        closing = approach(first, second, (CAR, CAR), lead=lead)[1]
        for angle in (0.7, 2.0, -1.3):
            found = approach(turned(first, angle), turned(second, angle), (CAR, CAR), lead=lead)
            assert found == (fault, pytest.approx(closing))
