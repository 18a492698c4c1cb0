"""Slides each car on each set of tires, at the default time step and at .25 ms, and prints how far apart they are.

    python benchmarks/slides.py [--tires coulomb,slipx_reference] [--vehicles f1tenth] [--only step,spin] [--json FILE]

The car stands on level ground and is driven by commands of 40 Hz. A row is one manoeuvre: whether the car rolled over
(at both steps), the greatest lateral acceleration over what the tires give (peak times g), the greatest yaw rate at
both steps and their difference, and, where there is a closed form, the distance or the angle over it. `energy` is by
how much the energy of the car rose above what it began with, motor off. It is on MuJoCo's own contacts, too
(`--tires contact`), for comparison. A star marks a row that misses what is asked: 1.03, 3 % and 3 %.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import mujoco
import numpy as np
from common import parser, report, table

from fg_mujoco.messages import DriveCommand
from fg_mujoco.vehicle.bodywork import add_hull, fit_timestep
from fg_mujoco.vehicle.car import WHEELS, Car
from fg_mujoco.vehicle.tire_forces import TireForces
from fg_mujoco.vehicle.tire_rows import LOAD, USERDATA
from fg_mujoco.vehicle.tires import Tires, tire_names
from fg_mujoco.vehicle.vehicle import Vehicle, vehicle_names

TICK, FINE = 0.025, 0.00025  # [s]
GRAVITY = 9.81
TIPPED = math.cos(math.radians(80.0))  # beyond that a car has rolled over

Command = Callable[[float], tuple[float, float]]  # of the time [s]: steering angle [rad], speed [m/s]


@dataclass(frozen=True, kw_only=True)
class Slide:
    """A manoeuvre."""

    name: str
    command: Command
    duration: float  # [s]
    speed: float = 0.0  # [m/s] forward, wheels rolling
    sideways: float = 0.0  # [m/s]
    yaw_rate: float = 0.0  # [rad/s]
    mu: float | None = None
    blocked: bool = False  # wheels
    motor: bool = True
    patch: bool = False  # half the friction under the left wheels
    closed: str = ""  # name of the closed form that it is held against


def steps() -> Iterator[Slide]:
    """Yield the manoeuvres."""
    for speed in (4.0, 6.0, 8.0):
        for angle in (0.2, 0.3, 0.4):
            yield Slide(
                name=f"step_{speed:g}_{angle:g}", speed=speed, duration=2.5,
                command=lambda t, a=angle, v=speed: (a if t >= 0.3 else 0.0, v),
            )  # fmt: skip
    for speed in (6.0, 8.0):
        yield Slide(
            name=f"slalom_{speed:g}", speed=speed, duration=4.0,
            command=lambda t, v=speed: (0.4 * min(t / 3.0, 1.0) * math.sin(4.0 * math.pi * t), v),
        )  # fmt: skip
    yield Slide(
        name="brake_in_turn", speed=4.0, duration=3.0,
        command=lambda t: (0.08 if t >= 0.3 else 0.0, 4.0 if t < 1.5 else 0.0),
    )  # fmt: skip
    yield Slide(
        name="lift_off", speed=4.5, duration=3.0,
        command=lambda t: (0.08 if t >= 0.3 else 0.0, 4.5 if t < 1.5 else 3.0),
    )  # fmt: skip
    for speed in (2.0, 3.5, 5.0):
        yield Slide(
            name=f"sideways_{speed:g}", sideways=speed, duration=2.5, command=lambda t: (0.0, 0.0), motor=False,
            closed="distance",
        )  # fmt: skip
    yield Slide(name="spin_20", yaw_rate=20.0, duration=3.0, command=lambda t: (0.0, 0.0), motor=False)
    yield Slide(
        name="sideways_5_spin_8", sideways=5.0, yaw_rate=8.0, duration=3.0, command=lambda t: (0.0, 0.0), motor=False
    )  # fmt: skip
    yield Slide(
        name="locked_5", speed=5.0, duration=2.0, command=lambda t: (0.0, 0.0), motor=False, blocked=True,
        closed="distance",
    )  # fmt: skip
    yield Slide(name="wheelspin", duration=1.5, mu=0.3, command=lambda t: (0.0, 20.0), closed="gain")
    for mu in (0.3, 0.6, 1.3):
        yield Slide(
            name=f"step_6_0.3_mu_{mu:g}", speed=6.0, mu=mu, duration=2.5,
            command=lambda t: (0.3 if t >= 0.3 else 0.0, 6.0),
        )  # fmt: skip
    yield Slide(
        name="brake_on_patch", speed=5.0, duration=2.5, patch=True, command=lambda t: (0.0, 5.0 if t < 0.3 else 0.0)
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a manoeuvre came to at one time step."""

    rolled: bool
    lateral: float  # [-] greatest lateral acceleration over peak times g
    yaw_rate: float  # [rad/s] greatest
    moved: float  # [m] from the start
    gained: float  # [m/s]
    energy: float  # [-] greatest energy over that at the start, less 1


def slide(manoeuvre: Slide, vehicle: str, tires: str, timestep: float) -> Outcome:
    """Drive a manoeuvre."""
    own = Vehicle.load(vehicle)
    spec = own.spec(manoeuvre.mu, tires=Tires.load(tires))
    model = add_hull(spec).compile()
    model.opt.timestep = timestep
    fit_timestep(model)
    data, car, forces = mujoco.MjData(model), Car(model), TireForces(model)
    spins = [model.joint(f"{wheel}_wheel").dofadr[0] for wheel in WHEELS]
    if manoeuvre.blocked:
        model.dof_damping[spins] = 1e6
    if not manoeuvre.motor:
        motor = model.actuator("speed").id
        model.actuator_gainprm[motor], model.actuator_biasprm[motor] = 0.0, 0.0
    peak = float(forces.mu.max())
    if manoeuvre.patch:
        forces.mu[[0, 2]] *= 0.5
    car.set_pose(data, 0.0, 0.0, 0.0, manoeuvre.speed)
    forces.begin(data)
    if manoeuvre.blocked:
        data.qvel[spins] = 0.0
    arm = car.parameters.rear_axle_distance
    data.qvel[1] = manoeuvre.sideways - arm * manoeuvre.yaw_rate  # of the rear axle: the CoG moves sideways, and turns
    data.qvel[5] = manoeuvre.yaw_rate
    start, speed = _center(model, data), manoeuvre.speed
    before, began = _velocity(model, data), _energy(model, data, forces)
    lateral, turning, most = 0.0, abs(manoeuvre.yaw_rate), 0.0
    upright, count = 1.0, round(TICK / timestep)
    for tick in range(round(manoeuvre.duration / TICK)):
        angle, wanted = manoeuvre.command(tick * TICK)
        car.apply(data, DriveCommand(steering_angle=angle, speed=wanted))
        heading = car.pose(data)[2]
        for _ in range(count):
            forces.step(data)
            turning = max(turning, abs(float(data.qvel[5])))
        q = data.qpos[3:7]
        upright = min(upright, float(1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2)))
        now = _velocity(model, data)
        heading = 0.5 * (heading + _near(car.pose(data)[2], heading))
        pull = (now - before) / TICK
        if upright > TIPPED:
            lateral = max(lateral, abs(float(pull[1] * math.cos(heading) - pull[0] * math.sin(heading))))
        before = now
        if not manoeuvre.motor:
            most = max(most, _energy(model, data, forces) / began - 1.0)
    return Outcome(
        rolled=upright < TIPPED, lateral=lateral / (peak * GRAVITY), yaw_rate=turning,
        moved=float(np.hypot(*(_center(model, data) - start)[:2])),
        gained=float(np.hypot(*before[:2])) - speed, energy=most,
    )  # fmt: skip


def closed_form(manoeuvre: Slide, vehicle: str, tires: str) -> float:
    """Return what a manoeuvre comes to by its closed form; NaN where there is none."""
    axles = Tires.load(tires)
    own = Vehicle.load(vehicle)
    model = own.spec(manoeuvre.mu, tires=axles).compile()
    mu = float(TireForces(model).mu.mean())
    if axles.is_contact or axles.model in ("coulomb", "brush"):
        friction = mu
    elif axles.model == "magic_formula" and manoeuvre.blocked:
        scale = mu / np.mean([axle.lateral.peak for axle in axles.axles])
        shares = [axle.longitudinal.force(1.0) * scale for axle in axles.axles]
        if max(axle.load_sensitivity for axle in axles.axles) > 0.0 or abs(shares[0] / shares[1] - 1.0) > 0.02:
            return math.nan  # it turns, or it depends on how the load is shared
        friction = float(np.mean(shares))
    else:
        return math.nan
    if manoeuvre.closed == "distance":
        speed = manoeuvre.sideways or manoeuvre.speed
        return speed**2 / (2.0 * friction * GRAVITY)
    if manoeuvre.closed == "gain":
        return friction * GRAVITY * manoeuvre.duration
    return math.nan


def _near(angle: float, other: float) -> float:
    return other + math.remainder(angle - other, 2.0 * math.pi)


def _center(model: mujoco.MjModel, data: mujoco.MjData) -> Any:
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data.subtree_com[model.body("base_link").id].copy()


def _velocity(model: mujoco.MjModel, data: mujoco.MjData) -> Any:
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)
    mujoco.mj_subtreeVel(model, data)
    return data.subtree_linvel[model.body("base_link").id].copy()


def _energy(model: mujoco.MjModel, data: mujoco.MjData, forces: TireForces) -> float:
    """Return kinetic and potential energy [J], those of springs and tires included."""
    _velocity(model, data)
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    total = float(data.energy.sum())
    for k, row in enumerate(forces.rows):
        depth = row["radius"] - data.xpos[row["body"], 2]
        total += 0.5 * float(row["vertical_stiffness"]) * max(depth, 0.0) ** 2
        load, along, across = data.userdata[USERDATA * k + LOAD : USERDATA * k + LOAD + 3]
        if load > 0.0:  # what a deflected tire gives back: its force over its stiffness
            stiffness = row["slope"] * load / row["relaxation_length"]
            total += 0.5 * float(along**2 / stiffness[0] + across**2 / stiffness[1])
    return total


def main() -> None:
    """Slide them all."""
    options = parser(__doc__)
    options.add_argument("--tires", default=",".join(tire_names()), metavar="SETS")
    options.add_argument("--vehicles", default=",".join(vehicle_names()), metavar="NAMES")
    options.add_argument("--only", default="", metavar="NAMES", help="manoeuvres whose name has one of these")
    given = options.parse_args()
    wanted = [name for name in given.only.split(",") if name]
    rows, figures, missed = [], [], 0
    for vehicle in given.vehicles.split(","):
        for tires in given.tires.split(","):
            for manoeuvre in steps():
                if wanted and not any(name in manoeuvre.name for name in wanted):
                    continue
                coarse, fine = (slide(manoeuvre, vehicle, tires, step) for step in (0.005, FINE))
                form = closed_form(manoeuvre, vehicle, tires)
                reached = coarse.gained if manoeuvre.closed == "gain" else coarse.moved
                apart = coarse.yaw_rate / fine.yaw_rate - 1.0 if fine.yaw_rate > 0.05 else 0.0
                over = reached / form - 1.0 if math.isfinite(form) else 0.0
                fails = (
                    coarse.rolled != fine.rolled, coarse.lateral > 1.03 and Tires.load(tires).model != "linear",
                    abs(apart) > 0.03 and not coarse.rolled, abs(over) > 0.03, coarse.energy > 1e-3,
                )  # fmt: skip
                missed += any(fails)
                rows.append(
                    (
                        f"{vehicle} {tires} {manoeuvre.name}{' *' if any(fails) else ''}",
                        "/".join("over" if outcome.rolled else "up" for outcome in (coarse, fine)),
                        f"{coarse.lateral:.3f}", f"{coarse.yaw_rate:.3f}", f"{fine.yaw_rate:.3f}",
                        f"{100.0 * apart:+.2f} %", f"{100.0 * over:+.2f} %" if math.isfinite(form) else "",
                        f"{100.0 * coarse.energy:+.2f} %" if not manoeuvre.motor else "",
                    )
                )  # fmt: skip
                figures.append(
                    {"vehicle": vehicle, "tires": tires, "manoeuvre": manoeuvre.name, "coarse": asdict(coarse),
                     "fine": asdict(fine), "closed_form": form, "missed": list(map(bool, fails))}
                )  # fmt: skip
    header = ("manoeuvre", "5 ms/.25 ms", "lateral", "yaw 5 ms", "yaw .25 ms", "apart", "closed form", "energy")
    report(
        {"slides": figures}, table(header, rows) + f"\n\n{missed} of {len(rows)} rows miss what is asked.", given.json
    )


if __name__ == "__main__":
    main()
