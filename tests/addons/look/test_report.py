"""What a report says of a run: laps and sectors, the law's limit, accelerations, sliding, the map; and several cars."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import fg_mujoco as fg
from fg_mujoco.addons.arena.race_control.race_control import standings
from fg_mujoco.addons.look.report.clip import clip_of_several, clip_start
from fg_mujoco.addons.look.report.field import Field
from fg_mujoco.addons.look.report.laps_and_slides import SlideEvent, lap_table, slide_events
from fg_mujoco.addons.look.report.recorded import (
    SPEED_FAR_ABOVE,
    accelerations,
    limit_speed,
    map_shapes,
    read_recorded,
    tick_columns,
)
from fg_mujoco.simulation.cars import car_colour, car_colour_hex
from fg_mujoco.vehicle.car import WHEELS, car_parameters
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED
from field_races import shunt, three_cars
from hand_planners import driven
from rendered import needs_gl

TICK = 0.025  # [s]


def columns_of(time, progress, **others):
    """Columns of a made-up drive."""
    zeros = np.zeros(len(time))
    slides = (f"slide_{wheel}_m_s" for wheel in WHEELS)
    names = ("speed_m_s", "friction_utilisation", "x_m", "y_m", "sliding_steps", *slides)
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


# several cars: standings, trace.png, and the page


def telemetry(progress):
    """Telemetry of a car of which only time and progress are known."""
    found = np.zeros((len(progress), len(fg.TELEMETRY)))
    found[:, fg.TELEMETRY.index("time_s")] = TICK * np.arange(len(progress))
    found[:, fg.TELEMETRY.index("progress_m")] = progress
    return found


def row(position, end=1e3, finished=False):
    return {"position": position, "finished": finished, "end_time_s": end}


def test_gap_of_two_cars_at_steady_speeds_is_the_time_since_the_leader_was_there():
    """At 4 and 3 m/s from one line the slower is where the faster was at 3/4 of the time: the gap is t/4."""
    time = TICK * np.arange(400)
    found = standings([telemetry(3.0 * time), telemetry(4.0 * time)], [row(2), row(1)])
    np.testing.assert_allclose(found.gaps_s[0, 1:], 0.25 * time[1:], atol=1e-9)
    assert (found.gaps_s[1, 1:] == 0.0).all() and (found.positions[:, 1:] == [[2], [1]]).all()


def test_gap_is_to_whoever_leads_then():
    """The second passes at 1 s: before, it is measured against the first, and the first against it thereafter."""
    time = TICK * np.arange(1, 121)
    lines = telemetry(np.full(120, 0.0) + 2.0 * time), telemetry(3.0 * time - 1.0)
    found = standings(lines, [row(2), row(1)])
    before, after = time < 1.0 - 1e-9, time > 1.0 + 1e-9
    assert (found.positions[0, before] == 1).all() and (found.positions[0, after] == 2).all()
    np.testing.assert_allclose(found.gaps_s[0, after], time[after] - (2.0 * time[after] + 1.0) / 3.0, atol=1e-9)


def test_cars_that_have_finished_keep_the_place_of_the_result():
    """The winner stands at the line; the second drives past it and is put where it finished."""
    time = TICK * np.arange(200)
    first, second = np.minimum(4.0 * time, 8.0), 3.0 * time
    found = standings([telemetry(second), telemetry(first)], [row(2, 8.1 / 3.0, True), row(1, 2.0, True)])
    assert found.positions[:, -1].tolist() == [2, 1] and second[-1] > first[-1]


def test_lines_end_where_the_race_of_a_car_was_over():
    """A car that has finished is taken off the course, far away: no line goes there."""
    race = fg.race("oval", entries=[fg.Entry(max_speed=2.0), fg.Entry(max_speed=6.0)], laps=1, time_limit=14.0)
    assert race.cars[1].finished
    field = Field.of(read_recorded(race))
    for line in field.lines:
        assert (np.abs(line) < 20.0).all()
    assert len(field.lines[1]) < len(field.lines[0]) == len(race.car.telemetry)
    assert Field.of(read_recorded(fg.race("oval", time_limit=0.1))) is None


def test_trace_has_the_lines_of_all_cars_in_their_colours(tmp_path):
    pytest.importorskip("matplotlib")
    fg.trace_picture(three_cars(), tmp_path / "trace.png")
    picture = np.asarray(Image.open(tmp_path / "trace.png").convert("RGB")).astype(int)
    for car in range(3):
        wanted = np.array([round(255.0 * part) for part in car_colour(car)[:3]])
        rows = np.argwhere((np.abs(picture - wanted) <= 3).all(axis=2))[:, 0]
        parts = np.histogram(rows, bins=5, range=(0, len(picture)))[0]
        assert (parts > 0).sum() >= 3  # map and panels
    alone = tmp_path / "alone.png"
    fg.trace_picture(fg.race("oval", time_limit=0.2), alone)
    assert np.asarray(Image.open(alone)).shape[0] != picture.shape[0]  # that has panels of tires


def test_clip_shows_the_hardest_contact_or_else_the_first_overtake():
    contacts = [{"time_s": 5.0, "impulse_Ns": 1.0, "at_fault": "a"},
                {"time_s": 9.0, "impulse_Ns": 3.0, "at_fault": "b"}]  # fmt: skip
    overtakes = [{"time_s": 12.0, "by": "c"}]
    assert clip_of_several(8.0, 30.0, contacts, overtakes) == (7.0, "b")
    assert clip_of_several(8.0, 30.0, [], overtakes) == (10.0, "c")
    assert clip_of_several(8.0, 12.0, [], overtakes) == (4.0, "c")
    assert clip_of_several(8.0, 30.0, [], []) is None


@needs_gl
def test_page_has_cars_overtakes_contacts_and_a_clip(tmp_path):
    pytest.importorskip("bokeh")
    from fg_mujoco.addons.look.report import write_report

    race, _ = shunt()
    assert race.contacts
    page = write_report(race, tmp_path / "a.html", clip_seconds=0.2).read_text(encoding="utf-8")
    for heading in ("Cars", "Gaps and positions", "Overtakes", "Contacts"):
        assert f"<h2>{heading}</h2>" in page
    for car in range(2):
        assert f'style="background:{car_colour_hex(car)}">{car}</span> car_{car}' in page
    contact = race.contacts[0]
    assert f"<td>{contact.impulse_Ns:.2f}</td>" in page and contact.at_fault == "car_1"
    assert "data:video/mp4" in page and "<h2>car_1, from" in page


def test_name_of_a_car_is_text_in_the_page(tmp_path):
    pytest.importorskip("bokeh")
    from fg_mujoco.addons.look.report import write_report

    name = '</script><b onclick="x">&'
    race = fg.race("oval", entries=[fg.Entry(name=name), fg.Entry(name="other")], laps=1, time_limit=0.2)
    page = write_report(race, tmp_path / "a.html", clip_seconds=None).read_text(encoding="utf-8")
    assert name not in page and "&lt;/script&gt;&lt;b onclick=&quot;x&quot;&gt;&amp;" in page
    fg.trace_picture(race, tmp_path / "a.png")


def test_a_roll_over_is_said_and_marked_on_the_map(tmp_path):
    pytest.importorskip("bokeh")
    from fg_mujoco.addons.look.report import write_report

    tall = fg.CarChanges(center_of_gravity_height=0.16)
    swerves = driven(lambda odometry: (0.4 if odometry.stamp > 0.2 else 0.0, 7.0))
    rolled = fg.race("oval", swerves, tires="coulomb", mu=1.3, changes=tall, start=fg.Start(speed=7.0, offset=-0.5))
    page = write_report(rolled, tmp_path / "page.html", clip_seconds=None).read_text("utf-8")
    assert f"Rolled over {rolled.car.rollover}. The map marks the place with a cross." in page


def test_height_of_the_ground_loads_and_jumps_are_shown(tmp_path):
    pytest.importorskip("bokeh")
    from fg_mujoco.addons.look.report import write_report

    before = fg.Start(s=20.5, speed=5.0)
    jumps = fg.race("oval[crest=0.5]", driven(lambda odometry: (0.0, 5.0)), start=before, time_limit=2.5)
    (jump,) = jumps.car.jumps
    columns = tick_columns(read_recorded(jumps))
    assert columns["ground_m"].max() == pytest.approx(0.5, abs=0.01) and columns["ground_m"][0] == 0.0
    flies = columns["time_s"] == jump.time_s
    assert sum(columns[f"load_{wheel}_N"] for wheel in WHEELS)[flies] == 0.0
    page = write_report(jumps, tmp_path / "page.html", clip_seconds=None).read_text("utf-8")
    assert f"Jumped {jump}." in page and "ground [m]" in page and "load [N]" in page
    level = write_report(fg.race("oval", time_limit=0.2), tmp_path / "level.html", clip_seconds=None)
    assert "ground [m]" not in level.read_text("utf-8")
