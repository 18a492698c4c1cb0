"""Sensors: what is measured on a car besides the scan and the odometry of each tick, how often, how late and how well.

`sensor` has Sensor, the base of all of them, and their registry SENSORS; `bundled`, `livox` and `vesc` fill it. A
sensor of your own is a subclass and a line in SENSORS, see docs/howto/own_sensor.md. `simulation.sensing` measures.
"""

from . import bundled, livox, vesc
from .sensor import SENSORS, CarState, Sensor, as_sensors

__all__ = ["SENSORS", "CarState", "Sensor", "as_sensors", "bundled", "livox", "vesc"]
