"""Things by name: imported when they are used, those of other packages beside our own, and refused in one line."""

from pathlib import Path

import pytest

import fg_mujoco as fg
from fg_mujoco.errors import SettingsError, TrackError
from fg_mujoco.registry import Registry

MODULE = '''
from pathlib import Path
import fg_mujoco as fg
import fg_mujoco.vehicle.sensors
from fg_mujoco.course.formats import CourseFormat
from fg_mujoco.addons.arena.random_courses.generator import generate_track
class Sonar(fg.vehicle.sensors.Sensor):
    columns = ("ahead_m",)
    def measure(self, car):
        return car.ranges[540:541]
HERE = Path(__file__).parent
CAR, RUBBER, TEXT = HERE / "lorry.xml", HERE / "rubber.toml", "lorry.xml"
SEEDS = CourseFormat(
    accepts=lambda text: text.endswith(".seed"),
    load=lambda text, car: generate_track(int(Path(text).read_text())),
    texts="a file of a .seed",
)
'''


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install a package that registers a thing in a group."""

    def install(group, entry, name="yard"):
        folder = tmp_path / f"{name}-1.2.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.2\n")
        (folder / "entry_points.txt").write_text(f"[fg_mujoco.{group}]\n{entry}\n")
        (tmp_path / "yard.py").write_text(MODULE)

    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(__import__("sys").modules, "yard", raising=False)
    return install


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


def test_a_vehicle_of_another_package_is_known_by_its_name(package, tmp_path):
    package("vehicles", "lorry = yard:CAR")
    (tmp_path / "lorry.xml").write_text(fg.Vehicle.load("nuc2").text)
    assert fg.vehicle_names()[-1] == "lorry"
    lorry = fg.Vehicle.load("lorry")
    assert lorry.parameters == fg.Vehicle.load("nuc2").parameters
    assert fg.race("oval", laps=1, vehicle="lorry", time_limit=0.2).states.shape[0] > 0


def test_tires_of_another_package_are_known_by_their_name(package, tmp_path):
    package("tires", "rubber = yard:RUBBER")
    text = (Path(fg.models.__file__).parent / "tires" / "forzaeth_nuc2.toml").read_text()
    (tmp_path / "rubber.toml").write_text(text)
    assert "rubber" in fg.tire_names() and fg.Tires.load("rubber") == fg.Tires.load("forzaeth_nuc2")


def test_a_sensor_of_another_package_is_known_by_its_name(package):
    package("sensors", "sonar = yard:Sonar")
    scan, odometry = fg.Simulation(fg.World("oval"), sensors=["sonar"]).reset()
    assert odometry.readings["sonar"]["ahead"] == scan.ranges[540]


def test_a_vehicle_that_is_no_path_is_refused_with_its_package(package):
    package("vehicles", "text = yard:TEXT")
    with pytest.raises(SettingsError, match=r"^vehicle 'text' of yard 1.2, yard:TEXT is a str; accepted: a Path$"):
        fg.Vehicle.load("text")


def test_a_format_of_tracks_of_another_package_is_read(package, tmp_path):
    package("track_formats", "seeds = yard:SEEDS")
    (tmp_path / "my.seed").write_text("7")
    assert (fg.load_track(str(tmp_path / "my.seed")).centreline == fg.load_track("random:7").centreline).all()
    with pytest.raises(TrackError, match=r"unknown track 'ovall'; .*, a map \.yaml or a file of a \.seed; did you"):
        fg.load_track("ovall")
