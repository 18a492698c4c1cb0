"""Rolls one wheel at a set load, slip angle and slip ratio, and compares its force with the formula of the set's file.

    python benchmarks/tire_bench.py [--tires forzaeth_nuc2,slipx_reference]

The wheel of the car f1tenth is under a mass of the load, which is held to a straight line, and free up and down. Its
heading is turned off the line by the slip angle, and its spin is set, both before each physics step of 5 ms, and
neither moves within one. The force is the mean over the tire's short steps, as the engine's kernel writes it. Slips
are pure and combined, to .5, over loads of 2 to 20 N. A row of the table has, of an axle of a set, the greatest error
and the spread of settled forces, in percent of the peak, and the greatest error of the relaxation length, over which
the force follows a step of the slip angle at 1 to 8 m/s.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from common import table

from fg_mujoco.messages import FloatArray
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tire_rows import FORCE_ACROSS, FORCE_ALONG, LOAD, put_on
from fg_mujoco.vehicle.tires import CONTACT, AxleTires, Law, Tires, tire_names
from fg_mujoco.vehicle.vehicle import Vehicle

AXLES = ("front", "rear")
LOADS = (2.0, 5.0, 9.17, 14.0, 20.0)  # [N]
SLIPS = (0.005, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.1, 0.13, 0.17, 0.22, 0.3, 0.4, 0.5)
BOTH = (0.02, 0.05, 0.1, 0.2, 0.4)  # sizes of combined slips
WAYS = (-60.0, -30.0, 30.0, 45.0, 75.0)  # [deg] of a combined slip, 0 is along
SPEED = 3.0  # [m/s]
SPEEDS = (1.0, 2.0, 4.0, 8.0)  # [m/s] of the step
STEP = 0.002  # [rad] of slip angle, so small that the curve is straight
HELD = [0, 1, 3, 4, 5, 6]  # dofs that are set: all but the one up and down
HEAVY = 1e9  # [kg, kg m^2] of these, so that no force of the tire moves them within a physics step
ROLLED, MOST_ROLLS, SETTLED = 40.0, 20, 1e-5  # relaxation lengths, how often, and spread, until a point is read
SETTLING = 1.0  # [s] of the load


class Bench:
    """One wheel with a tire of an axle under a load.

    Args:
      tires: of the set.
      axle: "front" or "rear".
      load: [N].
      speed: [m/s].
    """

    def __init__(self, tires: Tires, axle: str, load: float, speed: float) -> None:
        self.wheel = f"{axle}_left"
        spec = _one_wheel(self.wheel, load)
        put_on(spec, tires)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._forces = TireForces(self.model, wheels=(self.wheel,))
        self.model.dof_armature[HELD] = HEAVY  # only now: the tire's damping is that of the wheel's own inertia
        self._speed = speed
        self._forces.begin(self.data)
        self.roll(SETTLING, 0.0, 0.0)

    def roll(self, seconds: float, ratio: float, angle: float) -> FloatArray:
        """Roll at a slip ratio and a slip angle [rad], and return load, forces along and across [N] of each step."""
        data, rows = self.data, []
        for _ in range(max(round(seconds / self.model.opt.timestep), 1)):
            data.qpos[3:7] = math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)
            data.qvel[:2], data.qvel[3:6] = (self._speed, 0.0), 0.0
            arm = 0.5 * (self._forces.rows[0]["radius"] + data.qpos[2])
            data.qvel[6] = self._speed * math.cos(angle) * (1.0 + ratio) / arm
            self._forces.step(data)
            rows.append((data.userdata[LOAD], data.userdata[FORCE_ALONG], data.userdata[FORCE_ACROSS]))
        return np.array(rows)


def _one_wheel(wheel: str, load: float) -> Any:
    """Return the spec of a wheel of the car f1tenth, its tire and its spin, under a mass of the load [N]."""
    car = Vehicle.load().spec()
    tire, pair = car.geom(f"{wheel}_tire"), car.pair(f"{wheel}_tire")
    spec = mujoco.MjSpec()
    spec.option = car.option
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 0.1))
    own = car.body(f"{wheel}_wheel")
    base = spec.worldbody.add_body(
        name="base_link", pos=(0.0, 0.0, float(tire.size[0]) - 5e-4), mass=load / 9.81 - own.mass
    )
    base.inertia, base.explicitinertial = (1e-3, 1e-3, 1e-3), True
    base.add_freejoint(name="base_link")
    body = base.add_body(name=f"{wheel}_wheel", mass=own.mass, inertia=own.inertia, explicitinertial=True)
    body.add_joint(name=f"{wheel}_wheel", type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0.0, 1.0, 0.0))
    body.add_geom(name=f"{wheel}_tire", type=tire.type, size=tire.size, contype=0, conaffinity=0, mass=0.0)
    settings = {
        "solref": pair.solref, "solimp": pair.solimp, "solreffriction": pair.solreffriction, "friction": pair.friction
    }  # fmt: skip
    spec.add_pair(name=f"{wheel}_tire", geomname1=f"{wheel}_tire", geomname2="ground", condim=3, **settings)
    contact = next(sensor for sensor in car.sensors if sensor.name == f"{wheel}_tire_contact")
    spec.add_sensor(
        name=contact.name, type=contact.type, objtype=contact.objtype, objname=contact.objname, intprm=contact.intprm
    )  # fmt: skip
    return spec


def formula(axle: AxleTires, load: float, ratio: float, angle: float) -> tuple[float, float]:
    """Return the forces along and across [N] that the file of a set says, for a slip ratio and a slip angle [rad]."""
    scale = [_scale(curve) for curve in (axle.longitudinal, axle.lateral)]
    size = math.hypot(ratio / scale[0], angle / scale[1])
    grip = load * axle.load_factor(load) / size
    along = grip * axle.longitudinal.force(size * scale[0]) * ratio / scale[0]
    return along, grip * axle.lateral.force(size * scale[1]) * angle / scale[1]


def _scale(curve: Law) -> float:
    return curve.peak_slip if math.isfinite(curve.peak_slip) else 1.0


def errors(tires: Tires, name: str, loads: Sequence[float] = LOADS) -> tuple[float, float]:
    """Return the greatest error of the force of an axle and the greatest spread once settled, over the peak [-]."""
    axle = tires.axles[AXLES.index(name)]
    slips = [(0.0, slip) for slip in SLIPS] + [(sign * slip, 0.0) for slip in SLIPS for sign in (1.0, -1.0)]
    ways = [math.radians(way) for way in WAYS]
    slips += [(size * math.cos(way), size * math.sin(way)) for size in BOTH for way in ways]
    error = spread = 0.0
    for load in loads:
        bench = Bench(tires, name, load, SPEED)
        greatest = load * axle.load_factor(load) * axle.lateral.peak
        for ratio, angle in slips:
            for _ in range(MOST_ROLLS):
                forces = bench.roll(ROLLED * axle.relaxation_length / SPEED, ratio, angle)
                left = float(np.ptp(forces[-10:], axis=0).max()) / greatest
                if left < SETTLED:
                    break
            used, along, across = forces[-1]
            right = formula(axle, used, ratio, angle)
            error = max(error, math.hypot(along - right[0], across - right[1]) / greatest)
            spread = max(spread, left)
    return error, spread


def lag(tires: Tires, name: str, speed: float) -> float:
    """Return over which way the side force follows a small step of the slip angle [m]: its logarithm's slope."""
    axle = tires.axles[AXLES.index(name)]
    bench = Bench(tires, name, 9.17, speed)
    timestep = bench.model.opt.timestep
    side = bench.roll(20.0 * axle.relaxation_length / speed, 0.0, STEP)[:, 2]
    left = 1.0 - side / side[-1]
    rolled = timestep * speed * np.arange(1, len(side) + 1)
    clear = (left > 1e-3) & (np.arange(len(left)) < len(left) - 1)
    return -1.0 / float(np.polyfit(rolled[clear], np.log(left[clear]), 1)[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tires", help="sets, by commas; default: all but contact")
    options = parser.parse_args()
    named = options.tires.split(",") if options.tires else [name for name in tire_names() if name != CONTACT]
    rows = []
    for tires in map(Tires.load, named):
        for name, axle in zip(AXLES, tires.axles, strict=True):
            error, spread = errors(tires, name)
            late = max(abs(lag(tires, name, speed) / axle.relaxation_length - 1.0) for speed in SPEEDS)
            rows.append([tires.name, name, *(f"{100.0 * share:.4f}" for share in (error, spread, late))])
    print(table(["set", "axle", "error [%]", "spread [%]", "lag [%]"], rows))


if __name__ == "__main__":
    main()
