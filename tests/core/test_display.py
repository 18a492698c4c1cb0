"""How objects show themselves: short reprs, tables and pictures in notebooks, pages by `show()`."""

import re
import webbrowser
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import fg_mujoco as fg
from conftest import Straight
from fg_mujoco.display import LONGEST
from fg_mujoco.racing.randomization import Choice
from fg_mujoco.simulation.planner_failure import PlannerFailure

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = "<script>alert(1)</script>&amp;\"'\n" + "long" * 200


@pytest.fixture(scope="module")
def crashed():
    return fg.race("oval", Straight(4.0), laps=1)


@pytest.fixture(scope="module")
def comparison(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shown") / "comparison"
    return fg.compare(["gap_finder"], track=["oval"], laps=1, out=folder, workers=1)


@pytest.fixture(scope="module")
def worlds():
    return fg.rollout("oval", n=12, laps=1, time_limit=0.5, randomize={"mu": (0.6, 1.2)}, workers=1)


def test_every_repr_is_one_short_line_that_says_what_it_is(lap, crashed, comparison, worlds):
    simulation = fg.Simulation(lap.world)
    scan, odometry = simulation.reset()
    simulation.step(fg.STOP)
    ring = tuple((float(np.cos(angle)), float(np.sin(angle))) for angle in np.linspace(0.0, 6.2, 90))
    track = lap.world.track
    failure = PlannerFailure(
        error="ZeroDivisionError: " + "x" * 900, time_s=1.0, file="a.py", line=3, traceback="a\nb\n" * 99,
        whole_traceback="c\n" * 999, scan=scan, odometry=odometry,
    )  # fmt: skip
    objects = [
        lap, *lap.cars, crashed, lap.world, lap.world.car, lap.world.vehicle, lap.world.parameters, track, comparison,
        worlds, worlds.randomization, worlds.setup(3), worlds.base, simulation, scan, odometry, simulation.slip,
        simulation.lidar, simulation.engine, simulation.engine.beams, lap.car.decision_times, failure, fg.STOP,
        fg.load_track("scene:slow_leader:1"), fg.Entry(name="x" * 60), fg.Prism(footprint=ring),
        fg.MovingObstacle(length=1 / 3, width=1 / 3, start=(1 / 3, 2 / 3), end=(4 / 3, 5 / 3), speed=1 / 3),
        fg.CarChanges(mu=1 / 3, mass=10 / 3), fg.LidarEffects(), fg.Tires.load("forzaeth_nuc2"), fg.Start(s=1.0),
        Choice(tuple(range(900))), fg.Setup.of(track, obstacles=track.walls), replace(track, name=HOSTILE),
        replace(lap, track=HOSTILE, cars=(replace(lap.car, controller=HOSTILE),)), fg.OpenGround(seconds=1 / 3),
    ]  # fmt: skip
    for found in objects:
        text, kind = repr(found), type(found)
        assert len(text) <= LONGEST and "\n" not in text, (kind, len(text))
        assert "array(" not in text and " ..., " not in text, text
        if kind.__module__.startswith("fg_mujoco"):
            assert text.startswith(f"{kind.__name__}("), text
            assert not re.search(r"object at 0x", text), text


def parsed(html):
    """Return the HTML as a tree; what is not escaped does not parse, or has other elements."""
    tree = ElementTree.fromstring(f"<div>{html}</div>")
    known = {"div", "p", "table", "thead", "tbody", "tr", "th", "td"}
    known |= {f"{SVG}{name}" for name in ("svg", "title", "path", "rect", "text")}
    assert {element.tag for element in tree.iter()} <= known
    return tree


def texts(tree):
    return "\n".join("".join(element.itertext()) for element in tree.iter() if element.tag in ("td", "th", "p"))


def test_what_a_notebook_shows_is_well_formed_and_escaped(lap, crashed, comparison, worlds):
    hostile = "<script>alert(1)</script>&\"'"
    track = replace(lap.world.track, name=hostile)
    cells = tuple(cell | {"planner": hostile} for cell in comparison.cells)
    shown = [
        track,
        replace(lap, track=hostile, cars=(replace(lap.car, controller=hostile),)),
        replace(comparison, cells=cells),
        replace(worlds, tracks=(track,)),
    ]
    for found in shown:
        assert hostile in texts(parsed(found._repr_html_())), type(found)
    for found in (lap, crashed, fg.load_track("scene:slow_leader:1"), fg.load_track("random:3:tight")):
        assert parsed(found._repr_html_()).find(f"{SVG}svg") is not None


def numbers(text):
    return np.array([float(number) for number in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text)])


def test_the_driven_line_is_where_the_car_was_in_the_colours_of_its_speed(crashed):
    paths = parsed(crashed._repr_html_()).findall(f".//{SVG}path")
    line = [path for path in paths if path.attrib.get("stroke-width") == "2.2"]
    colours = [path.attrib["stroke"] for path in line]
    assert colours[0] == "#440154" and colours[-1] == "#fde725"  # from standstill to the fastest
    course = crashed.world.track
    low, high = (course.right_wall.min(axis=0), course.right_wall.max(axis=0))
    scale = 560.0 / (high[0] - low[0] + 1.0)  # [px/m] with a margin of 0.5 m on either side
    first = numbers(line[0].attrib["d"])[:2]
    x, y = crashed.car.column("x_m")[0], crashed.car.column("y_m")[0]
    np.testing.assert_allclose(first, ((x - low[0] + 0.5) * scale, (high[1] + 0.5 - y) * scale), atol=0.06)
    (cross,) = (path for path in paths if path.attrib.get("stroke") == "#d00000")
    crash = crashed.car.crash
    place = ((crash.x_m - low[0] + 0.5) * scale, (high[1] + 0.5 - crash.y_m) * scale)
    np.testing.assert_allclose(numbers(cross.attrib["d"])[:2] + 5.0, place, atol=0.06)


def test_show_writes_a_page_and_says_where(crashed, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(webbrowser, "get", lambda *_: pytest.fail("no terminal, no browser"))
    monkeypatch.setenv("DISPLAY", ":0")
    crashed.show(tmp_path / "crash.html")
    assert capsys.readouterr().out == f"picture: {tmp_path / 'crash.html'}\n"
    page = (tmp_path / "crash.html").read_text("utf-8")
    assert page.startswith("<!doctype html>") and crashed._repr_html_() in page
    assert "http" not in page.replace("http://www.w3.org/2000/svg", "")  # nothing is fetched

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    crashed.world.track.show()
    (place,) = tmp_path.glob("fg_mujoco-*.html")
    assert capsys.readouterr().out == f"picture: {place}\n"
    replace(crashed.world.track, name="not UTF-8: \udcff").show(tmp_path / "name.html")
    assert "not UTF-8: \\udcff" in (tmp_path / "name.html").read_text("utf-8")
    with pytest.raises(fg.SettingsError, match=r"path is 'a\.png'; accepted: a file that ends in \.html"):
        crashed.show("a.png")
