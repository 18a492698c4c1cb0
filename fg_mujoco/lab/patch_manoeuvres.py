"""Which friction acts on a patch: a car that slides sideways, and one on a circle, by each way to lay a patch.

The first four ways are those that MuJoCo offers for its own contacts, and why each is wrong. The last one is used
(friction_patches), on any tires; here on the vehicle's:

    maximum   a flush geom with its own friction: of two geoms the greater counts, and the tire's is the ground's
    priority  a flush geom with `priority`: its friction counts in its contacts, and the ground's contacts stay
    pair      a flush geom with a `pair` of its own for each tire: likewise. The two contacts share the load of a tire
              that holds; once it slides, that of the greater friction has all of it
    raised    the same, 0.9 mm higher, more than the tires give: the friction is right, and its edge is a step
    site      no geom: each tire gets the friction of what is under it
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import mujoco
import numpy as np

from ..messages import DriveCommand, FloatArray
from ..vehicle.car import WHEELS, Car
from ..vehicle.friction_patches import Patch, PatchedFloor, add_patches
from ..vehicle.tire_forces import TireForces
from ..vehicle.tire_rows import LOAD, USERDATA
from ..vehicle.tire_slip import TireSlip, TireSlipMeter
from ..vehicle.tires import IDEAL_TIRES, Tires
from ..vehicle.vehicle import Vehicle
from .lab_ground import set_timestep

WAYS = ("maximum", "priority", "pair", "raised", "site")

_RISE = 0.9e-3  # [m] of a raised patch; the tires give .785 mm at rest
_THICKNESS = 0.05  # [m]
_BIT = 16  # of contype and conaffinity: nobody's in models/f1tenth.xml
_WIDE = 0.005  # a circle that is wider than the kinematic one by this share is no longer held


class Slab:
    """A car by a patch, on endless ground of the friction of models/f1tenth.xml.

    Args:
      way: one of WAYS.
      patch: what is asked for.
      timestep: of the physics [s]; None: at which the tires are right when they slide.

    Attributes:
      model, data, car: as they are in any world.
      base: index of the car's body.
    """

    def __init__(self, way: str, patch: Patch, *, timestep: float | None = None) -> None:
        tires = Tires.load(IDEAL_TIRES) if way == "site" else Tires()
        spec = Vehicle.load().spec(tires=tires)
        if way == "site":
            add_patches(spec, (patch,))
        else:
            _add_geom(spec, way, patch)
        self.model = spec.compile()
        set_timestep(self.model, timestep or tires.sliding_timestep)
        self._forces = TireForces(self.model)
        self.data, self.car = mujoco.MjData(self.model), Car(self.model)
        self.base = self.model.body("base_link").id
        self._floor = PatchedFloor(self.model)

    def step(self) -> None:
        """Step the physics."""
        self._floor.apply(self.data.qpos)
        self._forces.mu[:] = self._floor.mu
        self._forces.step(self.data)
        mujoco.mj_subtreeVel(self.model, self.data)

    def tire_loads(self) -> FloatArray:
        """Return what the tires carried in the last step, all that carries each together. Shape (4,) [N]."""
        loads, wrench = np.zeros(len(WHEELS)), np.empty(6)
        tires = [self.model.geom(f"{wheel}_tire").id for wheel in WHEELS]
        for index, contact in enumerate(self.data.contact):
            for tire in set(contact.geom.tolist()) & set(tires):
                mujoco.mj_contactForce(self.model, self.data, index, wrench)
                loads[tires.index(tire)] += wrench[0]
        for tire in range(len(self._forces.rows)):
            loads[tire] += self.data.userdata[USERDATA * tire + LOAD]
        return loads


def _add_geom(spec: Any, way: str, patch: Patch) -> None:
    """Lay a patch as a geom, in a way that is not `site`."""
    top = _RISE if way == "raised" else 0.0
    half = 0.5 * patch.heading
    tire = next(pair for pair in spec.pairs)
    friction = [patch.mu, *tire.friction[2:4]]
    spec.worldbody.add_geom(
        name="patch", type=mujoco.mjtGeom.mjGEOM_BOX, pos=(patch.x, patch.y, top - 0.5 * _THICKNESS),
        size=(0.5 * patch.length, 0.5 * patch.width, 0.5 * _THICKNESS), friction=friction, contype=0, conaffinity=0,
        quat=(math.cos(half), 0.0, 0.0, math.sin(half)),
    )  # fmt: skip
    if way in ("pair", "raised"):
        for pair in list(spec.pairs):
            own: dict[str, Any] = {
                "friction": [patch.mu, patch.mu, *pair.friction[2:]], "condim": pair.condim, "solref": pair.solref,
                "solimp": pair.solimp, "solreffriction": pair.solreffriction,
            }  # fmt: skip
            spec.add_pair(name=f"{pair.name}_on_patch", geomname1=pair.geomname1, geomname2="patch", **own)
        return
    # by contact bits, so that MuJoCo combines the two geoms; the chassis has none of these
    patch_geom = spec.geom("patch")
    patch_geom.contype, patch_geom.priority = _BIT, int(way == "priority")
    for wheel in WHEELS:
        geom = spec.geom(f"{wheel}_tire")
        geom.conaffinity, geom.friction = _BIT, [Vehicle.load().greatest_mu(), *friction[1:]]
    for geom in (patch_geom, *(spec.geom(f"{wheel}_tire") for wheel in WHEELS)):
        geom.condim, geom.solref, geom.solimp = tire.condim, tire.solref, tire.solimp


def sliding_sideways(way: str, mu: float, *, speed: float = 3.0, timestep: float | None = None) -> float:
    """Return the deceleration over g of a car that slides sideways on a patch [-]: the mu that acts.

    Sideways, because no wheel can roll away from it: the car's brake works through open differentials, and cannot lock
    all four.
    """
    slab = Slab(way, Patch(x=0.0, y=0.0, length=40.0, width=40.0, mu=mu), timestep=timestep)
    slab.car.set_pose(slab.data, 0.0, 0.0, 0.0)
    while slab.data.time < 0.3:  # to rest on what is there
        slab.step()
    slab.data.qvel[1] = speed
    lasting = speed / (slab.car.parameters.gravity * max(mu, Vehicle.load().greatest_mu()))  # at least
    start, motion = slab.data.time, []
    while slab.data.time < start + 0.9 * lasting:
        slab.step()
        motion.append((slab.data.time, slab.data.subtree_linvel[slab.base, 1]))
    time, velocity = np.array(motion[len(motion) // 3 :]).T
    return -float(np.polyfit(time, velocity, 1)[0]) / slab.car.parameters.gravity


def brake_onset(mu: float, *, timestep: float = 0.001, tolerance: float = 0.004) -> float:
    """Return from which fraction of the closed form a tire of a car that brakes on a patch slides, by bisection [-].

    The rear axle carries M (g lf - a h') / b and passes on M a / 2 of a braking a: it lets go at
    a = g lf / b / (h' / b + 1 / (2 mu)), where h' is the CoG's height and what the wheels' own inertia adds to it,
    4 I / (M r). NaN where it is not between 0.9 and 1.2. The set point is given anew at each step, hence a fine one:
    held for 5 ms, the servo gives 2.5 % less than was asked for.
    """

    def slides(fraction: float) -> bool:
        slab = Slab("site", Patch(x=0.0, y=0.0, length=40.0, width=4.0, mu=mu), timestep=timestep)
        car, meter = slab.car.parameters, TireSlipMeter(slab.model)
        hubs = slab.model.jnt_dofadr[[slab.model.joint(f"{wheel}_wheel").id for wheel in WHEELS]]
        inertia = float(slab.model.dof_M0[hubs].sum())
        lever = car.center_of_gravity_height + inertia / (car.mass * car.wheel_radius)
        held = car.gravity * car.front_axle_distance / car.wheelbase / (lever / car.wheelbase + 0.5 / mu)
        slab.car.set_pose(slab.data, 0.0, 0.0, 0.0, 5.0)
        while slab.data.time < 0.5:  # ramped, as springs and load transfer need
            asked = fraction * held * min(1.0, slab.data.time / 0.2)
            slab.data.ctrl[1] = slab.car.odometry(slab.data).speed - asked * car.speed_time_constant
            slab.step()
            meter.record(slab.data)
        return bool(meter.read().slides.any())

    return bisect(slides, 0.9, 1.2, tolerance)


def edge_load(way: str, mu: float, *, speed: float = 4.0, timestep: float | None = None) -> float:
    """Return the greatest load of a tire that rolls over the edge of a patch, over its load before it [-]."""
    slab = Slab(way, Patch(x=5.0, y=0.0, length=8.0, width=4.0, mu=mu), timestep=timestep)
    slab.car.set_pose(slab.data, -1.0, 0.0, 0.0, speed)
    before, greatest = np.ones(4), 0.0
    while slab.data.qpos[0] < 2.0:
        slab.step()
        if slab.data.qpos[0] < 0.5:  # the front wheels are .33 m ahead, and the patch begins at 1 m
            before = slab.tire_loads()
        else:
            greatest = max(greatest, float((slab.tire_loads() / before).max()))
    return greatest


def circle(
    mu: float, radius: float, fraction: float, *, timestep: float | None = None
) -> tuple[float, TireSlip, float]:
    """Drive into a patch and there on a circle, at `fraction` of the law's speed, sqrt(g mu radius).

    Returns:
      The driven radius at the rear axle [m], the slip of the last part (friction utilisation is over the ground's mu),
      and the lateral acceleration over mu g [-].
    """
    floor = Patch(x=0.0, y=0.0, length=50.0, width=50.0, mu=mu)
    slab = Slab("site", floor, timestep=timestep)
    data, car, meter = slab.data, slab.car, TireSlipMeter(slab.model)
    target = fraction * math.sqrt(car.parameters.gravity * mu * radius)
    steering = math.atan(car.parameters.wheelbase / radius)
    car.set_pose(data, 0.0, 0.0, 0.0, 0.6 * target)
    command, motion, seconds = 0.6 * target, [], 2.0 + 0.8 * target / 0.6
    while data.time < seconds:
        # gently; the servo holds the mean of all wheels, of which the front ones go faster
        command += math.copysign(0.6 * slab.model.opt.timestep, target - math.hypot(*data.qvel[:2]))
        angle = steering * min(1.0, data.time / 0.3)
        car.apply(data, DriveCommand(steering_angle=angle, speed=command))
        slab.step()
        if data.time > seconds - 1.0:
            meter.record(data)
            motion.append((math.hypot(*data.qvel[:2]), data.qvel[5]))
    speed, yaw_rate = np.mean(motion, axis=0)
    return float(speed / yaw_rate), meter.read(), float(speed * yaw_rate / (mu * car.parameters.gravity))


def onset(mu: float, radius: float, *, timestep: float | None = None, tolerance: float = 0.004) -> tuple[float, float]:
    """Return the fractions of the law's speed from which the car runs wide, and from which a tire slides.

    Both by bisection, to `tolerance`. Wide is a circle wider than the kinematic one by half a percent, which a car at
    k = 1.0025 of the law's speed has by v^2 / R = mu g; NaN where it is not between 0.9 and 1.2.
    """

    @cache
    def drive(fraction: float) -> tuple[bool, bool]:
        driven, slip, _ = circle(mu, radius, fraction, timestep=timestep)
        return driven > (1.0 + _WIDE) * radius, bool(slip.slides.any())

    wide = bisect(lambda fraction: drive(fraction)[0], 0.9, 1.2, tolerance)
    return wide, bisect(lambda fraction: drive(fraction)[1], 0.9, 1.2, tolerance)


def bisect(happens: Callable[[float], bool], low: float, high: float, tolerance: float) -> float:
    """Return where something begins to happen between `low` and `high`; NaN where it does at neither, or at both."""
    if happens(low) or not happens(high):
        return math.nan
    while high - low > tolerance:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if happens(middle) else (middle, high)
    return 0.5 * (low + high)
