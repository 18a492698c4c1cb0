"""The summary of a race as JSON: the figures of its result, its setup, and the versions that made it."""

from __future__ import annotations

import json
import math
import platform
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

import mujoco

from ..errors import SettingsError
from .result import RaceResult

SCHEMA = 1
"""Of the run folder; a reader refuses any other."""

FAILED_SCAN = "failed_scan.npz"
"""File of a run folder: the scan and the odometry at which a planner failed."""


def summary_json(result: RaceResult) -> str:
    """Return the summary, the setup and the versions that made it as one JSON object; NaN and infinity are null.

    The setup stands in `settings`; it is not there where a course or a planner is an object, which no file can hold.
    """
    found = result.summary()
    if found.get("planner_failure") is not None:
        found["planner_failure"]["scan"] = FAILED_SCAN
    with suppress(SettingsError):
        found["settings"] = result.setup.described()
    return as_json(found | {"schema": SCHEMA} | versions())


def versions() -> dict[str, str]:
    """Return what the bits of a run depend on besides its inputs, by the names in a summary."""
    return {
        "fg_mujoco_version": version("fg-mujoco"),
        "mujoco_version": mujoco.__version__,
        "platform": f"{platform.system()}-{platform.machine()}",
    }


def as_json(values: Mapping[str, Any]) -> str:
    """Return values by name as the text of a summary has them; NaN and infinity are null."""
    return json.dumps(_finite(values), indent=2, allow_nan=False, default=asdict)


def _finite(value: Any) -> Any:
    """Return a value with None in the place of NaN and infinity, in mappings and lists, too."""
    if isinstance(value, Mapping):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
