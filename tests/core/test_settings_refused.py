"""What all settings of planners refuse: each of their fields, by its name, its value and what it accepts."""

import dataclasses
import importlib
import math
import pkgutil

import pytest

import fg_mujoco.addons.drivers
import fg_mujoco.controllers
from fg_mujoco.controllers.control.driving import DrivingSettings
from fg_mujoco.controllers.gap_finder import GapFinderSettings
from fg_mujoco.controllers.weighted_gap import WeightedGapSettings
from fg_mujoco.errors import SettingsError

PACKAGES = (fg_mujoco.controllers, fg_mujoco.addons.drivers)
PATHS = {("PurePursuitSettings", "line"), ("PoseSettings", "pose_map")}  # what these name is judged when it is read


def settings_classes():
    """Every dataclass in the planners' packages whose name ends with Settings, and that has fields."""
    for package in PACKAGES:
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            for value in vars(importlib.import_module(module.name)).values():
                own = dataclasses.is_dataclass(value) and value.__module__ == module.name
                if own and value.__name__.endswith("Settings") and dataclasses.fields(value):
                    yield value


@pytest.mark.parametrize("made", list(settings_classes()), ids=lambda made: made.__name__)
def test_a_value_that_no_field_can_have_is_refused_by_name(made):
    for field in dataclasses.fields(made):
        if (made.__name__, field.name) not in PATHS:
            for value in (math.nan, -1.0, "no such word", []):
                with pytest.raises(SettingsError) as refusal:
                    made(**{field.name: value})
                assert f"{made.__name__}.{field.name} is {value!r}; accepted: " in str(refusal.value)


@pytest.mark.parametrize(
    ("made", "values", "said"),
    [
        (WeightedGapSettings, {"field_of_view": 3.2}, "field_of_view is 3.2; accepted: a number above 0, at most pi"),
        (GapFinderSettings, {"edge_weight": 1.1}, "edge_weight is 1.1; accepted: "),
        (GapFinderSettings, {"lookahead": math.inf}, "lookahead is inf; accepted: "),
        (DrivingSettings, {"speed_law": "fast"}, "accepted: minimum, forward_distance, range_ratio, "),
        (DrivingSettings, {"safe_distance": 1.0, "full_speed_distance": 0.5}, "accepted: a number above safe_"),
    ],
)
def test_a_bound_is_named(made, values, said):
    with pytest.raises(SettingsError) as refusal:
        made(**values)
    assert said in str(refusal.value)
