"""How objects show themselves: short reprs, tables and pictures in notebooks, pages by `show()`."""

import importlib.util
import re
import webbrowser
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

import fg_mujoco as fg
from conftest import Straight
from fg_mujoco.addons.arena.grid_study import StudyProgress
from fg_mujoco.addons.arena.random_courses.generator import GeneratorSettings
from fg_mujoco.addons.arena.tight_courses.tight import TightSettings
from fg_mujoco.addons.gym2d import F110Env
from fg_mujoco.course.lap_timer import LapTimer
from fg_mujoco.display import LONGEST
from fg_mujoco.lab.manoeuvres import find_manoeuvre
from fg_mujoco.lidar.lidar import RangefinderLidar
from fg_mujoco.racing.race import RaceProgress
from fg_mujoco.racing.randomization import Choice, Uniform
from fg_mujoco.rollouts.rollouts import RolloutProgress
from fg_mujoco.simulation.planner_failure import PlannerFailure
from fg_mujoco.vehicle.tire_slip import TireSlipMeter

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = "<script>alert(1)</script>&amp;\"'\n" + "long" * 200


@pytest.fixture(scope="module")
def crashed():
    return fg.race("oval", Straight(4.0), laps=1)


@pytest.fixture(scope="module")
def comparison(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shown") / "comparison"
    return fg.compare(["gap_finder"], track=["oval"], laps=1, out=folder, pictures=False, workers=1)


@pytest.fixture(scope="module")
def worlds():
    return fg.rollout("oval", n=12, laps=1, time_limit=0.5, randomize={"mu": (0.6, 1.2)}, workers=1)


@pytest.fixture(scope="module")
def objects(lap, crashed, comparison, worlds, tmp_path_factory):
    """An object of each public class, by the class, and others whose repr could be long."""
    folder = fg.write_run(lap, tmp_path_factory.mktemp("shown") / "run", picture=False)
    debugged = fg.debug(folder)
    simulation = fg.Simulation(lap.world)
    scan, odometry = simulation.reset()
    simulation.step(fg.STOP)
    track, model = lap.world.track, lap.world.model
    entries = [fg.Entry(name="x" * 60), fg.Entry(controller="pure_pursuit", max_speed=3.0)]
    several = fg.race("oval", entries=entries, laps=1, time_limit=0.3)
    contact = fg.Contact(
        time_s=1.0, cars=("a", "b"), impulse_Ns=1 / 3, closing_speed_m_s=1 / 3, displacement_m=1 / 3, at_fault="a",
        x_m=1.0, y_m=2.0,
    )  # fmt: skip
    ring = tuple((float(np.cos(angle)), float(np.sin(angle))) for angle in np.linspace(0.0, 6.2, 90))
    renderer = fg.Renderer.__new__(fg.Renderer)  # without OpenGL
    renderer.size, renderer.description = (640, 480), "EGL"
    film = fg.Film.__new__(fg.Film)
    film.renderer = renderer
    map_track = fg.MapTrack(
        name="map", centreline=track.centreline, width_right=track.width_right, width_left=track.width_left,
        wall_right=track.right_wall, wall_left=track.left_wall,
    )  # fmt: skip
    of_dm_env = []
    if importlib.util.find_spec("dm_control"):  # which there is not for each Python
        from fg_mujoco.envs import dm_environment

        of_dm_env = [dm_environment.load("oval"), dm_environment.load("oval").physics]
    recorded = tmp_path_factory.mktemp("shown") / "recorded"
    fg.rollout("oval", n=2, laps=1, time_limit=0.1, record="scans:100", out=recorded, workers=1)
    dataset = fg.read_dataset(recorded)
    failure = PlannerFailure(
        error="ZeroDivisionError: " + "x" * 900, time_s=1.0, file="a.py", line=3, traceback="a\nb\n" * 99,
        whole_traceback="c\n" * 999, scan=scan, odometry=odometry,
    )  # fmt: skip
    return [
        several, *several.cars, *entries, entries[1].world_car(), contact,
        fg.Overtake(time_s=1.0, by="a", of="b", s_m=1 / 3),
        track, map_track, fg.load_track("scene:slow_leader:1"), lap, crashed, lap.world, lap.world.car, comparison,
        worlds, dataset, next(iter(dataset)),
        simulation, scan, odometry, simulation.slip, simulation.lidar, simulation.engine, renderer, film,
        fg.read_run(folder), fg.replay(folder), debugged, debugged.chosen, fg.STOP, lap.world.vehicle,
        lap.world.parameters, track.map_line,
        simulation.engine.beams, simulation.engine.beams.geometry, LapTimer(track), TireSlipMeter(model, "car/"),
        RangefinderLidar(fg.World(track, lidar="rangefinder").model, "car/lidar/"), lap.car.decision_times, failure,
        fg.Box(x=1.0, y=2.0, length=0.3, width=0.2), fg.Cylinder(x=1.0, y=2.0, radius=0.2), fg.Prism(footprint=ring),
        fg.MovingObstacle(length=1 / 3, width=1 / 3, start=(1 / 3, 2 / 3), end=(4 / 3, 5 / 3), speed=1 / 3),
        fg.CarChanges(mu=1 / 3, mass=10 / 3), GeneratorSettings(), TightSettings(), fg.LidarEffects(),
        fg.Tires.load("forzaeth_nuc2"), fg.Patch(x=1 / 3, y=0.0, length=1.0, width=1.0, mu=0.3),
        fg.Start(s=1.0), Uniform(0.1, 0.2), Choice(tuple(range(900))), worlds.randomization, worlds.setup(3),
        fg.Setup.of(track, obstacles=track.walls), worlds.base,
        replace(lap, track=HOSTILE, cars=(replace(lap.car, controller=HOSTILE),)),
        RaceProgress(time=1.0, laps_completed=1, laps_requested=2, speed=3.0, racing=1),
        StudyProgress(runs=3, runs_found=1, runs_driven=1, wall_time_s=1.0),
        RolloutProgress(worlds=3, worlds_found=1, worlds_driven=1, world_seconds=2.0, wall_time_s=1.0),
        fg.World.from_xml(lap.world.xml), fg.OpenGround(seconds=1 / 3), fg.Executor(),
        find_manoeuvre("circle").commands(lap.world.parameters, 1.0),
        replace(track, name=HOSTILE), *of_dm_env, F110Env(),
    ]  # fmt: skip


@pytest.mark.slow
def test_every_public_class_is_among_those_that_are_looked_at(objects):
    kinds = {name: getattr(fg, name) for name in fg.__all__ if isinstance(getattr(fg, name), type)}
    made = {
        name: kind
        for name, kind in kinds.items()
        if not issubclass(kind, Exception) and not getattr(kind, "_is_protocol", False)
    }
    assert {name for name, kind in made.items() if not any(type(found) is kind for found in objects)} == set()


def test_every_repr_is_one_short_line_that_says_what_it_is(objects):
    for found in objects:
        text, kind = repr(found), type(found)
        assert len(text) <= LONGEST and "\n" not in text, (kind, len(text))
        assert "array(" not in text and " ..., " not in text, text
        if kind.__module__.startswith("fg_mujoco"):
            assert text.startswith(f"{kind.__name__}("), text
            assert not re.search(r"object at 0x", text), text


def test_reprs_have_their_figures_with_units(lap, crashed, comparison, worlds):
    track = lap.world.track
    points = len(track.centreline)
    assert repr(track).startswith(f"Track('oval', {track.length:.1f} m long, 2.20 m wide, ")
    assert repr(track).endswith(f"m, {points} points)")
    best = min(lap.car.lap_times_s)
    assert repr(lap) == (
        f"RaceResult('gap_finder' on 'oval': 1 of 1 laps in {lap.sim_time_s:.1f} s, best {best:.2f} s at mu 1.049, "
        "no collision)"
    )
    assert str(crashed.car.crash) in repr(crashed) and crashed.car.crash is not None
    assert "1 runs, 1 controllers on 1 courses: 1 finished" in repr(comparison)
    assert repr(worlds).startswith("RolloutResult(12 worlds on 'oval': ends 12 time_limit; median first lap none; ")
    assert repr(worlds.setup(0)).startswith("Setup('oval', gap_finder(changes=CarChanges(mu=")


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
    cells = tuple(replace(cell, controller=hostile) for cell in comparison.cells)
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
