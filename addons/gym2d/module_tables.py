"""The modules of f1tenth_gym that are here, and where each of their names is.

A name's source is `chapter:name` of this room; `environment` and `value.TEXT` are resolved by the finder.
"""

from __future__ import annotations

from typing import Any

RACING = ("f110_gym", "f1tenth_gym")
"""Packages of f1tenth_gym: the first of v0.2, both of v1.0."""

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
        "get_f1tenth_vehicle_parameters", "get_f1fifth_vehicle_parameters", "get_fullscale_vehicle_parameters",
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
_OTHERS = {"ContactConfig": "gym_config:ContactConfig", "ScanBackend": "drawing:Nothing"}
_CONFIG = {name: f"gym_config:{name}" for name in (
    "EnvConfig", "ControlConfig", "SimulationConfig", "ObservationConfig", "ResetConfig", "RenderConfig",
    "LoopCounterMode", "TerminationConfig", "AgentTerminationMode", "RewardConfig", "RewardMode",
    "DomainRandomizationConfig",
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
    "envs.reset": {name: f"gym_config:{name}" for name in ("ResetStrategy", "ReferenceLine")},
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
    "envs.termination": _CONFIG,
    "envs.wrappers": {
        name: f"gym_wrappers:{name}" for name in ("SingleAgentWrapper", "ObservationDelayWrapper")
    },
    "envs.utils": {"deep_update": "gym_functions:deep_update"},
}

def module_tables() -> dict[str, Table]:
    """Return the names of every module that is here, by the module's name."""
    return {f"{top}.{part}" if part else top: table for top in RACING for part, table in _RACING.items()}
