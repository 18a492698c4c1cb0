"""Braking and accelerating, straight ahead and in turns: the friction circle, as far as this car can use it.

The car has one motor and open differentials, so all four wheels get the same torque. Straight ahead the lighter axle
lets go first, at g (l / b) / (h' / b + 1 / (2 mu)), well before mu g. In a turn the lighter inner wheel lets go first.

- `stops`: stopping distances with all wheels held, as if each had a brake; with the motor commanded to stop at once,
  which holds the mean of the wheels, so that the rear ones run backwards; and with the friction limiter ("limiter");
- `throttle`: acceleration over speed, beside the motor's limit: max_acceleration, which falls above power_limit_speed
  as power_limit_speed / v;
- `splits`: on a circle, cornering at a share of mu g, braking (or accelerating) grows until a tire slides: the car's
  acceleration at that moment, along and across, and what the friction limiter would allow there;
- `gg`: force over load of all tires, and the car's acceleration, in these turns and beyond: the g-g diagram.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, longitudinal_share

from ..messages import DriveCommand, FloatArray, Odometry
from ..pictures.pages.figure_kit import column, span
from ..vehicle.car import WHEELS
from ..vehicle.tire_slip import slides_above
from ..vehicle.tires import IDEAL_TIRES, Tires
from .braking_figures import draw_gg, draw_splits, draw_stops
from .experiment import LAW_TIRES, Cell, Experiment, Figure, LabSettings, Row, Section, Tables
from .lab_ground import LabGround
from .speed_laws import LAWS
from .steady_circle import SteadyCircle
from .straight_line_limits import even_torque_limit, stopping_distance, wheel_inertia
from .trace import Trace, join

if TYPE_CHECKING:
    pass

MUS = (1.0489, 0.6)
SPEEDS = (2.0, 4.0, 6.0, 8.0, 10.0)  # [m/s] that stops begin at
SHARES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95)  # of mu g, that cornering takes when braking begins
GRIPPY = 3.0  # [-] friction on which the motor is the limit
_QUICK_SPEEDS, _QUICK_SHARES = (4.0, 8.0), (0.0, 0.6)
_STEERING = 0.05  # [rad] of the turns: a circle of 6.6 m, at 8 m/s on dry ground
_GROWTH = 1.5  # [1/s] of braking, in mu g: over some .4 s, twice what load takes to move
_AFTER = 0.1  # [s] that is recorded after a tire has begun to slide
_FASTEST, _SLOWEST = 8.0, 3.0  # [m/s] straight ahead, for braking and for accelerating
_PERIOD = 0.005  # [s] of the brake's control
_STANDING = 0.05  # [m/s]
_HOLDING = 10.0  # [N m s/rad] damping of a held wheel: it creeps at 2 mm/s under all its friction
_HOWS = ("held", "full", "limiter")
_EVERY = 0.02  # [s] of the g-g diagram
_WINDOW = 0.02  # [s] over which a car's acceleration is told


class Braking:
    """See the module."""

    name = "braking"
    title = "Braking, accelerating and the friction circle"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """One for each stop, each run at full throttle, and each split of the friction circle, on each set of tires."""
        mus = MUS[:1] if settings.quick else MUS
        speeds, shares = (_QUICK_SPEEDS, _QUICK_SHARES) if settings.quick else (SPEEDS, SHARES)
        cells = [
            *({"part": "stop", "mu": mu, "speed": speed} for mu in mus for speed in speeds),
            *({"part": "throttle", "mu": mu} for mu in (*mus, GRIPPY)),
            *({"part": "split", "mu": mu, "share": share} for mu in mus for share in shares),
        ]
        return [{"tires": tires, **cell} for tires in LAW_TIRES for cell in cells]

    def measure(self, cell: Cell) -> Tables:
        """Drive the cell's part."""
        tables: Tables = {"stops": [], "throttle": [], "splits": [], "gg": []}
        tires = Tires.load(cell["tires"])
        if cell["part"] == "stop":
            tables["stops"] = [_stop(tires, cell["mu"], cell["speed"], how) for how in _HOWS]
        elif cell["part"] == "throttle":
            tables["throttle"] = _throttle(tires, cell["mu"])
        else:
            for direction in (-1, 1):
                row, points = _split(tires, cell["mu"], cell["share"], direction)
                tables["splits"].append(row)
                tables["gg"] += points
        return {name: [{"tires": cell["tires"], **row} for row in rows] for name, rows in tables.items()}

    def section(self, tables: Tables) -> Section:
        """Say what share of mu g the car reaches, straight ahead and in turns."""
        sets = list(dict.fromkeys(str(row["tires"]) for row in tables["stops"]))
        return Section(
            sentences=tuple(line for name in sets for line in _sentences(name, _on(tables, name))),
            figures=tuple(figure for name in sets for figure in _figures(name, _on(tables, name))),
            columns={
                "stops": (
                    "tires", "mu", "speed_m_s", "how", "distance_m", "closed_form_m", "best_m", "ratio", "slide_m_s",
                    "turned_rad",
                ),
                "splits": (
                    "tires", "mu", "lateral_share_begun", "direction", "lateral_share", "longitudinal_share",
                    "limiter_share", "use_of_car", "first_tire", "greatest_use", "reason",
                ),
            },
            expected=tuple(line for name in sets for line in _expected(name, _on(tables, name))),
        )  # fmt: skip


EXPERIMENT: Experiment = Braking()


def _on(tables: Tables, tires: str) -> Tables:
    return {name: [row for row in rows if row["tires"] == tires] for name, rows in tables.items()}


def _figures(tires: str, tables: Tables) -> tuple[Figure, ...]:
    """Return the figures of a set of tires."""
    ending = "" if tires == IDEAL_TIRES else f"_{tires}"
    return (
        Figure(
            name=f"stops{ending}",
            caption=f"Tires {tires}. Left: stopping distance over v²/(2 mu g): with all wheels held, at full brake by "
            "the one motor, and with the friction limiter; lines: closed forms. Right: acceleration at full throttle; "
            "lines: the motor's limit or the closed form of the front axle.",
            draw=lambda figure: draw_stops(figure, tables),
        ),
        Figure(
            name=f"gg{ending}",
            caption=f"Tires {tires}. Left: force over load of all tires, in turns in which braking and accelerating "
            "grow until tires slide, and after. Right: the car's acceleration there. Circles: mu, and mu g.",
            draw=lambda figure: draw_gg(figure, tables["gg"]),
            height=3.8,
        ),
        Figure(
            name=f"splits{ending}",
            caption=f"Tires {tires}. Acceleration along and across when the first tire slid; line: the friction "
            "limiter's.",
            draw=lambda figure: draw_splits(figure, tables["splits"]),
        ),
    )


def _stop(tires: Tires, mu: float, speed: float, how: str) -> Row:
    """Brake from a speed to a stand."""
    ground = LabGround(mu, tires=tires)
    car = ground.car.parameters
    hold = LAWS["limiter" if how == "limiter" else "none"](car, mu)
    ground.place(speed)
    if how == "held":
        dofs = [ground.model.joint(f"{wheel}_wheel").dofadr[0] for wheel in WHEELS]
        ground.model.dof_damping[dofs] = _HOLDING
        ground.data.qvel[dofs] = 0.0

    def stands(_: Odometry) -> bool:
        return abs(ground.car.ground_speed(ground.data)) < _STANDING

    trace = ground.drive(lambda odometry: hold(0.0, 0.0, odometry), 20.0, until=stands)
    moved = trace.position[-1] - trace.position[0]
    best = speed**2 / (2.0 * mu * car.gravity)
    return {
        "mu": mu,
        "speed_m_s": speed,
        "how": how,
        "distance_m": float(np.hypot(*moved)),
        "closed_form_m": stopping_distance(speed, mu, car, how, tires.on(mu).longitudinal_slope),
        "best_m": best,
        "ratio": float(np.hypot(*moved)) / best,
        "slide_m_s": float(np.nanmax(trace.slip.sliding_speed)),
        "turned_rad": float(trace.heading[-1]),
    }


def _throttle(tires: Tires, mu: float) -> list[Row]:
    """Accelerate at full throttle from 0.5 m/s for three seconds, and return the acceleration of each tenth of one."""
    ground = LabGround(mu, tires=tires)
    car = ground.car.parameters
    ground.place(0.5)
    rows: list[Row] = []
    for _ in range(30):
        trace = ground.drive(lambda odometry: DriveCommand(steering_angle=0.0, speed=car.max_speed), 0.1)
        speed = float(trace.speed.mean())
        motor = car.max_acceleration * min(1.0, car.power_limit_speed / speed)
        rows.append(
            {
                "mu": mu,
                "speed_m_s": speed,
                "acceleration_m_s2": float(trace.acceleration[:, 0].mean()),
                "motor_limit_m_s2": motor,
                "axle_limit_m_s2": even_torque_limit(mu, car, 1, wheel_inertia()),
                "slide_m_s": float(np.nanmax(trace.slip.sliding_speed)),
            }
        )
    return rows


def _split(tires: Tires, mu: float, share: float, direction: int) -> tuple[Row, list[Row]]:
    """Corner at a share of mu g, and let braking (direction -1) or accelerating grow until a tire slides."""
    if share:
        circle = SteadyCircle(mu, _STEERING, tires=tires)
        circle.at(math.sqrt(share))
        ground, steering = circle.ground, _STEERING
    else:
        ground, steering = LabGround(mu, tires=tires), 0.0
        ground.place(_FASTEST if direction < 0 else _SLOWEST)
    trace, slid = _ramp(ground, mu, steering, direction)
    car, gravity = ground.car.parameters, mu * ground.car.parameters.gravity
    window = round(_WINDOW / trace.timestep)
    then = trace[max(slid - window, 0) : slid + 1] if slid is not None else trace.last(_WINDOW)
    along, across = then.acceleration.mean(axis=0) / gravity
    limiter = FrictionLimiter(car, mu)
    most = limiter.braking if direction < 0 else limiter.accelerating
    exponent = limiter.braking_exponent if direction < 0 else limiter.exponent
    allowed = longitudinal_share(abs(across), exponent) * most / gravity
    use = np.fmax.reduce(trace.slip.friction_utilisation.ravel())
    row: Row = {
        "mu": mu,
        "lateral_share_begun": share,
        "direction": "braking" if direction < 0 else "accelerating",
        "lateral_share": float(across),
        "longitudinal_share": float(along),
        "limiter_share": float(direction * allowed),
        "use_of_car": float(math.hypot(along, across)),
        "first_tire": WHEELS[int(np.nanargmax(then.slip.sliding_speed[-1]))] if slid is not None else "",
        "greatest_use": float(use),
        "reason": "" if slid is not None else "the motor's limit came first: no tire slid",
    }
    return row, _gg_points(trace, mu)


def _ramp(ground: LabGround, mu: float, steering: float, direction: int) -> tuple[Trace, int | None]:
    """Let a demand grow; return the trace and the step at which a tire began to slide, or None."""
    car, data = ground.car.parameters, ground.data
    traces: list[Trace] = []
    slid = None
    asked, steps, left = 0.0, 0, round(1.2 / _PERIOD)
    while left:
        speed = ground.car.odometry(data).speed
        command = DriveCommand(steering_angle=steering, speed=speed + direction * asked * car.speed_time_constant)
        trace = ground.hold(command, _PERIOD)
        slides = np.flatnonzero(trace.slip.slides.any(axis=1))
        if slid is None and len(slides):
            slid, left = steps + int(slides[0]), round(_AFTER / _PERIOD)
        traces.append(trace)
        asked, steps, left = asked + _GROWTH * mu * car.gravity * _PERIOD, steps + len(trace.time), left - 1
    return join(traces), slid


def _gg_points(trace: Trace, mu: float) -> list[Row]:
    """Return force over load of each tire, and the car's acceleration over g, at some of the steps."""
    steps, every = round(_WINDOW / trace.timestep), round(_EVERY / trace.timestep)
    window = np.ones(steps) / steps
    gravity = trace.sensors.parameters.gravity
    car = np.column_stack([np.convolve(axis, window, "same") for axis in trace.acceleration.T]) / gravity
    use = trace.tire_forces / trace.slip.normal_force[:, :, np.newaxis]
    rows: list[Row] = []
    for step in range(every, len(car) - every, every):
        row: Row = {"mu": mu, "along_g": float(car[step, 0]), "across_g": float(car[step, 1])}
        for wheel, (along, across) in zip(WHEELS, use[step].tolist(), strict=True):
            row |= {f"along_{wheel}": along, f"across_{wheel}": across}
        rows.append(row)
    return rows


def _ratios(stops: list[Row], how: str, to: str) -> FloatArray:
    rows = [row for row in stops if row["how"] == how]
    ratios: FloatArray = column(rows, "distance_m") / column(rows, to)
    return ratios


def _sentences(tires: str, tables: Tables) -> tuple[str, ...]:
    stops, splits = tables["stops"], tables["splits"]
    grippy = [row for row in tables["throttle"] if row["mu"] == GRIPPY]
    motor = column(grippy, "acceleration_m_s2") / column(grippy, "motor_limit_m_s2")
    return (
        f"On {tires}, with all wheels held a stop takes {span(_ratios(stops, 'held', 'best_m'))} of v²/(2 mu g). By "
        f"its one motor the car takes {span(_ratios(stops, 'full', 'best_m'), '.2f')}, because open differentials let "
        "the rear axle, which braking lightens, limit the braking of all wheels; with the friction limiter "
        f"{span(_ratios(stops, 'limiter', 'best_m'), '.2f')}, without sliding, which is its closed form to "
        f"{100 * np.abs(_ratios(stops, 'limiter', 'closed_form_m') - 1.0).max():.1f} %.",
        f"At full throttle on ground of mu {GRIPPY:g} the car has {span(motor, '.2f')} of the motor's limit.",
        f"No tire ever has more than {np.nanmax(column(splits, 'greatest_use')):.6f} of mu times its load. The car has "
        f"{span(column(splits, 'use_of_car'), '.2f')} of mu g when its first tire slides. The friction limiter allows "
        f"at least {100 * _least_margin(splits):.0f} % less than what slides.",
    )


def _least_margin(splits: list[Row]) -> float:
    """Return the least margin of the friction limiter, as a share of the acceleration at which a tire slid."""
    slid = [row for row in splits if not row["reason"] and abs(float(row["longitudinal_share"] or 0.0)) > 0.02]
    return float((1.0 - column(slid, "limiter_share") / column(slid, "longitudinal_share")).min()) if slid else math.nan


def _expected(tires: str, tables: Tables) -> tuple[tuple[str, str, str], ...]:
    stops, splits, points = tables["stops"], tables["splits"], tables["gg"]
    slide = column([row for row in stops if row["how"] == "limiter"], "slide_m_s").max()
    car = np.hypot(column(points, "along_g"), column(points, "across_g")) / column(points, "mu")
    return (
        (f"{tires}: stop with all wheels held, over v²/(2 mu g)", "1", span(_ratios(stops, "held", "best_m"))),
        (
            "stop by the motor, over the closed form of the rear axle",
            "1",
            span(_ratios(stops, "full", "closed_form_m")),
        ),
        (
            "stop with the friction limiter, over its closed form",
            "1",
            span(_ratios(stops, "limiter", "closed_form_m")),
        ),
        ("stop with the friction limiter, greatest slide", f"below {slides_above(tires)} m/s", f"{slide:.3f} m/s"),
        ("g-g: force over mu times load, any tire", "at most 1", f"{column(splits, 'greatest_use').max():.6f}"),
        ("g-g: the car's acceleration over mu g", "at most 1, while loads stay", f"{car.max():.3f}"),
    )
