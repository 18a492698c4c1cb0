"""A MuJoCo 3D testbed for F1TENTH cars.

    import fg_mujoco as fg

    result = fg.race(fg.load_track("oval"), controller="gap_finder", laps=5)
    print(result.car.lap_times_s, result.car.max_slide_m_s)

What loads slowly (matplotlib) is imported where it is used.
"""

from importlib import import_module as _import_module
from types import FunctionType as _FunctionType
from typing import TYPE_CHECKING
from typing import Any as _Any

from . import interrupts as _interrupts  # noqa: F401  # first: Ctrl-C may come from now on

# isort: split
from .simulation import mujoco_import as _mujoco_import  # noqa: F401  # then: it chooses how pictures are drawn

# isort: split
from .arguments import explained as _explained
from .envs import register_once_imported as _register_once_imported
from .errors import gone as _gone
from .errors import nearest as _nearest
from .registry import added as _added

if TYPE_CHECKING:
    from fg_mujoco.addons.arena.random_courses.generator import generate_track as generate_track
    from fg_mujoco.addons.arena.study.functions import compare as compare
    from fg_mujoco.addons.arena.study.store import Study as Study
    from fg_mujoco.addons.arena.tuning import tune as tune
    from fg_mujoco.addons.learn.dataset import Dataset as Dataset
    from fg_mujoco.addons.learn.dataset import read_dataset as read_dataset
    from fg_mujoco.addons.learn.parallel import parallel_env as parallel_env
    from fg_mujoco.addons.look.debug import debug as debug
    from fg_mujoco.addons.realcar.bag_drive import identify as identify

    from .course.centreline_csv import read_centreline as read_centreline
    from .course.centreline_csv import write_centreline as write_centreline
    from .course.course import Course as Course
    from .course.formats import track_names as track_names
    from .course.maps.export import export_track as export_track
    from .course.maps.map_track import read_map as read_map
    from .course.moving_obstacles import MovingObstacle as MovingObstacle
    from .course.obstacles import Box as Box
    from .course.obstacles import Cylinder as Cylinder
    from .course.obstacles import Prism as Prism
    from .course.open_ground import OpenGround as OpenGround
    from .course.scene import Scene as Scene
    from .course.scenes import scene_names as scene_names
    from .course.track import MapTrack as MapTrack
    from .course.track import Track as Track
    from .errors import BagError as BagError
    from .errors import ControllerError as ControllerError
    from .errors import EngineError as EngineError
    from .errors import FgMujocoError as FgMujocoError
    from .errors import MissingExtraError as MissingExtraError
    from .errors import ModelError as ModelError
    from .errors import PlannerError as PlannerError
    from .errors import RunFolderError as RunFolderError
    from .errors import SettingsError as SettingsError
    from .errors import TrackError as TrackError
    from .lab.commands import Commands as Commands
    from .lab.drive import drive as drive
    from .lab.handling import handling as handling
    from .lidar.effects import LidarEffects as LidarEffects
    from .messages import STOP as STOP
    from .messages import CarParameters as CarParameters
    from .messages import Controller as Controller
    from .messages import DriveCommand as DriveCommand
    from .messages import LaserScan as LaserScan
    from .messages import Odometry as Odometry
    from .pictures.plots import trace_picture as trace_picture
    from .pictures.plots import track_picture as track_picture
    from .pictures.plots import write_run as write_run
    from .pictures.rendering import Film as Film
    from .pictures.rendering import Renderer as Renderer
    from .pictures.rendering import render as render
    from .pictures.rendering import write_video as write_video
    from .racing.entries import Entry as Entry
    from .racing.planners import controller_names as controller_names
    from .racing.planners import make_controller as make_controller
    from .racing.race import race as race
    from .racing.replay import replay as replay
    from .racing.resimulation import scan_at as scan_at
    from .racing.result import CarResult as CarResult
    from .racing.result import RaceResult as RaceResult
    from .racing.rules import Contact as Contact
    from .racing.run_folder import Run as Run
    from .racing.run_folder import read_run as read_run
    from .racing.setup import Setup as Setup
    from .rollouts.rollout_result import RolloutResult as RolloutResult
    from .rollouts.rollout_result import read_rollout as read_rollout
    from .rollouts.rollouts import Executor as Executor
    from .rollouts.rollouts import rollout as rollout
    from .simulation.course_loading import load_track as load_track
    from .simulation.settings import Start as Start
    from .simulation.showing import show as show
    from .simulation.simulation import Simulation as Simulation
    from .simulation.telemetry import TELEMETRY as TELEMETRY
    from .simulation.world import World as World
    from .vehicle.changes import CarChanges as CarChanges
    from .vehicle.friction_patches import Patch as Patch
    from .vehicle.tires import Tires as Tires
    from .vehicle.tires import tire_names as tire_names
    from .vehicle.vehicle import Vehicle as Vehicle
    from .vehicle.vehicle import vehicle_names as vehicle_names

    __version__: str

_PLACES = {
    "course.centreline_csv": "read_centreline write_centreline",
    "course.course": "Course",
    "course.formats": "track_names",
    "course.maps.export": "export_track",
    "course.maps.map_track": "read_map",
    "course.moving_obstacles": "MovingObstacle",
    "course.obstacles": "Box Cylinder Prism",
    "course.open_ground": "OpenGround",
    "course.scene": "Scene",
    "course.scenes": "scene_names",
    "course.track": "MapTrack Track",
    "errors": "BagError ControllerError EngineError FgMujocoError MissingExtraError "
    "ModelError PlannerError RunFolderError SettingsError TrackError",
    "lidar.effects": "LidarEffects",
    "messages": "STOP CarParameters Controller DriveCommand LaserScan Odometry",
    "lab.commands": "Commands",
    "lab.drive": "drive",
    "racing.entries": "Entry",
    "lab.handling": "handling",
    "racing.planners": "controller_names make_controller",
    "racing.race": "race",
    "racing.rules": "Contact",
    "racing.replay": "replay",
    "racing.resimulation": "scan_at",
    "racing.result": "CarResult RaceResult",
    "racing.setup": "Setup",
    "racing.run_folder": "Run read_run",
    "simulation.showing": "show",
    "simulation.course_loading": "load_track",
    "simulation.settings": "Start",
    "simulation.simulation": "Simulation",
    "simulation.telemetry": "TELEMETRY",
    "simulation.world": "World",
    "rollouts.rollout_result": "RolloutResult read_rollout",
    "rollouts.rollouts": "Executor rollout",
    "vehicle.changes": "CarChanges",
    "vehicle.friction_patches": "Patch",
    "vehicle.tires": "Tires tire_names",
    "vehicle.vehicle": "Vehicle vehicle_names",
    "pictures.plots": "trace_picture track_picture write_run",
    "pictures.rendering": "Film Renderer render write_video",
}
"""Module -> what of it is public."""

_HOMES = {name: f"fg_mujoco.{module}:{name}" for module, names in _PLACES.items() for name in names.split()}
_HOMES |= _added("NAMES")
__all__ = sorted(["__version__", *_HOMES])
_MODULES = frozenset(module.partition(".")[0] for module in (*_PLACES, "addons", "controllers", "models"))
_MODULES |= {"from_addons"}
_GYMNASIUM = "gymnasium.make('fg_mujoco/F1Tenth-v0')"
_ELSEWHERE = {
    "AckermannDrive": "DriveCommand", "Command": "DriveCommand",
    "StudyProgress": "fg_mujoco.addons.arena.study.store.StudyProgress",
    "Env": _GYMNASIUM, "F1TenthEnv": _GYMNASIUM,
    "Comparison": "Study", "Overtake": "fg_mujoco.racing.rules.Overtake",
    "Odom": "Odometry", "Planner": "Controller", "cars": "vehicle_names", "env": _GYMNASIUM, "gym": _GYMNASIUM,
    "load_map": "load_track", "make": _GYMNASIUM, "make_env": _GYMNASIUM, "make_vec": _GYMNASIUM,
    "maps": "track_names", "planners": "controller_names",
    "read_drive": "fg_mujoco.addons.realcar.drives.reading.read_drive", "run": "race", "sim": "Simulation",
    "simulate": "Simulation", "vehicles": "vehicle_names",
}  # fmt: skip
"""What others call it -> what it is called here."""


def __getattr__(name: str) -> _Any:
    """Import what is public when it is first used; refuse another name with the one that was probably meant."""
    if name in _HOMES:
        found = getattr(_import_module(_HOMES[name].partition(":")[0]), name)
        if isinstance(found, _FunctionType):
            found = _explained(found)
            found.__module__ = __name__  # by which it is pickled
    elif name == "__version__":
        from importlib.metadata import version

        found = version("fg-mujoco")
    elif name in _MODULES:
        return _import_module(f".{name}", __name__)
    else:
        meant = None if name.startswith("_") else _ELSEWHERE.get(name) or _nearest(name, __all__)
        rather = _gone(f"fg-mujoco {name}") or (None if meant is None else f"did you mean {meant!r}?")
        raise AttributeError(f"fg_mujoco has no {name!r}" + ("" if rather is None else f"; {rather}"))
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


_register_once_imported()
