"""Planners that drive by a pose that was found on the map, in place of the true one.

    kind = localised(PurePursuit)
    planner = kind(car, mu, map_line=map_line)
    planner.localiser = Localiser.of(settings, map_line, car, seed)

The class that is made is the planner's own in all else: its settings, its file, and what it shows.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

from fg_mujoco.errors import SettingsError
from fg_mujoco.messages import DriveCommand, FloatArray, LaserScan, Odometry


@lru_cache(maxsize=64)
def localised(kind: type) -> type:
    """Return the class of a planner that drives by the pose of its attribute `localiser`.

    Raises:
      SettingsError: a class that nothing can be derived from.
    """

    def call(self: Any, scan: LaserScan, odometry: Odometry) -> DriveCommand:
        pose = self.localiser.locate(scan, odometry)
        command: DriveCommand = kind.__call__(self, scan, replace(odometry, pose=pose))
        return command

    def reset(self: Any) -> None:
        if self.localiser is not None:
            self.localiser.reset()
        kind.reset(self)  # type: ignore[attr-defined]

    def estimate(self: Any) -> FloatArray:
        """Return the pose that the planner drove by last (3,)."""
        found: FloatArray = self.localiser.pose
        return found

    same = {name: getattr(kind, name) for name in ("__module__", "__qualname__", "__doc__")}
    body = {**same, "__call__": call, "reset": reset, "estimate": estimate, "localiser": None, "batch": None}
    try:
        return type(kind.__name__, (kind,), body)
    except TypeError as error:
        raise SettingsError(f"planner {kind.__name__} takes no pose but the true one: {error}") from error

