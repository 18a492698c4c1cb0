"""Settings of a real LiDAR's effects on a scan: noise, bias, dropouts, latency, motion distortion. Off by default.

`scan_pipeline` applies them, and is imported where a LiDAR has any.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import from_addons
from ..arguments import explain_class, setting
from ..errors import SettingsError, accepted_names
from ..messages import require
from .beams import NO_RETURN_READINGS

GREATEST_NOISE = 10.0
"""[m] Greatest standard deviation of a range that is accepted."""

LONGEST_LATENCY = 1.0
"""[s] Longest latency that is accepted, forty sweeps."""

_GREATEST_ANGLE = 1.5  # [rad] nearly a right one


@explain_class
@dataclass(frozen=True, kw_only=True)
class LidarEffects:
    """Settings of a LiDAR's imperfections.

    A dropout reads NaN: so REP 117 marks a failed reading, and so the ROS driver urg_node reports the zero that the
    UST-10LX sends for one. The errors of a measured LiDAR are independent of those of the two numbers, and both are
    drawn where both are set.

    Raises:
      SettingsError: a value out of its range.
    """

    range_noise_std: float = setting(0.0, "standard deviation of each range [m], Gaussian", "M", "sensors")
    dropout_probability: float = setting(0.0, "probability that a beam fails", "P", "sensors")
    latency: float = setting(0.0, "from measurement to delivery [s], rounded up to whole sweeps", "S", "sensors")
    motion_distortion: bool = setting(False, "each beam from the pose at its own time in the sweep", "", "sensors")
    floor_angle: float = setting(  # [rad]
        0.0, "a beam that meets the floor at less than this angle does not come back [rad], as on a glossy one; "
        "default: 0", "RAD", "sensors",
    )  # fmt: skip
    through_cars: float = setting(
        0.0, "share of the beams that pass through the bodies of other cars, but not through the boxes that the rules "
        "ask for; default: 0", "P", "sensors",
    )  # fmt: skip
    no_return: str = "inf"  # what a beam without a return reads: "inf" or "range_max"
    measured: Mapping[str, Any] | str | Path | None = setting(
        None, "noise, bias and dropouts by range and bearing as measured: {names}, or a TOML file of "
        "your own", "NAME|FILE.toml", "sensors",
    )  # fmt: skip

    def __post_init__(self) -> None:
        if self.measured is not None:
            object.__setattr__(self, "measured", from_addons.MeasuredErrors.load(self.measured))
        noise = f"0 to {GREATEST_NOISE:g} m, which is the range that the UST-10LX is made for"
        require(self, lambda value: 0.0 <= value <= GREATEST_NOISE, noise, ("range_noise_std",), SettingsError)
        latency = f"0 to {LONGEST_LATENCY:g} s; an F1TENTH car drives 8 m in that time"
        require(self, lambda value: 0.0 <= value <= LONGEST_LATENCY, latency, ("latency",), SettingsError)
        require(self, lambda value: 0.0 <= value <= 1.0, "0 to 1", ("dropout_probability",), SettingsError)
        angle = f"0 to {_GREATEST_ANGLE} rad"
        require(self, lambda value: 0.0 <= value <= _GREATEST_ANGLE, angle, ("floor_angle",), SettingsError)
        require(self, lambda value: 0.0 <= value <= 1.0, "0 to 1", ("through_cars",), SettingsError)
        if not isinstance(self.motion_distortion, bool):
            said = f"LidarEffects.motion_distortion is {self.motion_distortion!r}"
            raise SettingsError(f"{said}; accepted: true or false")
        if self.no_return not in NO_RETURN_READINGS:
            readings = accepted_names(self.no_return, NO_RETURN_READINGS)
            raise SettingsError(f"LidarEffects.no_return is {self.no_return!r}; {readings}")

    @property
    def errors(self) -> Any:
        """The MeasuredErrors of the add-on realcar, loaded; None: there are none."""
        return self.measured

    @property
    def optics(self) -> tuple[float, float]:
        """What the beams meet otherwise: `through_cars`, and the sine of `floor_angle`."""
        return self.through_cars, math.sin(self.floor_angle)

    def sweeps_late(self, period: float) -> int:
        """Return the number of sweeps of a period [s] by which a scan is late."""
        # A latency of 2 sweeps is 2, also where the division says 2.0000000000000004.
        return math.ceil(self.latency / period - 1e-9)
