import ast
import contextlib
import functools
import gc
import importlib
import os
import signal
import subprocess
import sys
from pathlib import Path

# Workers share the cores: each has one thread for numpy's linear algebra, too, whose threads wait by spinning; numpy
# reads this when it is imported. And processes that the tests start find the package's modules compiled, as users do.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# A shell that runs the tests in its background lets them ignore Ctrl-C, and all that they start, which some tests send.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

import pytest
from hypothesis import settings

import fg_mujoco as fg
from browsers import page_of  # noqa: F401 - a fixture of all tests
from fg_mujoco.rollouts.workers import usable_cores

# The same examples in every run, so that a change that passes here passes everywhere; `make fuzz` tries others.
settings.register_profile("repeatable", max_examples=50, derandomize=True, deadline=None)
settings.register_profile("fuzz", max_examples=1000, deadline=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

# Workers find compiled what others of them have compiled, see `import_share`.
sys.dont_write_bytecode = False

# No test outlives the machine: what they write may stay in memory, where waiting for the disk would take them minutes.
os.fsync = lambda descriptor: None

# The files that take longest, which start first: a worker that begins one of them last keeps the others waiting.
SLOWEST = (
    "test_formats.py", "test_identification.py", "test_rollout_ray.py",
    "test_live_view.py", "test_debug.py", "test_mission.py", "test_docs.py", "test_study.py", "test_f110_scripts.py",
    "test_labs.py", "test_controller_contract.py", "test_friction_lab.py", "test_failing_planners.py",
    "test_every_course.py", "test_ros2.py", "test_vehicle_contract.py", "test_tire_forces.py",
    "test_autodrive_bridge.py", "test_refusals.py", "test_lab_skidpad.py",
    "test_training_example.py", "test_leaks.py", "test_readme.py", "test_duels.py", "test_friction_cli.py",
    "test_report_pages.py", "test_rendering_files.py", "test_plan_in_time.py",
    "test_replay_proof.py", "test_line_mpc.py", "test_doors.py", "test_ros_nodes.py",
    "test_kills.py", "test_random_courses.py", "test_gym_vector.py", "test_map_course.py", "test_f110_interfaces.py",
    "test_ros_surroundings.py", "test_damaged_runs.py", "test_rollouts.py", "test_fault.py",
    "test_lidar_tracks.py", "test_environment.py", "test_report.py",
    "test_packaging.py", "test_native.py", "test_predictions.py", "test_tires_single_track.py",
    "test_cli.py", "test_tires_circles.py", "test_bag_replay.py", "test_line_formats.py", "test_guidance.py",
    "test_scenes.py", "test_rollout_cli.py", "test_residual.py",
)  # fmt: skip

# What takes a second or more here is in whole files of studies, benchmarks, examples, pages, bags, and of what starts
# processes: `make quick` leaves them out, as it does single tests elsewhere that are marked so.
SLOW_FILES = frozenset({
    "test_bag_storage.py",
    "test_debug.py", "test_docs.py", "test_drive.py", "test_every_course.py", "test_every_track.py",
    "test_f110_interfaces.py", "test_f110_scripts.py",
    "test_friction_cli.py", "test_friction_lab.py", "test_formats.py", "test_failing_planners.py",
    "test_damaged_runs.py", "test_folders_load_nothing.py", "test_identification.py",
    "test_kills.py",
    "test_lab_patches.py", "test_lab_skidpad.py", "test_tires_circles.py", "test_labs.py",
    "test_leaks.py",
    "test_live_view.py", "test_map_course.py", "test_duels.py",
    "test_packaging.py",
    "test_readme.py", "test_rendering.py", "test_rendering_cars.py",
    "test_rendering_drive.py", "test_rendering_files.py", "test_replay_proof.py", "test_report.py",
    "test_report_pages.py", "test_rollout_cli.py", "test_rollout_ray.py", "test_slides.py", "test_random_courses.py",
    "test_training_example.py", "test_tutorial.py",
    "test_validation.py",
})  # fmt: skip


def pytest_addoption(parser):
    text = "the files of tests that import a module that differs from main, or, if none does, one of its room"
    parser.addoption("--changed", action="store_true", help=text)


def pytest_sessionfinish(session, exitstatus):
    """Where what changed has no tests, none fails."""
    none = exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED and session.config.getoption("changed")
    if none and not chosen_files():
        session.exitstatus = pytest.ExitCode.OK


def pytest_ignore_collect(collection_path, config):
    if config.getoption("changed") and collection_path.name.startswith("test_") and collection_path.suffix == ".py":
        return collection_path not in chosen_files() or None
    return None


@functools.cache
def chosen_files():
    """The files of tests that differ from main, that import what differs, or that import of its room if none does."""
    root, here = Path(__file__).parents[1], Path(__file__).parent

    def git(*words):
        return subprocess.run(["git", *words], cwd=root, capture_output=True, text=True).stdout.split()

    base = next(iter(git("merge-base", "HEAD", "origin/main") or git("merge-base", "HEAD", "main")), "HEAD")
    since = base if git("diff", "--name-only", base) else "HEAD~1"  # on main itself: what the last commit changed
    changed = {Path(name) for name in git("diff", "--name-only", since) + git("ls-files", "-o", "--exclude-standard")}
    imports = {path: imports_of(path) for path in here.rglob("test_*.py")}
    chosen = {path for path in imports if path.relative_to(root) in changed}
    for path in changed:
        if path.suffix == ".py" and path.parts[0] in ("fg_mujoco", "controllers", "addons", "tests"):
            parts = path.with_suffix("").parts
            module = path.stem if parts[0] == "tests" else ".".join(("fg_mujoco", *parts)[parts[0] == "fg_mujoco" :])
            module = module.removesuffix(".__init__")
            room = f"{module.rpartition('.')[0]}."
            chosen |= {test for test, names in imports.items() if module in names} or {
                test for test, names in imports.items() if any(name.startswith(room) for name in names)
            }
    return chosen


def imports_of(path):
    """The modules that a file imports, and what it takes from them, by their dotted names."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names} | {node.module}
    return names


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One more than there are cores: some tests wait, for a process, a browser or a limit of time."""
    return usable_cores() + 1


def pytest_configure(config):
    # not of pyproject.toml, for which pytest would import the package, and numpy with it, before this file
    config.addinivalue_line("filterwarnings", "ignore::fg_mujoco.errors.Note")
    if hasattr(config.option, "loadscopereorder"):  # pytest-xdist's own order starts with the files of most tests
        config.option.loadscopereorder = False


@pytest.hookimpl(hookwrapper=True)
def pytest_collection(session):
    """Collect without the garbage collector, which would look at each test again and again, now and later."""
    gc.disable()
    import_share(session)
    yield
    gc.freeze()
    gc.enable()


def import_share(session):
    """Import a share of all test files, each worker another one, where all are collected.

    Pytest rewrites the asserts of a file that it imports, which takes two thirds of the time of collecting, and keeps
    the result on disk. So each worker rewrites its own share, and reads what the others have rewritten.
    """
    here = Path(__file__).parent
    worker, count = os.environ.get("PYTEST_XDIST_WORKER"), os.environ.get("PYTEST_XDIST_WORKER_COUNT")
    if worker and count and here in (Path(arg).resolve() for arg in session.config.args):
        for path in sorted(here.rglob("test_*.py"))[int(worker.removeprefix("gw")) :: int(count)]:
            with contextlib.suppress(Exception, pytest.skip.Exception):  # it is imported again when it is collected
                importlib.import_module(path.stem)


@pytest.hookimpl(tryfirst=True)  # before what is marked is left out
def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.name in SLOW_FILES:
            item.add_marker(pytest.mark.slow)
    place = {name: number for number, name in enumerate(SLOWEST)}
    items.sort(key=lambda item: place.get(item.path.name, len(SLOWEST)))


class Straight:
    """Drives straight on, gently."""

    def __init__(self, speed=1.0):
        self.speed = speed

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.02, speed=min(self.speed, odometry.speed + 0.1))


@pytest.fixture(scope="session")
def short_race():
    """A race of 40 ticks."""
    return fg.race("oval", Straight(), laps=1, time_limit=0.99)


@pytest.fixture(scope="session")
def lap():
    """One lap of the oval by the gap finder."""
    return fg.race("oval", laps=1)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder, which is the present one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@contextlib.contextmanager
def plain_runs():
    """Let commands leave out a run's picture and page, which take longer to draw than a short race to drive."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fg_mujoco.pictures.plots.trace_picture", None)
        patch.setattr("fg_mujoco.from_addons.report_race", lambda folder: None, raising=False)
        yield


@pytest.fixture
def without_pictures():
    """Of tests that look at neither."""
    with plain_runs():
        yield
