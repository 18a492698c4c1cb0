"""The experiment `tire_bench`: one wheel on the ground at a set load, slip angle and slip ratio, as tires are measured.

The wheel of the car f1tenth is under a mass of the load, which is held to a straight line, and free up and down. Its
heading is turned off the line by the slip angle, and its spin is set, both before each physics step of 5 ms, and
neither moves within one. The force is the mean over the tire's short steps, as the engine's kernel writes it. It is
compared with the formula of the set's file.

- `points`: pure side slip, pure slip ratio, and both, over loads of 2 to 20 N;
- `lag`: a step of the slip angle at 1 to 8 m/s, and over which way the force follows;
- `curves`: what is drawn.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from ..messages import FloatArray
from ..pictures.pages import figure_kit as style
from ..vehicle.tire_forces import FORCE_ACROSS, FORCE_ALONG, LOAD, TireForces, put_on
from ..vehicle.tires import AxleTires, Law, Tires, tire_names
from ..vehicle.vehicle import Vehicle
from .experiment import Cell, Experiment, Figure, LabSettings, Row, Section, Tables

if TYPE_CHECKING:
    import matplotlib.figure

_AXLES = ("front", "rear")
_LOADS = (2.0, 5.0, 9.17, 14.0, 20.0)  # [N]
_SLIPS = (0.005, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.1, 0.13, 0.17, 0.22, 0.3, 0.4, 0.5)
_BOTH = (0.02, 0.05, 0.1, 0.2, 0.4)  # sizes of combined slips
_WAYS = (-60.0, -30.0, 30.0, 45.0, 75.0)  # [deg] of a combined slip, 0 is along
_SPEED = 3.0  # [m/s]
_SPEEDS = (1.0, 2.0, 4.0, 8.0)  # [m/s] of the step
_STEP = 0.002  # [rad] of slip angle, so small that the curve is straight
_HELD = [0, 1, 3, 4, 5, 6]  # dofs that are set: all but the one up and down
_HEAVY = 1e9  # [kg, kg m^2] of these, so that no force of the tire moves them within a physics step
_ROLLED, _MOST_ROLLS, _SETTLED = 40.0, 20, 1e-5  # relaxation lengths, how often, and spread, until a point is read
_SETTLING = 1.0  # [s] of the load
_PEAK_SHARE, _LAG_SHARE = 0.005, 0.05  # asked


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
        self.model.dof_armature[_HELD] = _HEAVY  # only now: the tire's damping is that of the wheel's own inertia
        self._speed = speed
        self._forces.begin(self.data)
        self.roll(_SETTLING, 0.0, 0.0)

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


class TireBench:
    """One wheel at set slips."""

    name = "tire_bench"
    title = "Tires on the bench: force over slip, against the formula"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """Return a cell for each axle of each set; `quick`: of two sets."""
        names = [name for name in tire_names() if name != "contact"]
        if settings.quick:
            names = ["forzaeth_nuc2", "slipx_reference"]
        return [{"tires": name, "axle": axle, "quick": settings.quick} for name in names for axle in _AXLES]

    def measure(self, cell: Cell) -> Tables:
        """Measure the curves of an axle, and its lag."""
        tires, quick = Tires.load(cell["tires"]), cell["quick"]
        axle = tires.axles[_AXLES.index(cell["axle"])]
        kinds: list[tuple[str, float, float]] = [("side", 0.0, slip) for slip in _SLIPS]
        kinds += [("along", slip, 0.0) for slip in _SLIPS] + [("along", -slip, 0.0) for slip in _SLIPS]
        kinds += [
            ("both", size * math.cos(math.radians(way)), size * math.sin(math.radians(way)))
            for size in _BOTH
            for way in _WAYS
        ]
        points: list[Row] = []
        for load in _LOADS[::4] if quick else _LOADS:
            bench = Bench(tires, cell["axle"], load, _SPEED)
            greatest = load * axle.load_factor(load) * axle.lateral.peak
            for kind, ratio, angle in kinds:
                for _ in range(_MOST_ROLLS):
                    forces = bench.roll(_ROLLED * axle.relaxation_length / _SPEED, ratio, angle)
                    spread = float(np.ptp(forces[-10:], axis=0).max()) / greatest
                    if spread < _SETTLED:
                        break
                used, along, across = forces[-1]
                right = formula(axle, used, ratio, angle)
                error = math.hypot(along - right[0], across - right[1]) / greatest
                points.append(
                    {"tires": tires.name, "axle": cell["axle"], "kind": kind, "load_N": load, "slip_ratio": ratio,
                     "slip_angle_rad": angle, "fx_N": along, "fy_N": across, "formula_fx_N": right[0],
                     "formula_fy_N": right[1], "error": error, "spread": spread}
                )  # fmt: skip
        return {"points": points, "lag": [_lag(tires, cell["axle"], speed) for speed in _SPEEDS]}

    def section(self, tables: Tables) -> Section:
        """Say how far the force is from the formula, and how long the lag is."""
        points, lag = tables["points"], tables["lag"]
        error, spread = (max(_numbers(points, name)) for name in ("error", "spread"))
        lags = [abs(length / sigma - 1.0) for length, sigma in zip(
            _numbers(lag, "lag_m"), _numbers(lag, "relaxation_length_m"), strict=True)]  # fmt: skip
        names = list(dict.fromkeys(str(row["tires"]) for row in points))
        return Section(
            sentences=(
                f"Over slips to {_SLIPS[-1]:g} and loads of {_LOADS[0]:g} to {_LOADS[-1]:g} N, pure and combined, the "
                f"force of {len(names)} sets is the formula's to within {100.0 * error:.3f} % of the peak.",
                f"After a step of the slip angle the force follows over the relaxation length to within "
                f"{100.0 * max(lags):.2f} %, from {_SPEEDS[0]:g} to {_SPEEDS[-1]:g} m/s.",
                f"Once settled, load and force vary by at most {100.0 * spread:.4f} % of the peak, past it, too: no "
                "tire hops.",
            ),
            figures=(
                Figure(
                    name="curves",
                    caption="Side force over load by the slip angle, of all sets at a load of 9.17 N or the nearest. "
                    "Lines: the formula. Points: the bench. Dotted: the rear axle.",
                    draw=lambda figure: _draw_curves(figure, points, names),
                    height=3.8,
                ),
                Figure(
                    name="ellipse",
                    caption="Forces along and across over the load, pure and combined, at the same load.",
                    draw=lambda figure: _draw_ellipse(figure, points, names),
                    height=4.2,
                ),
            ),
            columns={"lag": ("tires", "axle", "speed_m_s", "relaxation_length_m", "lag_m")},
            expected=(
                ("force to the formula's, of the peak", f"at most {100.0 * _PEAK_SHARE:g} %", f"{100.0 * error:.3f} %"),
                ("lag to the relaxation length", f"within {100.0 * _LAG_SHARE:g} %", f"{100.0 * max(lags):.2f} %"),
                ("spread of load and force, of the peak", "below 0.1 %", f"{100.0 * spread:.4f} %"),
            ),
        )  # fmt: skip


EXPERIMENT: Experiment = TireBench()


def _lag(tires: Tires, name: str, speed: float) -> Row:
    """Return over which way the side force follows a small step of the slip angle [m]: its logarithm's slope."""
    axle = tires.axles[_AXLES.index(name)]
    bench = Bench(tires, name, 9.17, speed)
    timestep = bench.model.opt.timestep
    side = bench.roll(20.0 * axle.relaxation_length / speed, 0.0, _STEP)[:, 2]
    left = 1.0 - side / side[-1]
    rolled = timestep * speed * np.arange(1, len(side) + 1)
    clear = (left > 1e-3) & (np.arange(len(left)) < len(left) - 1)
    lag = -1.0 / float(np.polyfit(rolled[clear], np.log(left[clear]), 1)[0])
    return {
        "tires": tires.name, "axle": name, "speed_m_s": speed, "relaxation_length_m": axle.relaxation_length,
        "lag_m": lag,
    }  # fmt: skip


def _numbers(rows: list[Row], name: str) -> list[float]:
    values: list[float] = style.column(rows, name).tolist()
    return values


def _drawn(points: list[Row], name: str, axle: str, kinds: tuple[str, ...]) -> tuple[list[Row], float]:
    """Return the points of an axle at the load that is drawn, and this load [N]."""
    load = min({float(row["load_N"] or 0.0) for row in points}, key=lambda load: abs(load - 9.17))
    return [
        row for row in points
        if (row["tires"], row["axle"], row["load_N"]) == (name, axle, load) and row["kind"] in kinds
    ], load  # fmt: skip


def _draw_curves(figure: matplotlib.figure.Figure, points: list[Row], names: list[str]) -> None:
    axes = figure.add_subplot()
    slips = np.linspace(1e-4, _SLIPS[-1], 400)
    for place, name in enumerate(names):
        colour = style.COLOURS[place % len(style.COLOURS)]
        for axle, tires, line in zip(_AXLES, Tires.load(name).axles, ("-", ":"), strict=True):
            shown, load = _drawn(points, name, axle, ("side",))
            forces = [formula(tires, load, 0.0, slip)[1] / load for slip in slips]
            axes.plot(slips, forces, line, color=colour, linewidth=1.0)
            label = name if axle == "front" else ""
            force = style.column(shown, "fy_N") / load
            style.measured(axes, style.column(shown, "slip_angle_rad"), force, label, colour=colour)
    axes.set_ylim(0.0, 1.4)
    style.finish(axes, "slip angle [rad]", "side force over load [-]")


def _draw_ellipse(figure: matplotlib.figure.Figure, points: list[Row], names: list[str]) -> None:
    axes = figure.add_subplot()
    for place, name in enumerate(names):
        shown, load = _drawn(points, name, "front", ("side", "along", "both"))
        colour = style.COLOURS[place % len(style.COLOURS)]
        along, across = style.column(shown, "fx_N") / load, style.column(shown, "fy_N") / load
        style.measured(axes, along, across, name, colour=colour)
    axes.set_aspect("equal")
    style.finish(axes, "force along the heading over load [-]", "side force over load [-]")
