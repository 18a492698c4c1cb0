"""What settings refuse: each field of each class, by its name, its value and what it accepts; and their bounds."""

import dataclasses
import importlib
import math
import pkgutil

import pytest

import fg_mujoco as fg
import fg_mujoco.addons.drivers
import fg_mujoco.controllers
from cases import each
from fg_mujoco.addons.arena.random_courses.generator import GeneratorSettings
from fg_mujoco.addons.arena.tight_courses.drivable import Footprint
from fg_mujoco.addons.arena.tight_courses.tight import TightSettings
from fg_mujoco.controllers.control.driving import DrivingSettings
from fg_mujoco.controllers.gap_finder import GapFinderSettings
from fg_mujoco.controllers.safety.guidance import GuidanceSettings
from fg_mujoco.controllers.safety.recovery import RecoverySettings
from fg_mujoco.controllers.weighted_gap import WeightedGapSettings
from fg_mujoco.errors import SettingsError
from fg_mujoco.lab.manoeuvres import MANOEUVRES
from fg_mujoco.vehicle.sensors import SENSORS

MADE = {
    **{made: {} for made in (Footprint, GeneratorSettings, TightSettings, fg.LidarEffects, fg.Start)},
    **{made: {} for made in (fg.CarChanges, *MANOEUVRES.values())},
    fg.Box: {"x": 0.0, "y": 0.0, "length": 1.0, "width": 1.0},
    fg.Cylinder: {"x": 0.0, "y": 0.0, "radius": 0.2},
    fg.MovingObstacle: {"length": 0.4, "width": 0.3, "start": (6.0, 0.0), "end": (1.0, 0.0), "speed": 1.3},
    fg.Patch: {"x": 0.0, "y": 0.0, "length": 1.0, "width": 1.0, "mu": 0.5},
    **{made: {} for made in (SENSORS.find(name) for name in ("odometry", "imu", "wheel_speeds", "pose"))},
}
"""Classes, and what makes one of each."""
NAMES = {"line", "pose_map", "name"}  # what these name is judged when it is read, and any text may be it


def settings_of_planners():
    """Every dataclass in the planners' packages whose name ends with Settings, and that has fields."""
    for package in (fg_mujoco.controllers, fg_mujoco.addons.drivers):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            for value in vars(importlib.import_module(module.name)).values():
                own = dataclasses.is_dataclass(value) and value.__module__ == module.name
                if own and value.__name__.endswith("Settings") and dataclasses.fields(value):
                    yield value


OF_PLANNERS = list(settings_of_planners())


def refused(made, **values):
    """Return what is said of values that a class refuses."""
    with pytest.raises(SettingsError) as refusal:
        made(**MADE.get(made, {}) | values)
    assert "\n" not in str(refusal.value)
    return str(refusal.value)


@each("made", [*OF_PLANNERS, *MADE], ids=lambda made: made.__name__)
def test_a_value_that_no_field_can_have_is_refused_by_name(made):
    assert len(OF_PLANNERS) > 15
    for field in dataclasses.fields(made):
        for value in (math.nan, "no such word", *([-1.0] if made in OF_PLANNERS else [])):
            if field.name not in NAMES:
                said = refused(made, **{field.name: value})
                assert f"{made.__name__}.{field.name} is {value!r}" in said and "; accepted: " in said


@each(
    ("made", "values", "said"),
    [
        (WeightedGapSettings, {"field_of_view": 3.2}, "field_of_view is 3.2; accepted: a number above 0, at most pi"),
        (GapFinderSettings, {"edge_weight": 1.1}, "edge_weight is 1.1; accepted: "),
        (GapFinderSettings, {"lookahead": math.inf}, "lookahead is inf; accepted: "),
        (GuidanceSettings, {"every": 0.0}, "every is 0.0; accepted: "),
        (RecoverySettings, {"distance": 0.0}, "distance is 0.0; accepted: a positive number"),
        (DrivingSettings, {"safe_distance": 1.0, "full_speed_distance": 0.5}, "accepted: a number above safe_"),
        (fg.Box, {"width": 0.0}, "Box.width is 0.0; accepted: a positive length in metres"),
        (fg.Cylinder, {"x": 2e6}, "Cylinder.x is 2000000.0; accepted: a finite number up to 1e+06"),
        (fg.MovingObstacle, {"end": (6.0, 0.0)}, "accepted: "),
        (fg.LidarEffects, {"dropout_probability": 1.1}, "dropout_probability is 1.1; accepted: 0 to 1"),
        (fg.LidarEffects, {"latency": math.inf}, "latency is inf; accepted: 0 to 1 s"),
        (fg.CarChanges, {"command_delay": 0.5}, "command_delay is 0.5; accepted: 0 to 0.15 s"),
        (fg.Patch, {"mu": 0.0}, "Patch.mu is 0.0; accepted: "),
        (GeneratorSettings, {"min_length": 300.0}, "min_length is 300.0 m; accepted: at most max_length, 200.0 m"),
        (TightSettings, {"max_gap": 0.5}, "accepted: at most max_gap"),
        (MANOEUVRES["circle"], {"radius": 0}, "Circle.radius is 0; accepted: a radius in metres other than 0"),
        (MANOEUVRES["slalom"], {"gates": 2.5}, "Slalom.gates is 2.5; accepted: a whole number from 3 to 1000"),
        (MANOEUVRES["sine_sweep"], {"high": 30}, "accepted: a frequency above low, 0.2 Hz, up to 10 Hz"),
        (SENSORS.find("imu"), {"rate": 0}, "Imu.rate is 0; accepted: a number above 0 [Hz]"),
        (SENSORS.find("imu"), {"delay": -1}, "Imu.delay is -1; accepted: 0 to 10 s"),
        (SENSORS.find("pose"), {"noise_std": [1, 2]}, "accepted: a number from 0, or one for each of x_m, y_m"),
    ],
)  # fmt: skip
def test_a_bound_is_named(made, values, said):
    assert said in refused(made, **values)
