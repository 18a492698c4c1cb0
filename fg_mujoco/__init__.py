"""A MuJoCo 3D testbed for F1TENTH cars.

    import fg_mujoco as fg

    result = fg.race(fg.load_track("oval"), controller="gap_finder", laps=5)
    print(result.lap_times_s, result.max_slide_m_s)

What loads slowly (trimesh, embreex, matplotlib) is imported where it is used.
"""

from importlib.metadata import version as _version

from . import mujoco_import as _mujoco_import  # noqa: F401  # first: it chooses how pictures are drawn
from .car import Car, car_parameters, car_spec
from .car_changes import CarChanges
from .comparison import Comparison, ComparisonProgress, compare
from .controller_loading import controller_names, make_controller
from .errors import (
    BagError,
    ControllerError,
    EngineError,
    FgMujocoError,
    MessageError,
    MissingExtraError,
    ModelError,
    RunFolderError,
    SettingsError,
    TrackError,
)
from .lap_timer import LapTimer
from .lidar import Beams, Lidar, RangefinderLidar, RaycastLidar, lidar_spec, make_lidar
from .lidar_effects import LidarEffects
from .map_export import export_track
from .map_track import MapTrack, read_map
from .messages import STOP, CarParameters, Controller, DriveCommand, LaserScan, Odometry
from .moving_obstacles import MovingObstacle
from .obstacles import Box, Cylinder
from .plots import trace_picture, track_picture
from .race import RaceProgress, race
from .race_result import TELEMETRY, RaceResult
from .randomization import Choice, Randomization, Uniform
from .recording import ReplayReport, Run, check_run_folder, read_run, replay, write_run
from .rendering import Film, Renderer, render, write_video
from .rollout_result import RolloutResult, read_rollout
from .rollouts import RolloutProgress, rollout
from .scenario import Scenario, Start
from .scene import Scene
from .scenes import scene_names
from .simulation import Simulation
from .tire_slip import SLIDING_SPEED, TireSlip, TireSlipMeter
from .track import Track
from .track_formats import load_track, read_centreline, track_names, write_centreline
from .track_generator import GeneratorSettings, generate_track
from .world import World

__version__ = _version("fg-mujoco")

__all__ = [
    "SLIDING_SPEED",
    "STOP",
    "TELEMETRY",
    "BagError",
    "Beams",
    "Box",
    "Car",
    "CarChanges",
    "CarParameters",
    "Choice",
    "Comparison",
    "ComparisonProgress",
    "Controller",
    "ControllerError",
    "Cylinder",
    "DriveCommand",
    "EngineError",
    "FgMujocoError",
    "Film",
    "GeneratorSettings",
    "LapTimer",
    "LaserScan",
    "Lidar",
    "LidarEffects",
    "MapTrack",
    "MessageError",
    "MissingExtraError",
    "ModelError",
    "MovingObstacle",
    "Odometry",
    "RaceProgress",
    "RaceResult",
    "Randomization",
    "RangefinderLidar",
    "RaycastLidar",
    "Renderer",
    "ReplayReport",
    "RolloutProgress",
    "RolloutResult",
    "Run",
    "RunFolderError",
    "Scenario",
    "Scene",
    "SettingsError",
    "Simulation",
    "Start",
    "TireSlip",
    "TireSlipMeter",
    "Track",
    "TrackError",
    "Uniform",
    "World",
    "__version__",
    "car_parameters",
    "car_spec",
    "check_run_folder",
    "compare",
    "controller_names",
    "export_track",
    "generate_track",
    "lidar_spec",
    "load_track",
    "make_controller",
    "make_lidar",
    "race",
    "read_centreline",
    "read_map",
    "read_rollout",
    "read_run",
    "render",
    "replay",
    "rollout",
    "scene_names",
    "trace_picture",
    "track_names",
    "track_picture",
    "write_centreline",
    "write_run",
    "write_video",
]
