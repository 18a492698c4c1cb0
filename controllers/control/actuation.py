"""The last step to a command: one that the tires can follow, and whose speed the car reaches.

1. The friction limiter turns the reference into a command that the tires can follow (friction_limiter).
2. The wheels are turned by the slip angles that soft tires need more, and roll faster or slower than the ground (slip).
3. The speed is corrected for the error of the odometry. The friction limiter asks for an acceleration a by commanding
   the speed v + (a + drag) tau, tau the time constant of the speed servo. Odometry that reads 5 % too much, as with
   worn tires, adds 0.05 v / tau that nobody asked for: 4 m/s^2 at 8 m/s. The error is measured while driving: in each
   tick the measured speed moves by the share 1 - exp(-period / tau) of the way to the command less drag tau. Errors
   within 1 % are left alone: a car whose odometry is right measures as much. On the remembered line, which needs most
   of the braking, the whole error is corrected.

The work is done in native/controllers/control/actuation.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.native import core, record

LEFT_ALONE = 0.01
"""Error of the measured speed, as a share, that is left alone."""

SPEEDOMETER = record(
    "Speedometer",
    [
        ("command", np.float64),  # [m/s] that was last given; 0: none
        ("speed", np.float64),  # [m/s] that was measured then
        ("error", np.float64),  # of the measured speed, as a share of the motor's
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""

read_speedometer = core.read_speedometer
command_speed = core.command_speed
