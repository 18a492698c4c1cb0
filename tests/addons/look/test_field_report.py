"""What is told of several cars after a race: standings, trace.png, and the page of the run."""

import numpy as np
import pytest
from PIL import Image

import fg_mujoco as fg
from fg_mujoco.addons.arena.race_control.standings import standings
from fg_mujoco.addons.look.report.clip import clip_of_several
from fg_mujoco.addons.look.report.field import Field
from fg_mujoco.addons.look.report.recorded import read_recorded
from fg_mujoco.simulation.cars import car_colour, car_colour_hex
from field_races import shunt, three_cars
from rendered import needs_gl

TICK = 0.025


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
    for share_library in (True, False):
        written = write_report(race, tmp_path / "a.html", clip_seconds=None, share_library=share_library)
        page = written.read_text(encoding="utf-8")
        assert name not in page and "&lt;/script&gt;&lt;b onclick=&quot;x&quot;&gt;&amp;" in page
    fg.trace_picture(race, tmp_path / "a.png")
