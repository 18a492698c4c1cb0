"""Who is at fault for a touch: staged cases, in which way they may be turned without another verdict, and bad input."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import each
from fault_cases import CAR, CASES, GRIP, Case, Drive, incident, staged
from fg_mujoco.addons.arena.race_control import fault
from fg_mujoco.addons.arena.race_control.fault import Approach, Incident, judge
from fg_mujoco.addons.arena.race_control.recent_motion import contact_normal
from fg_mujoco.simulation.cars import footprint


@each("case", CASES, ids=lambda case: case.name)
def test_the_verdict_of_a_staged_touch_whichever_car_is_first_and_on_whichever_side(case):
    for mirrored in (False, True):
        for swapped in (False, True):
            found = judge(incident(case, mirrored=mirrored, swapped=swapped))
            assert found.at_fault == staged(case, mirrored=mirrored, swapped=swapped)[1]
            assert found.reason == case.reason


def test_the_page_has_some_of_the_cases_with_the_verdicts_that_are_tested():
    page = (Path(__file__).parents[3] / "docs" / "addons" / "arena" / "race_control.md").read_text("utf-8")
    said = {"a": "A", "b": "B"}
    shown = re.findall(r"^\| (\d+) \| (.+?) \| (.+?) \| (.+?) \|$", page, re.MULTILINE)
    assert len(shown) >= 10
    for number, *verdict in shown:
        case = CASES[int(number) - 1]
        name = f"{case.name}, in a bend" if case.bend else case.name
        assert verdict == [name, said.get(case.fault, case.fault), case.reason], number


def touching(draw):
    """Return a touch of two cars that were anywhere, going anywhere, a second before."""
    def number(low, high):  # of few binary places, so that moving a place by a power of two rounds nothing
        return draw(st.integers(round(64 * low), round(64 * high))) / 64.0

    time = np.arange(33) / 32.0
    back, cars = time[::-1], []
    for _ in range(2):
        heading = number(-math.pi, math.pi) + number(-2.0, 2.0) * back
        along = number(-0.4, 0.4) - number(-3.0, 8.0) * back - number(-4.0, 4.0) * back**2
        across = number(-0.3, 0.3) - number(-2.0, 2.0) * back - number(-2.0, 2.0) * back**2
        cars.append(Approach(length=number(0.3, 0.8), width=number(0.2, 0.4), along=along, across=across,
                             heading=heading, grip=GRIP, cause=draw(st.booleans()), pushed=draw(st.booleans())))
    angle = number(-math.pi, math.pi)
    return Incident(time=time, cars=(cars[0], cars[1]), normal=(math.cos(angle), math.sin(angle)),
                    bend=draw(st.booleans()))  # fmt: skip


def mirror(car):
    return replace(car, across=-car.across, heading=-car.heading)


@given(st.composite(touching)())
@settings(max_examples=300, deadline=None)
def test_a_verdict_is_the_same_mirrored_swapped_and_elsewhere_and_mends_nobody(found):
    first, second = found.cars
    verdict = judge(found)
    assert verdict.reason in fault.REASONS
    assert judge(found) == verdict
    along, across = found.normal
    assert judge(replace(found, cars=(mirror(first), mirror(second)), normal=(along, -across))) == verdict
    if first.along[-1] != second.along[-1] and first.across[-1] != second.across[-1]:
        swapped = judge(replace(found, cars=(second, first), normal=(-along, -across)))
        assert swapped.at_fault == tuple(sorted(1 - car for car in verdict.at_fault))
        assert swapped.reason == verdict.reason
    assert not any(found.cars[car].pushed for car in verdict.at_fault)
    moved = tuple(replace(car, along=car.along + 1024.0) for car in found.cars)
    assert judge(replace(found, cars=moved, time=found.time + 64.0)) == verdict


def test_a_car_that_was_pushed_is_not_at_fault():
    found = incident(CASES[0])
    pushed = replace(found, cars=(found.cars[0], replace(found.cars[1], pushed=True)))
    assert judge(pushed) == fault.Verdict(at_fault=(), reason=fault.PUSHED)


def test_cars_of_other_sizes_are_judged_by_their_own():
    """A long car is not beside a short one by half its length, but by half of the short one's."""
    drift = Case(name="", a=Drive(s=0.2, offset=0.6, speed=4.0, heading=-0.08), b=Drive(speed=4.0), fault="a",
                 reason=fault.MOVED_OVER)  # fmt: skip
    found = incident(drift)
    longer = replace(found.cars[1], length=1.2, along=found.cars[1].along - 0.5 * (1.2 - CAR.length))
    assert judge(found).at_fault == judge(replace(found, cars=(found.cars[0], longer))).at_fault == (0,)


@each("x, y, heading, normal", [(0.6, 0.1, 0.0, (1, 0)), (0.1, -0.32, 0.1, (0, -1))])
def test_the_normal_of_a_contact_is_that_of_the_side_that_is_hit(x, y, heading, normal):
    first, second = footprint(np.zeros(3), CAR), footprint(np.array([x, y, heading]), CAR)
    assert contact_normal(first, second) == pytest.approx(normal, abs=0.11)
    assert contact_normal(second, first) == pytest.approx(-contact_normal(first, second))
