"""Who is at fault for a touch: by a table of staged cases, turned and mirrored, and in the simulator."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fg_mujoco as fg
from cases import each
from fault_cases import CAR, CASES, GRIP, MIDDLE, Case, Drive, incident, staged
from fg_mujoco.addons.arena.race_control import fault
from fg_mujoco.addons.arena.race_control.fault import Approach, Incident, judge
from fg_mujoco.addons.arena.race_control.race_control import RaceControl
from fg_mujoco.addons.arena.race_control.recent_motion import contact_normal
from fg_mujoco.racing.entries import NO_FAULT
from fg_mujoco.racing.rules import RULES
from fg_mujoco.simulation.cars import WorldCar, footprint
from fg_mujoco.simulation.engine import Engine


@each("case", CASES, ids=lambda case: case.name)
def test_the_verdict_of_a_staged_touch_whichever_car_is_first_and_on_whichever_side(case):
    for mirrored in (False, True):
        for swapped in (False, True):
            found = judge(incident(case, mirrored=mirrored, swapped=swapped))
            assert found.at_fault == staged(case, mirrored=mirrored, swapped=swapped)[1]
            assert found.reason == case.reason


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


# the same touches in the simulator, wherever the course lies


STRAIGHT, LENGTH, RADIUS, WIDTH, SPACING = 20.0, 40.0, 6.0, 6.0, 0.25  # [m]
BEFORE_BEND = LENGTH - 2.5  # [m]


def stadium(turned):
    """Return a course of two straights and two bends that lies in another direction on the map [rad]."""
    x = np.arange(0.0, LENGTH, SPACING)
    angle = np.arange(0.0, math.pi, SPACING / RADIUS) - 0.5 * math.pi
    bend = RADIUS * np.column_stack((np.cos(angle), np.sin(angle)))
    bends, top = (bend + np.array((LENGTH, RADIUS)), np.array((0.0, RADIUS)) - bend), 2.0 * RADIUS
    line = np.vstack((np.column_stack((x, 0.0 * x)), bends[0], np.column_stack((LENGTH - x, 0.0 * x + top)), bends[1]))
    cos, sin = math.cos(turned), math.sin(turned)
    half = np.full(len(line), 0.5 * WIDTH)
    return fg.Track(name="stadium", centreline=line @ [[cos, sin], [-sin, cos]], width_left=half, width_right=half)


def drive(engine, drives, controls, ticks):
    """Drive the cars of all worlds as they are commanded."""
    for tick in range(ticks):
        engine.commands[:] = [each.command(tick * engine.period) for each in drives]
        engine.sense()
        engine.drive()
        engine.judge()
        for control in controls:
            control.after_tick()
        if all(control.contacts for control in controls):
            break
    for control in controls:
        control.finish()


def starts(drives, s):
    """Return where the rear axles of cars stand whose middles are counted from a place of the course [m]."""
    return [fg.Start(s=s + each.s - MIDDLE * math.cos(each.heading),
                     offset=each.offset - MIDDLE * math.sin(each.heading), heading=each.heading,
                     speed=each.speed) for each in drives]  # fmt: skip


@each("turned, swapped", [(0.0, False), (2.0, True)])
def test_race_control_judges_staged_touches_as_the_table_does(turned, swapped):
    cases = [case for case in CASES if case.simulated]
    engine = Engine(fg.World(stadium(turned), tires="coulomb", others=[WorldCar(tires="coulomb")]), len(cases), laps=5)
    drives = [staged(case, mirrored=swapped, swapped=swapped)[0] for case in cases]
    places = [BEFORE_BEND if case.bend or case.cause else STRAIGHT for case in cases]
    engine.place([start for pair, place in zip(drives, places, strict=True) for start in starts(pair, place)])
    controls = [RaceControl(engine, names=("ba" if swapped else "ab"), rules=RULES["none"], world=world)
                for world in range(len(cases))]  # fmt: skip
    drive(engine, [each for pair in drives for each in pair], controls, ticks=60)
    found = {case.name: control.contacts[:1] for case, control in zip(cases, controls, strict=True)}
    verdicts = {name: (contact.at_fault, contact.reason) for name, (contact,) in found.items()}
    assert verdicts == {case.name: (case.fault, case.reason) for case in cases}


def test_a_car_that_is_pushed_into_another_is_not_at_fault_for_that():
    world = fg.World(stadium(0.0), others=[WorldCar(), WorldCar()])
    drives = (Drive(s=0.7), Drive(), Drive(s=-1.5, speed=5.0))
    engine = Engine(world, laps=5)
    engine.place(starts(drives, STRAIGHT))
    control = RaceControl(engine, names=("first", "between", "last"), rules=RULES["none"])
    drive(engine, list(drives), [control], ticks=40)
    found = {contact.cars: (contact.at_fault, contact.reason) for contact in control.contacts}
    assert found["between", "last"] == ("last", fault.RAN_INTO_STANDING)
    assert found["first", "between"] == (NO_FAULT, fault.PUSHED)


def test_a_car_that_pushes_again_and_again_has_one_contact_until_a_second_has_passed():
    """It drives into one that stands, backs off, and does so again 0.5 s and 1.5 s after they last touched."""
    pushes = ((0.0, 0.0, 1.0), (0.5, 0.0, -1.0), (0.75, 0.0, 1.0), (1.5, 0.0, -1.0), (2.2, 0.0, 0.0), (3.0, 0.0, 1.5))
    drives = (Drive(s=0.75), Drive(speed=1.0, commands=pushes))
    engine = Engine(fg.World(stadium(0.0), others=[WorldCar()]), laps=5)
    engine.place(starts(drives, STRAIGHT))
    control = RaceControl(engine, names="ab", rules=RULES["none"])
    touched = []
    for tick in range(200):
        engine.commands[:] = [each.command(tick * engine.period) for each in drives]
        engine.sense()
        engine.drive()
        engine.judge()
        control.after_tick()
        touched.append(engine.touched_at[0, 1] == engine.time(0))
    control.finish()
    begins = np.flatnonzero(np.diff(np.array(touched, int), prepend=0) == 1) * engine.period
    pauses = np.diff(begins)
    assert len(begins) >= 3
    assert np.any(pauses < 1.0)
    assert [contact.time_s for contact in control.contacts] == pytest.approx([begins[0], begins[-1]])


@each("case, warned",
      [("both drift towards each other alike", ["a", "b"]),
       ("side by side 1 cm apart, neither holds its line to the centimetre", [])])  # fmt: skip
def test_rules_warn_each_car_at_fault_and_put_back_the_one_behind(case, warned):
    found: Case = next(each for each in CASES if each.name == case)
    engine = Engine(fg.World(stadium(0.0), others=[WorldCar()]), laps=5)
    engine.place(starts((found.a, found.b), STRAIGHT))
    rules = RULES["roboracer_2026"].__class__(name="any touch", free_displacement=0.0)
    control = RaceControl(engine, names="ab", rules=rules)
    drive(engine, [found.a, found.b], [control], ticks=80)
    assert [warning.car for warning in control.warnings][: len(warned)] == warned
    assert len(control.restarts) == bool(warned)


def test_a_long_push_of_a_car_that_rolls_is_not_free_and_a_short_one_is():
    """A car at 1 m/s is caught up with by one that would go at 1.1 m/s, which displaces it by less than 5 cm."""
    for lasts, warned in ((math.inf, ["b"]), (0.8, [])):
        pusher = Drive(speed=1.1, commands=((0.0, 0.0, 1.1), (0.2 + lasts, 0.0, 0.0)))
        drives = [Drive(s=0.6, speed=1.0), pusher]
        engine = Engine(fg.World(stadium(0.0), others=[WorldCar()]), laps=5)
        engine.place(starts(tuple(drives), STRAIGHT))
        for rules in ("none", "roboracer_2026"):
            control = RaceControl(engine, names="ab", rules=RULES[rules])
            engine.place(starts(tuple(drives), STRAIGHT))
            drive(engine, drives, [control], ticks=100)
            assert [contact.at_fault for contact in control.contacts] == ["b"]
            assert control.contacts[0].displacement_m < RULES["roboracer_2026"].free_displacement
            assert [warning.car for warning in control.warnings] == (warned if rules != "none" else [])
            assert len(control.restarts) == len(control.warnings)
