"""Model-predictive control along a line: the plan of least cost for the next second, of which a tick is driven.

The plan is a linear time-varying program (ltv_program) of 20 steps of 0.05 s. Its state, in the frame of the line:
distance of the rear axle from the line [m], angle of the heading to the line [rad], lateral speed of the centre of
gravity [m/s] and yaw rate [rad/s] where tires need slip angles, steering angle less that of the line's curvature [rad].
The speed along the horizon is that of the line's profile, reached with what the tires give. The input is the steering
rate, bounded by what the friction limiter allows at the speed and the steering angle of each step, and by the way that
the servo comes in a tick: the car begins to turn in before a bend at which it would be late. The steering angle is
bounded by lock and grip. The distance costs more where walls that are known leave no room beside the line, and there
the car slows. The cost is that of the regulator in line_trackers, e^2 / L^4 + k^2 over the way, k the curvature beyond
the line's, and a share for the change of k.
Where tires need no slip angles, the car is kinematic. Else it is the single-track car, whose axles have the secant
stiffness of their curves at the force of the line's curvature (slip). The steering angle is that of the arc, and the
wheels are turned by the lead more. The command is the angle for which the servo reaches the plan's angle at the next
tick; the plan begins where the car will be when late commands act. Where the program does not converge, the car steers
by the last plan; where that is over, it brakes, and steers by its last angle.
Source: P. Falcone et al., Predictive Active Steering Control for Autonomous Vehicle Systems, IEEE TCST 15(3), 2007, for
the linear time-varying plan; the model is R. Rajamani, Vehicle Dynamics and Control, 2012, chapter 2.

The work is done in native/addons/drivers/line_mpc.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.controllers.control.stages import NativeStep, Stage
from fg_mujoco.native import core, record

STEPS: int = core.MPC_STEPS
"""Steps of the horizon."""
DT: float = core.MPC_TIME
"""[s] of each."""
SOLVED = 0
"""What the steering angle is by: this plan; 1 is the last one; and 2 none, and the car has to brake."""

MPC = record(
    "Mpc",
    [
        ("planned", np.bool_),
        ("age", np.float64),  # [s] since the plan was made
        ("command", np.float64),  # [rad] steering angle that was last commanded
        ("iterations", np.int64),  # of the last tick
        ("angles", np.float64, (STEPS + 1,)),  # [rad] of the plan
    ],
)
"""Type of what is kept of the last plan; zero at the beginning."""

plan_steering = core.plan_steering
"""Return the steering angle [rad] for the next tick, the greatest speed [m/s], and what they are by, see SOLVED.

The speed is inf where the plan stays in the room beside the line. Else the car slows: its wheels then turn in less
distance, and its tires hold a sharper curve. It slows by at most 0.2 m/s at a time, as the friction limiter takes grip
from the cornering of a car that is far too fast. Without a plan the speed is 0.

Args:
  line: of line_profile, (n, 6).
  nearest: its point that is nearest to the rear axle.
  odometry: of type messages.ODOMETRY.
  driver: of type DRIVER.
  period: until the next tick [s].
  mpc: of type MPC, written to.
"""

place_at_command = core.place_at_command
"""Return where the car is once a command reaches its servos: x and y [m], heading and steering angle [rad]."""

kinematic = core.kinematic
"""Write the program's system for the kinematic car: distance, angle, steering angle; its steering rate is held.

Args:
  ahead: (STEPS + 1, 6) in each step the speed [m/s], by how much the line turns until the next [rad], its curvature
    [1/m] and the steering angle for it [rad], and how far the car may be to the right (negative) and to the left [m].
  car: of type CAR_RECORD.
  a: this and the following as of `solve_program`, zero, and written to.
  b: for the input.
  c: known disturbance.
"""

single_track = core.single_track
"""Write the program's system for the single-track car, see above; arguments as of `kinematic`, for the car its driver.
"""

TRACK = Stage(after_reference=NativeStep("track_by_mpc"), state_type=MPC)
"""The tracker as a stage of driving, by which pure pursuit steers along its line."""
