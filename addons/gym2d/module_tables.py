"""The modules of f1tenth_gym, gym and gymnasium that are here, and where each of their names is.

A name's source is `chapter:name` of this room; `environment`, `registry.NAME` and `value.TEXT` are resolved by the
finder.
"""

from __future__ import annotations

import re
from typing import Any

RACING = ("f110_gym", "f1tenth_gym")
"""Packages of f1tenth_gym: the first of v0.2, both of v1.0."""
GYMS = ("gym", "gymnasium")

Table = dict[str, Any]

_SIMULATOR = {name: f"simulator:{name}" for name in ("Integrator", "DynamicModel", "Simulator", "RaceCar")}
_INTEGRATORS = {
    "Integrator": "simulator:Integrator", "IntegratorType": "simulator:Integrator",
    "RK4Integrator": "simulator:Integrator", "EulerIntegrator": "simulator:Integrator",
}  # fmt: skip
_MODELS = {name: f"gym_functions:{name}" for name in (
    "accl_constraints", "steering_constraint", "vehicle_dynamics_ks", "vehicle_dynamics_st", "pid", "pid_steer",
    "pid_accl",
)} | {"DynamicModel": "simulator:DynamicModel"} | {
    name: f"gym_config:{name}" for name in (
        "VehicleParameters", "F1TENTH_VEHICLE_PARAMETERS", "F1FIFTH_VEHICLE_PARAMETERS", "FULLSCALE_VEHICLE_PARAMETERS",
    )
}  # fmt: skip
_COLLISIONS = {name: f"gym_functions:{name}" for name in (
    "get_vertices", "get_trmtx", "collision", "collision_multiple",
)} | {"CollisionCheckMode": "gym_config:CollisionCheckMode"}  # fmt: skip
_LASERS = {"ScanSimulator2D": "simulator:ScanSimulator2D", "LiDARConfig": "gym_config:LiDARConfig"} | {
    name: f"gym_functions:{name}" for name in ("check_ttc_jit", "ray_cast", "get_dt", "xy_2_rc")
}  # fmt: skip
_TRACKS = {name: f"gym_track:{name}" for name in ("Track", "TrackSpec", "Raceline", "CubicSpline2D", "find_track_dir")}
_ACTIONS = {"CarAction": "new_api:CarAction"} | {
    name: f"gym_config:{name}" for name in ("LongitudinalActionType", "SteerActionType")
} | {
    "LongitudinalActionEnum": "gym_config:LongitudinalActionType", "SteerActionEnum": "gym_config:SteerActionType",
}  # fmt: skip
_RENDERING = {
    "EnvRenderer": "drawing:EnvRenderer", "RenderSpec": "drawing:Nothing", "make_renderer": "drawing:Nothing",
    "CAR_LENGTH": "drawing:CAR_LENGTH", "CAR_WIDTH": "drawing:CAR_WIDTH", "ZOOM_IN_FACTOR": 1.2,
    "ZOOM_OUT_FACTOR": 1.0 / 1.2, "make_lidar_scan_callback": "drawing:Nothing",
}  # fmt: skip
_OTHERS = dict.fromkeys(
    ("TerminationConfig", "RewardConfig", "DomainRandomizationConfig", "ContactConfig"), "gym_config:OtherConfig"
) | {"RewardMode": "drawing:Nothing", "ScanBackend": "drawing:Nothing"}
_CONFIG = {name: f"gym_config:{name}" for name in (
    "EnvConfig", "ControlConfig", "SimulationConfig", "ObservationConfig", "ResetConfig", "RenderConfig",
    "LoopCounterMode",
)} | _OTHERS | _LASERS | _ACTIONS | _MODELS  # fmt: skip
_OBSERVATIONS = {
    "Observation": "gym_observations:Observation", "observation_factory": "gym_observations:Observation",
    "ObservationType": "gym_config:ObservationType",
}  # fmt: skip
_ENVIRONMENT = {
    "F110Env": "environment", "VIDEO_W": 600, "VIDEO_H": 400, "WINDOW_W": 1000, "WINDOW_H": 800,
}  # fmt: skip

_RACING: dict[str, Table] = {
    "": {"__version__": "value.1.0.0"},
    "envs": _ENVIRONMENT | _SIMULATOR | _INTEGRATORS | {"Track": "gym_track:Track"},
    "envs.f110_env": _ENVIRONMENT | _SIMULATOR | _INTEGRATORS,
    "envs.base_classes": _SIMULATOR | _INTEGRATORS | _MODELS | _COLLISIONS | _LASERS,
    "envs.simulator": _SIMULATOR,
    "envs.dynamic_models": _MODELS,
    "envs.dynamic_models.kinematic": _MODELS,
    "envs.dynamic_models.single_track": _MODELS,
    "envs.dynamic_models.utils": _MODELS,
    "envs.collision_models": _COLLISIONS,
    "envs.laser_models": _LASERS,
    "envs.lidar": _LASERS | _OTHERS,
    "envs.lidar.config": _LASERS | _OTHERS,
    "envs.contact": _OTHERS,
    "envs.integrator": _INTEGRATORS,
    "envs.integrators": _INTEGRATORS,
    "envs.action": _ACTIONS,
    "envs.observation": _OBSERVATIONS,
    "envs.env_config": _CONFIG,
    "envs.reset": {"ResetStrategy": "gym_config:ResetStrategy"},
    "envs.rendering": _RENDERING,
    "envs.rendering.renderer": _RENDERING,
    "envs.rendering.rendering_pyglet": _RENDERING,
    "envs.rendering.rendering_pygame": _RENDERING,
    "envs.track": _TRACKS,
    "envs.track.track": _TRACKS,
    "envs.track.raceline": _TRACKS,
    "envs.track.cubic_spline": _TRACKS,
    "envs.track.utils": _TRACKS,
    "envs.cubic_spline": _TRACKS,
    "envs.utils": {"deep_update": "gym_functions:deep_update"},
}

_WRAPPERS = {name: f"gym_stub:{name}" for name in (
    "Env", "Wrapper", "ObservationWrapper", "ActionWrapper", "RewardWrapper",
)}  # fmt: skip
_SPACES = {name: f"gym_stub:{name}" for name in (
    "Space", "Box", "Discrete", "MultiDiscrete", "MultiBinary", "Dict", "Tuple",
)}  # fmt: skip
_REGISTERS = {
    "make": "registry.make", "register": "registry.register", "spec": "registry.find", "registry": "registry.itself",
    "EnvSpec": "gym_stub:EnvSpec",
}  # fmt: skip
_OF_ENVIRONMENTS = dict.fromkeys(
    ("RecordVideo", "Monitor", "OrderEnforcing", "PassiveEnvChecker"), "gym_stub:RecordNothing"
) | {name: f"gym_stub:{name}" for name in (
    "RecordEpisodeStatistics", "TimeLimit", "RescaleAction", "ClipAction", "FlattenObservation", "TransformObservation",
    "TransformReward",
)}  # fmt: skip
_LOGGER = dict.fromkeys(("set_level", "info", "warn", "error", "debug", "deprecation"), "drawing:Nothing")

_GYM: dict[str, Table] = {
    "": _WRAPPERS | _REGISTERS | {"Space": "gym_stub:Space"},
    "core": _WRAPPERS | {"Space": "gym_stub:Space"},
    "spaces": _SPACES | {"flatten": "gym_stub:flatten"},
    "spaces.box": _SPACES,
    "spaces.utils": {"flatten": "gym_stub:flatten"},
    "wrappers": _OF_ENVIRONMENTS,
    **{f"wrappers.{re.sub('(?<=[a-z])(?=[A-Z])', '_', name).lower()}": {name: source}
       for name, source in _OF_ENVIRONMENTS.items()},
    "envs": _REGISTERS,
    "envs.registration": _REGISTERS,
    "utils": {"EzPickle": "gym_stub:EzPickle"},
    "utils.seeding": {"np_random": "gym_stub:np_random"},
    "error": {"Error": RuntimeError, "DependencyNotInstalled": ImportError, "InvalidAction": ValueError},
    "logger": _LOGGER | {"INFO": 20, "WARN": 30, "ERROR": 40, "DEBUG": 10, "DISABLED": 50},
}

_VERSIONS = {"gym": "0.21.0", "gymnasium": "0.29.1"}


def module_tables() -> dict[str, Table]:
    """Return the names of every module that is here, by the module's name."""
    found: dict[str, Table] = {}
    for tops, parts in ((RACING, _RACING), (GYMS, _GYM)):
        for top in tops:
            for part, table in parts.items():
                found[f"{top}.{part}" if part else top] = dict(table)
    for gym, version in _VERSIONS.items():
        found[gym]["__version__"] = f"value.{version}"
    return found
