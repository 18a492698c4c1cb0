"""What a report says of a run: laps and sectors, the law's limit, accelerations, sliding, the map."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fg_mujoco as fg
from fg_mujoco.addons.look.report.clip import clip_start
from fg_mujoco.addons.look.report.laps_and_slides import SlideEvent, lap_table, slide_events
from fg_mujoco.addons.look.report.map_shapes import map_shapes
from fg_mujoco.addons.look.report.recorded import SPEED_FAR_ABOVE, accelerations, limit_speed
from fg_mujoco.vehicle.car import WHEELS, car_parameters
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED

TICK = 0.025  # [s]


def columns_of(time, progress, **others):
    """Columns of a made-up drive."""
    zeros = np.zeros(len(time))
    names = ("speed_m_s", "friction_use", "x_m", "y_m", "sliding_steps", *(f"slide_{wheel}_m_s" for wheel in WHEELS))
    return dict.fromkeys(names, zeros) | {"time_s": time, "progress_m": progress, "lap": np.ones(len(time)),
                                          "steps": zeros + 5.0, **others}  # fmt: skip


def steady_acceleration(length, laps, a=1.7):
    """A drive from a standing start, progress a t^2 / 2: when it passes s is sqrt(2 s / a)."""
    end = math.sqrt(2.0 * laps * length / a)
    time = np.arange(0.0, end, TICK)
    lines = [math.sqrt(2.0 * lap * length / a) for lap in range(laps + 1)]
    return columns_of(time, 0.5 * a * time**2), tuple(np.diff(lines).tolist()), lambda s: math.sqrt(2.0 * s / a)


def test_sectors_are_thirds_of_a_lap_by_progress():
    length = 31.0
    columns, lap_times, when = steady_acceleration(length, 3)
    laps = lap_table(columns, lap_times, length, end=None)
    assert [lap.number for lap in laps] == [1, 2, 3]
    for lap in laps:
        lines = [when((lap.number - 1 + third / 3.0) * length) for third in range(4)]
        assert lap.sectors == pytest.approx(np.diff(lines), abs=2e-4)  # between ticks a straight line for a parabola


def test_time_sliding_of_a_lap_counts_physics_steps():
    time = np.arange(0.0, 1.0, TICK)
    sliding = np.zeros(len(time))
    sliding[:10] = 2.0
    (lap,) = lap_table(columns_of(time, time, sliding_steps=sliding), (), None, end=1.0)
    assert lap.sliding_share == pytest.approx(20.0 / (5.0 * len(time)))
    assert lap.sectors == (None, None, None)


def test_limit_speed_is_that_at_which_the_circle_takes_all_friction():
    car, mu = car_parameters(fg.World("oval").model, "car/"), 0.8
    steering = np.array([0.05, -0.2, 0.4])
    radius = car.wheelbase / np.tan(np.abs(steering))
    assert limit_speed(steering, car, mu) ** 2 / radius == pytest.approx(mu * car.gravity)
    assert limit_speed(np.zeros(1), car, mu) == pytest.approx(SPEED_FAR_ABOVE)


def test_acceleration_on_a_circle_is_that_of_the_circle():
    time, speed, radius = np.arange(0.0, 1.0, TICK), 3.0, 2.5
    ahead, left = accelerations(time, np.full(len(time), speed), np.full(len(time), -speed / radius))
    assert ahead == pytest.approx(0.0)
    assert left == pytest.approx(-(speed**2) / radius)


def test_acceleration_ahead_is_the_change_of_speed():
    time = np.arange(0.0, 1.0, TICK)
    ahead, _ = accelerations(time, 4.0 - 6.6 * time, np.zeros(len(time)))
    assert ahead == pytest.approx(-6.6)
    assert accelerations(time[:1], np.ones(1), np.ones(1))[0] == pytest.approx(0.0)


@given(st.lists(st.tuples(*[st.sampled_from([0.0, 0.05, 0.3, math.nan])] * 4), max_size=40))
def test_events_cover_every_tick_that_slides_and_no_other(slides):
    slides = np.array(slides, dtype=np.float64).reshape(-1, 4)
    time = TICK * np.arange(len(slides))
    tires = {f"slide_{wheel}_m_s": slides[:, i] for i, wheel in enumerate(WHEELS)}
    events = slide_events(columns_of(time, 2.0 * time, **tires), None)
    told = np.zeros_like(slides, dtype=bool)
    for event in events:
        ticks = (time >= event.start - 1e-9) & (time < event.end - 1e-9)
        assert not told[ticks, WHEELS.index(event.tire)].any()
        told[ticks, WHEELS.index(event.tire)] = True
        assert event.greatest == 0.3
        assert event.progress == pytest.approx(2.0 * event.start)
    assert (told == (slides > SLIDING_SPEED)).all()
    assert [event.start for event in events] == sorted(event.start for event in events)


def test_a_tire_with_a_curve_slides_from_its_peak_on():
    time = TICK * np.arange(10)
    slide = np.zeros(10)
    slide[4:6] = 0.01  # of its slip speed, past the peak
    columns = columns_of(time, time, slide_rear_left_m_s=slide)
    assert slide_events(columns, None) == ()
    (event,) = slide_events(columns, None, model="magic_formula")
    assert (event.tire, event.start) == ("rear_left", pytest.approx(4 * TICK))


def test_place_of_an_event_is_within_its_lap():
    time = TICK * np.arange(100)
    slide = np.zeros(100)
    slide[60:62] = 1.0
    columns = columns_of(time, 10.0 * time, slide_rear_left_m_s=slide, lap=np.where(10.0 * time >= 12.0, 2.0, 1.0))
    (event,) = slide_events(columns, 12.0)
    assert (event.tire, event.lap, event.progress) == ("rear_left", 2, pytest.approx(3.0))


def test_map_has_the_walls_of_the_track_and_the_obstacles():
    boxes = (fg.Box(x=3.0, y=0.2, length=0.4, width=0.3, heading=0.5), fg.Cylinder(x=6.0, y=0.5, radius=0.2))
    world = fg.World("oval", obstacles=boxes)
    shapes = map_shapes(world.model, 0.0)
    corners = np.concatenate(shapes.walls)
    for wall in (world.track.left_wall, world.track.right_wall):
        gaps = np.hypot(*(wall[:, None] - corners).transpose(2, 0, 1)).min(axis=1)
        assert gaps.max() < 1e-4
    for box, outline in zip(boxes, shapes.obstacles, strict=True):
        expected = box.corners()
        assert np.hypot(*(expected[:, None] - outline).transpose(2, 0, 1)).min(axis=1).max() < 1e-4
        x, y = outline.T
        assert np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) > 0.0  # counterclockwise, so in order


def test_clip_shows_what_is_worth_seeing():
    event = {"tire": "rear_left", "lap": 1, "progress": 0.0, "x": 0.0, "y": 0.0, "speed": 5.0}
    mild = SlideEvent(start=3.0, end=3.1, greatest=0.1, **event)
    worst = SlideEvent(start=20.0, end=20.1, greatest=2.0, **event)
    assert clip_start(8.0, 40.0, (20.5, 19.5), (), crashed=False) == 20.5  # the best lap
    assert clip_start(8.0, 40.0, (20.5, 19.5), (mild, worst), crashed=False) == 18.0  # before the worst slide
    assert clip_start(8.0, 40.0, (20.5,), (mild,), crashed=True) == 32.0  # up to the crash
    assert clip_start(8.0, 5.0, (), (), crashed=False) == 0.0
