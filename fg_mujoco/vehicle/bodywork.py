"""Contacts of a car's body with walls, obstacles, other cars, and the ground that it falls on.

A contact is MuJoCo's soft one in its direct form, in units of the physics step h: damping (1 + e) / h turns the speed
of approach v into e v within one step, whatever the depth, and stiffness 0.05 / h^2 then takes out a twentieth of what
is left of the depth in each. So a body goes no deeper than it moves in the step in which it arrives, and no contact
gives energy to it. MuJoCo's default, a spring of 10 ms, let a car of 20 m/s 0.4 m into a wall, and through it.

Walls, obstacles and cars have no friction, by which MuJoCo pushes a sliding contact apart. On the ground the friction
has a damping of its own, 20 / s, so that a body that slides at 20 m/s hops by 2 cm only. What the ground stops is the
geom `hull`, by a `pair` as the tires have: a chassis contact stays a crash.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

RESTITUTION = 0.2
"""[-] Speed of separation over that of approach, at the point of contact. Source: SAE 931842, 0.2 to 0.4 of cars with
bumpers at 1 to 2 m/s, about 0.1 when faster; none is published of cars of this scale."""

FRICTION = 0.3
"""[-] Of a body that slides on the ground: plastic on a floor. An estimate."""

HULL = "hull"
"""Name of the geom that the ground stops; a vehicle without one has the box `chassis` for it."""

_PUSH = 0.05  # [-] of a depth that is taken out in a step, which is slower than the rebound from that depth
PUSH_OF_MOVING = 0.3
"""[-] The same of what moves by itself, which stands still for MuJoCo: it enters a car by 4 times its way in a step."""

_IMPEDANCE = (0.99, 0.99, 0.001, 0.5, 2.0)  # nearly hard at any depth
_SLOWING = (0.0, -20.0)  # [1/s] rate at which a body that slides slows down, as far as its friction can
_PAIR_FRICTION = (FRICTION, FRICTION, 0.005, 0.0001, 0.0001)
_SAME = 1e-3  # relative difference below which a reference is that of a timestep: MJCF text keeps six digits
_HIDDEN_GROUP = 3


def solref(timestep: float, push: float = _PUSH) -> tuple[float, float]:
    """Return minus the stiffness [1/s^2] and minus the damping [1/s] of a contact at a timestep [s]."""
    return -push / timestep**2, -(1.0 + RESTITUTION) / timestep


def harden(geom: Any, timestep: float, push: float = _PUSH) -> None:
    """Let a spec's geom bounce as a body does, in place, without friction; of two the greater push counts."""
    geom.solref[:], geom.solimp[:], geom.condim = solref(timestep, push), _IMPEDANCE, 1


def stand_on_ground(spec: Any, *geoms: str) -> None:
    """Let the ground of a vehicle's spec stop some of its geoms, by name, in place."""
    for name in geoms:
        if spec.pair(name) is None:
            spec.add_pair(
                name=name, geomname1=name, geomname2="ground", condim=3, friction=_PAIR_FRICTION,
                solref=solref(spec.option.timestep), solimp=_IMPEDANCE, solreffriction=_SLOWING,
            )  # fmt: skip


def add_hull(spec: Any) -> Any:
    """Let a vehicle's spec, in place, touch the ground with its body, and bounce; return it."""
    chassis = spec.geom("chassis")
    harden(chassis, spec.option.timestep)
    if spec.geom(HULL) is None:
        hull = spec.body("base_link").add_geom(
            name=HULL, type=chassis.type, size=chassis.size, pos=chassis.pos, quat=chassis.quat, fromto=chassis.fromto,
            mass=0.0, contype=0, conaffinity=0, group=_HIDDEN_GROUP, rgba=(0.0, 0.0, 0.0, 0.0),
        )  # fmt: skip
        for part in ("type", "axisangle", "xyaxes", "zaxis", "euler"):
            setattr(hull.alt, part, getattr(chassis.alt, part))
    stand_on_ground(spec, HULL)
    return spec


def fit_timestep(model: mujoco.MjModel) -> None:
    """Fit the contacts of a compiled world, in place, to its timestep, where that was changed after it was compiled."""
    wanted = solref(float(model.opt.timestep))[1]
    for references, impedances in ((model.geom_solref, model.geom_solimp), (model.pair_solref, model.pair_solimp)):
        own = (impedances == _IMPEDANCE).all(axis=1)
        if not np.allclose(references[own, 1], wanted, rtol=_SAME, atol=0.0):
            finer = wanted / references[own, 1]
            references[own] *= np.column_stack((finer**2, finer))
