"""Loading a planner: by name, from a file, as an object; and what each mistake is told, in one line."""

import hashlib
import textwrap

import pytest

import fg_mujoco as fg
from cases import each
from conftest import Straight
from fg_mujoco.errors import ControllerError
from fg_mujoco.messages import DriveCommand
from fg_mujoco.racing.planner_origin import _distributions, origin, source_code
from fg_mujoco.racing.planners import find_controller, make_controller
from fg_mujoco.simulation.planner_adapter import plan
from scan_worlds import CAR, MU, corridor, odometry_of

SCAN, ODOMETRY = corridor(1.0, 1.0, 5.0), odometry_of(1.0)
GOOD = textwrap.dedent("""
    from dataclasses import dataclass
    from fg_mujoco.messages import DriveCommand

    @dataclass
    class Planner:
        max_speed: float
        gain: float = 1.0

        def reset(self):
            pass

        def __call__(self, scan, odometry):
            return DriveCommand(steering_angle=0.0, speed=self.gain * self.max_speed)
""")


def make(source):
    return make_controller(source, car=CAR, mu=MU, max_speed=3.0)


@pytest.fixture
def in_file(tmp_path):
    def write(text, name="Planner"):
        path = tmp_path / "mine.py"
        path.write_text(textwrap.dedent(text))
        return f"{path}:{name}"

    return write


def refusal(action, *names):
    """The one line that the mistake is told in, which has all of `names` in it."""
    with pytest.raises(ControllerError) as caught:
        action()
    message = str(caught.value)
    assert "\n" not in message
    for name in names:
        assert name in message
    return message


# -- what loads


def test_a_planner_in_a_file_is_built_with_what_its_constructor_names(in_file):
    planner = make(in_file(GOOD))
    assert planner.gain == 1.0
    assert plan(planner, SCAN, ODOMETRY) == DriveCommand(steering_angle=0.0, speed=3.0)


def test_a_file_is_read_afresh_each_time(in_file):
    make(in_file(GOOD))
    again = make(in_file(GOOD.replace("gain: float = 1.0", "gain: float = 0.5")))
    assert again.gain == 0.5


# -- what does not


@each(
    ("text", "reason"),
    [
        ("def broken(:\n", "SyntaxError"),
        ("import no_such_module\n", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("raise ValueError('two\\nlines')\n", "ValueError: two lines"),
        ("import sys\nsys.exit(3)\n", "SystemExit: 3"),
        ("\x00", "Error"),
    ],
)
def test_a_file_that_does_not_import_is_told_why(in_file, text, reason):
    refusal(lambda: make(in_file(text)), "mine.py", "does not import", reason)


def test_a_constructor_that_wants_something_else_is_told_what_it_may_name(in_file):
    wanting = GOOD.replace("max_speed: float", "max_speed: float\n    track: object\n    pose: object")
    refusal(lambda: make(in_file(wanting)), "mine.py:Planner", "wants track, pose", "car, mu, max_speed")


# -- its settings

SETTINGS = """
    from dataclasses import dataclass

    @dataclass(frozen=True, kw_only=True)
    class PlannerSettings:
        gain: float = 1.0
        window: int = 3
        mirrored: bool = False
        side: str = "left"

        def __post_init__(self):
            if self.gain < 0.0:
                raise ValueError("gain below 0")

    class Planner:
        Settings = PlannerSettings

        def __init__(self, max_speed, settings=None):
            self.settings = settings or PlannerSettings(window=5)

        def reset(self):
            pass

        def __call__(self, scan, odometry):
            pass
"""


def make_with(source, **settings):
    return make_controller(source, car=CAR, mu=MU, max_speed=3.0, settings=settings)


def test_settings_that_are_given_differ_and_the_others_are_its_own(in_file):
    settings = make_with(in_file(SETTINGS), gain=2, mirrored=True).settings
    assert (settings.gain, settings.window, settings.mirrored, settings.side) == (2, 3, True, "left")


# -- where it comes from


def test_the_origin_of_a_file_is_what_was_read_and_not_what_it_became(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(GOOD, "utf-8")
    found = find_controller(f"{path}:Planner")
    path.write_text("", "utf-8")
    assert source_code(found) == GOOD.encode()
    path.write_text(GOOD, "utf-8")
    told = origin(f"{path}:Planner")
    read = {"file": str(path), "sha256": hashlib.sha256(GOOD.encode()).hexdigest()}
    assert told == {"distribution": None, "version": None, **read}


def test_a_users_file_is_of_no_package_and_none_is_looked_through(tmp_path, monkeypatch):
    path = tmp_path / "crawler.py"
    path.write_text(GOOD, "utf-8")
    monkeypatch.setattr("importlib.metadata.packages_distributions", lambda: 1 / 0)
    _distributions.cache_clear()
    assert origin(f"{path}:Planner")["distribution"] is None
    with pytest.raises(ZeroDivisionError):
        origin(Straight())


@pytest.mark.slow
def test_a_file_that_was_edited_is_read_anew(tmp_path):
    """A number is changed, by nothing that changes the code's shape."""
    text = """
from fg_mujoco.controllers.control.driving import DrivingSettings
from fg_mujoco.controllers.control.planner import GoalPlanner
class Fixed(GoalPlanner):
    Settings = DrivingSettings
    @staticmethod
    def goal(geometry, ranges, car, settings, debug):
        return 0.25, 1.0
"""
    path, bearings = tmp_path / "fixed.py", []
    scan = fg.Simulation(fg.World("oval")).reset()[0]
    for bearing in ("0.25", "0.50", "0.25"):
        path.write_text(text.replace("0.25", bearing), "utf-8")
        bearings.append(make(f"{path}:Fixed").find_goal(scan)[0])
    assert bearings == [0.25, 0.5, 0.25]
