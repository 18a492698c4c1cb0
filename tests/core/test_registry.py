"""Things by name: imported when they are used, those of other packages beside our own, and refused in one line."""

import hashlib
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.lists import describe
from fg_mujoco.cli.main import main
from fg_mujoco.course.definitions import course_sha256
from fg_mujoco.course.scenes import SCENES, load_scene
from fg_mujoco.errors import ControllerError, SettingsError, TrackError
from fg_mujoco.racing.planner_origin import origin
from fg_mujoco.racing.planners import make_controller
from fg_mujoco.registry import Registry
from refusals import refused
from scan_worlds import CAR, MU

MODULE = '''
"""Things of another package."""
from pathlib import Path
import numpy as np
import fg_mujoco as fg
import fg_mujoco.vehicle.sensors
from fg_mujoco.course.formats import CourseFormat
class Sonar(fg.vehicle.sensors.Sensor):
    columns = ("ahead_m",)
    def measure(self, car):
        return car.ranges[540:541]
HERE = Path(__file__).parent
LORRY, RUBBER, TEXT = HERE / "lorry.xml", HERE / "rubber.toml", "lorry.xml"
SEEDS = CourseFormat(
    accepts=lambda text: text.endswith(".seed"),
    load=lambda text, car: fg.load_track(f"random:{Path(text).read_text().strip()}"),
    texts="a file of a .seed",
)
class Crawler:
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.0, speed=0.2)
def doorway(name, seed, car):
    """A wall with a door of 2 car widths.

    More of it, which no list shows.
    """
    half, y = car.width, 0.2 * seed
    sides = ((-1.2, y - half), (y + half, 1.2))
    boxes = tuple(fg.Box(x=6.0, y=0.5 * (a + b), length=0.2, width=b - a) for a, b in sides)
    walls = tuple(fg.Box(x=7.0, y=side, length=24.0, width=0.2) for side in (-1.3, 1.3))
    way = np.array([[-2.5, 0.0], [15.0, 0.0]])
    return fg.Scene(name=name, way=way, start=2.5, goal=12.5, walls=walls, obstacles=boxes, time_limit=20.0)
def nothing(name, seed, car):
    return None
def misnamed(name, seed, car):
    return doorway("door", seed, car)
def raises(name, seed, car):
    return 1 / 0
'''


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package `yard` that registers a thing in a group; return the file of its module."""

    def install(group, entry, package="yard", version="1.2"):
        folder = tmp_path / f"{package}-{version}.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: {version}\n")
        (folder / "entry_points.txt").write_text(f"[fg_mujoco.{group}]\n{entry}\n")
        (folder / "top_level.txt").write_text(f"{package}\n")
        (tmp_path / f"{package}.py").write_text(MODULE)
        monkeypatch.delitem(sys.modules, package, raising=False)
        return tmp_path / f"{package}.py"

    monkeypatch.syspath_prepend(tmp_path)
    yield install
    for package in ("yard", "others"):
        sys.modules.pop(package, None)


def made(name):
    return make_controller(name, car=CAR, mu=MU, max_speed=3.0)


def test_a_text_is_imported_once_and_when_it_is_used():
    things = Registry("thing", SettingsError, own={"path": "pathlib:Path", "lost": "pathlib:Lost"})
    assert list(things) == ["path", "lost"] and things.names() == ("path", "lost")
    assert things.find("path") is Path
    with pytest.raises(AttributeError):
        things.find("lost")


def test_a_name_that_is_not_known_is_refused_with_the_closest():
    things = Registry("thing", SettingsError, own={"wheel": 1, "tire": 2})
    with pytest.raises(SettingsError, match=r"^thing 'tyre' is not known; accepted: wheel, tire, or 3; did you mean"):
        things.find("tyre", ", or 3")


# -- of another package


def test_a_vehicle_is_known_by_its_name(install, tmp_path):
    install("vehicles", "lorry = yard:LORRY")
    (tmp_path / "lorry.xml").write_text(fg.Vehicle.load("nuc2").text)
    assert fg.vehicle_names()[-1] == "lorry"
    assert fg.Vehicle.load("lorry").parameters == fg.Vehicle.load("nuc2").parameters
    assert fg.race("oval", laps=1, vehicle="lorry", time_limit=0.2).states.shape[0] > 0


def test_tires_are_known_by_their_name(install, tmp_path):
    install("tires", "rubber = yard:RUBBER")
    text = (Path(fg.models.__file__).parent / "tires" / "forzaeth_nuc2.toml").read_text()
    (tmp_path / "rubber.toml").write_text(text)
    assert "rubber" in fg.tire_names() and fg.Tires.load("rubber") == fg.Tires.load("forzaeth_nuc2")


def test_a_sensor_is_known_by_its_name(install):
    install("sensors", "sonar = yard:Sonar")
    scan, odometry = fg.Simulation(fg.World("oval"), sensors=["sonar"]).reset()
    assert odometry.readings["sonar"]["ahead"] == scan.ranges[540]


def test_a_format_of_tracks_is_read(install, tmp_path):
    install("track_formats", "seeds = yard:SEEDS")
    (tmp_path / "my.seed").write_text("7")
    assert (fg.load_track(str(tmp_path / "my.seed")).centreline == fg.load_track("random:7").centreline).all()
    with pytest.raises(TrackError, match=r"unknown track 'ovall'; .*, a map \.yaml or a file of a \.seed; did you"):
        fg.load_track("ovall")


def test_a_planner_is_listed_and_made_by_its_name_and_its_origin_is_told(install):
    file = install("controllers", "crawler = yard:Crawler")
    assert "crawler" in fg.controller_names() and type(made("crawler")).__name__ == "Crawler"
    read = {"file": str(file), "sha256": hashlib.sha256(file.read_bytes()).hexdigest()}
    assert origin("crawler") == {"distribution": "yard", "version": "1.2", **read}
    told = describe("crawler")
    assert (told["summary"], told["distribution"]) == ("Things of another package.", "yard")


def test_a_scene_is_listed_and_made_for_the_car_and_from_the_seed(install, capsys):
    install("scenes", "doorway = yard:doorway")
    assert fg.scene_names() == (*SCENES, "doorway")
    assert main(["track", "scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "scene:doorway: A wall with a door of 2 car widths. (yard 1.2)"
    assert not any("(yard" in line for line in lines[:-1])
    same, again, other = (course_sha256(load_scene(f"scene:doorway:{seed}", CAR)) for seed in (1, 1, 2))
    assert same == again != other
    low, high = fg.load_track("scene:doorway").obstacles
    assert high.y - 0.5 * high.width - (low.y + 0.5 * low.width) == pytest.approx(2.0 * CAR.width)


# -- refused


@pytest.mark.parametrize(
    ("group", "entry", "said"),
    [
        ("vehicles", "thing = yard:TEXT", "vehicle 'thing' of yard 1.2, yard:TEXT is a str; accepted: a Path$"),
        ("controllers", "thing = yard:Walker", "of yard 1.2, does not load: AttributeError"),
        ("controllers", "thing = nowhere:Crawler", "of yard 1.2, does not load: ModuleNotFoundError"),
        ("controllers", "thing = yard:__doc__", "of yard 1.2, is "),
        ("scenes", "thing = yard:nothing", "yard 1.2, yard:nothing is None; accepted: a name such as"),
        ("scenes", "thing = yard:misnamed", "yard 1.2, .* is named 'door'; accepted: 'scene:thing:3'"),
        ("scenes", "thing = yard:raises", "yard 1.2, .* cannot be made: ZeroDivisionError: division by zero"),
        ("scenes", "thing = yard:np.pi", r"yard 1.2, .* is a float; accepted: a function \(name, seed, car\)"),
    ],
)
def test_what_is_no_thing_of_its_kind_is_refused_with_its_package(install, group, entry, said):
    install(group, entry)
    load = {"vehicles": fg.Vehicle.load, "controllers": made, "scenes": lambda name: fg.load_track(f"scene:{name}:3")}
    with pytest.raises(fg.FgMujocoError, match=said) as refusal:
        load[group]("thing")
    assert "\n" not in str(refusal.value)


def test_a_name_of_two_packages_is_refused_with_both(install):
    install("controllers", "crawler = yard:Crawler")
    install("controllers", "crawler = others:Crawler", package="others", version="4.5")
    with pytest.raises(ControllerError, match=r"'crawler' is registered by others 4\.5 and yard 1\.2; accepted"):
        made("crawler")


def test_a_bundled_name_stays_what_is_bundled(install, tmp_path, capsys):
    before = course_sha256(fg.load_track("scene:dead_end:1"))
    install("controllers", "gap_finder = yard:Crawler")
    assert fg.controller_names().count("gap_finder") == 1
    assert type(made("gap_finder")).__module__ == "fg_mujoco.controllers.gap_finder"
    assert origin("gap_finder")["distribution"] == "fg-mujoco"
    install("scenes", "dead_end = others:doorway", package="others")
    assert course_sha256(fg.load_track("scene:dead_end:1")) == before
    said = "scene 'dead_end' of others 1.2, others:doorway has the name of a bundled scene; accepted: a name of"
    assert said in refused(tmp_path, capsys, "track", "scenes")


def test_bundled_scenes_have_room_for_cars_up_to_a_width():
    for name in SCENES:
        for seed in range(5):
            load_scene(f"scene:{name}:{seed}", replace(CAR, width=0.6, length=1.1))
    with pytest.raises(TrackError, match=r"for a car 0.61 m wide; accepted: at most 0.6 m"):
        load_scene("scene:dead_end", replace(CAR, width=0.61))
