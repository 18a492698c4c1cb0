"""Planners of other packages are found by their entry points, and it can be told where a planner comes from."""

import hashlib
import sys

import pytest

import fg_mujoco as fg
from conftest import Straight
from fg_mujoco.cli.lists import describe
from fg_mujoco.errors import ControllerError
from fg_mujoco.racing.planners import find_controller, make_controller
from fg_mujoco.racing.trust import _distributions, origin, source_code
from scan_worlds import CAR, MU

PLANNER = """
\"\"\"A planner of another package.\"\"\"
from fg_mujoco.messages import DriveCommand
class Crawler:
    \"\"\"Crawls.\"\"\"
    def reset(self):
        pass
    def __call__(self, scan, odometry):
        return DriveCommand(steering_angle=0.0, speed=0.2)
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Install a package of a name with a module and entry points, as a wheel does, on the path of this test."""

    def install(package, entries, text=PLANNER, number="1.2.3"):
        site = tmp_path / f"site-{package}"
        site.mkdir()
        (site / f"{package}.py").write_text(text, "utf-8")
        info = site / f"{package}-{number}.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: {number}\n", "utf-8")
        lines = "\n".join(f"{name} = {value}" for name, value in entries.items())
        (info / "entry_points.txt").write_text(f"[fg_mujoco.controllers]\n{lines}\n", "utf-8")
        (info / "top_level.txt").write_text(f"{package}\n", "utf-8")
        monkeypatch.syspath_prepend(str(site))
        monkeypatch.delitem(sys.modules, package, raising=False)
        return site

    yield install
    for name in ("crawlers", "others"):
        sys.modules.pop(name, None)


def make(source):
    return make_controller(source, car=CAR, mu=MU, max_speed=3.0)


def test_a_planner_that_a_package_registers_is_listed_and_made_by_its_name(installed):
    site = installed("crawlers", {"crawler": "crawlers:Crawler"})
    assert "crawler" in fg.controller_names()
    assert type(make("crawler")).__name__ == "Crawler"
    text = (site / "crawlers.py").read_bytes()
    assert origin("crawler") == {
        "distribution": "crawlers",
        "version": "1.2.3",
        "file": str(site / "crawlers.py"),
        "sha256": hashlib.sha256(text).hexdigest(),
    }
    told = describe("crawler")
    assert (told["summary"], told["distribution"]) == ("A planner of another package.", "crawlers")


def test_a_bundled_name_stays_the_bundled_planner(installed):
    installed("crawlers", {"gap_finder": "crawlers:Crawler"})
    assert fg.controller_names().count("gap_finder") == 1
    assert type(make("gap_finder")).__module__ == "fg_mujoco.controllers.gap_finder"
    assert origin("gap_finder")["distribution"] == "fg-mujoco"


def test_a_name_of_two_packages_is_refused_with_both(installed):
    installed("crawlers", {"crawler": "crawlers:Crawler"})
    installed("others", {"crawler": "others:Crawler"}, number="4.5")
    with pytest.raises(ControllerError, match=r"'crawler' is registered by crawlers 1\.2\.3 and others 4\.5; accepted"):
        make("crawler")


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("crawlers:Walker", "of crawlers 1.2.3, does not load: AttributeError"),
        ("nowhere:Crawler", "of crawlers 1.2.3, does not load: ModuleNotFoundError"),
        ("crawlers:DriveCommand.__doc__", "of crawlers 1.2.3, is "),
    ],
)
def test_an_entry_point_that_leads_nowhere_is_told_with_its_package(installed, value, told):
    installed("crawlers", {"crawler": value})
    with pytest.raises(ControllerError) as refused:
        make("crawler")
    assert told in str(refused.value) and "\n" not in str(refused.value)


def test_the_origin_of_a_file_is_what_was_read_and_not_what_it_became(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(PLANNER, "utf-8")
    found = find_controller(f"{path}:Crawler")
    path.write_text("", "utf-8")
    assert source_code(found) == PLANNER.encode()
    path.write_text(PLANNER, "utf-8")
    told = origin(f"{path}:Crawler")
    assert told == {
        "distribution": None,
        "version": None,
        "file": str(path),
        "sha256": hashlib.sha256(PLANNER.encode()).hexdigest(),
    }


def test_a_users_file_is_of_no_package_and_none_is_looked_through(tmp_path, monkeypatch):
    path = tmp_path / "crawler.py"
    path.write_text(PLANNER, "utf-8")
    monkeypatch.setattr("importlib.metadata.packages_distributions", lambda: 1 / 0)
    _distributions.cache_clear()
    assert origin(f"{path}:Crawler")["distribution"] is None
    with pytest.raises(ZeroDivisionError):
        origin(Straight())


@pytest.mark.slow
def test_a_kernel_of_a_file_that_was_edited_is_compiled_anew(tmp_path):
    """A number is changed, by nothing that changes the code's shape."""
    text = """
from fg_mujoco.controllers.control.driving import DrivingSettings
from fg_mujoco.controllers.control.planner import GoalPlanner
class Fixed(GoalPlanner):
    Settings = DrivingSettings
    @staticmethod
    def goal(scan, ranges, car, settings, shown):
        return 0.25, 1.0
"""
    path, bearings = tmp_path / "fixed.py", []
    scan = fg.Simulation(fg.World("oval")).reset()[0]
    for bearing in ("0.25", "0.50", "0.25"):
        path.write_text(text.replace("0.25", bearing), "utf-8")
        bearings.append(make(f"{path}:Fixed").find_goal(scan)[0])
    assert bearings == [0.25, 0.5, 0.25]
