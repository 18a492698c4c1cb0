"""The experiment `models`: the same steering angles and speeds through our car and through the 2D gyms' linear tires.

Our car's steering angle and speed are measured, and the single-track model is driven by these. So only the tires
differ. It is driven twice: with the stiffnesses that the gyms have, and with those at which a linear tire creeps as
ours do. With the latter it is an oracle for our car where slip is small. With the former it shows what a 2D gym adds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..messages import CarParameters, DriveCommand, FloatArray
from ..vehicle.single_track import SingleTrack
from ..vehicle.tires import Tires
from ..vehicle.vehicle import Vehicle
from .experiment import Cell, LabSettings, Row, Section, Tables, no_number
from .lab_ground import TICK, LabGround
from .models_section import models_section
from .steady_circle import SteadyCircle, UnreachableError
from .trace import Trace

_STEERINGS = (0.05, 0.1, 0.2, 0.3, 0.4)  # [rad] of the circles
_KS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.4142, 1.7, 2.0)
_SWING = 0.2  # [rad] of the manoeuvres
_MANOEUVRE_KS = (0.5, 0.7, 1.4142, 2.0)
_SECONDS = 4.5  # of a manoeuvre
_START = 0.5  # [s] of straight driving before it
_SETTLING = 4.0  # [s] of a circle: many times what the model takes
_TIMESTEP = 0.001  # [s] of the model
_CONTACT = Tires()  # whose creep makes them the stiffest linear tires that there are here


def _step(time: float) -> tuple[float, float]:
    return float(time >= 0.0), 1.0


def _sine(time: float) -> tuple[float, float]:
    return math.sin(math.pi * max(time, 0.0)), 1.0


def _slalom(time: float) -> tuple[float, float]:
    return math.sin(1.5 * math.pi * max(time, 0.0)), 0.85 + 0.15 * math.cos(1.5 * max(time, 0.0))


MANOEUVRES: dict[str, Callable[[float], tuple[float, float]]] = {"step": _step, "sine": _sine, "slalom": _slalom}
"""Steering angle and speed, each over its greatest, as functions of the time [s] since the manoeuvre began."""

_CIRCLE = (
    "speed_m_s", "yaw_rate_rad_s", "gym_yaw_rate_rad_s", "stiff_yaw_rate_rad_s", "curvature_over_kinematic",
    "gym_curvature_over_kinematic", "lateral_acceleration_over_mu_g", "gym_lateral_acceleration_over_mu_g", "slide_m_s",
)  # fmt: skip


class Models:
    """The experiment; see experiment.Experiment."""

    name = "models"
    title = "Against the 2D gyms' single-track model with linear tires"

    def cells(self, settings: LabSettings) -> list[Cell]:
        """Return a cell for each circle, which is driven at all speeds, and for each manoeuvre at each speed."""
        steerings = (0.2,) if settings.quick else _STEERINGS
        ks = (0.3, 0.7, 1.4142, 2.0) if settings.quick else _KS
        circles: list[Cell] = [{"manoeuvre": "circle", "steering": steering, "ks": list(ks)} for steering in steerings]
        names, manoeuvre_ks = (("sine",), (0.7, 2.0)) if settings.quick else (tuple(MANOEUVRES), _MANOEUVRE_KS)
        return circles + [{"manoeuvre": name, "steering": _SWING, "k": k} for name in names for k in manoeuvre_ks]

    def measure(self, cell: Cell) -> Tables:
        """Measure one of them, with the friction that the car has in its MJCF."""
        if cell["manoeuvre"] == "circle":
            return {"circles": measure_circle(cell["steering"], cell["ks"])}
        row, traces = measure_manoeuvre(cell["manoeuvre"], cell["steering"], cell["k"])
        return {"manoeuvres": [row], "traces": traces}

    def section(self, tables: Tables) -> Section:
        """Say where the two models agree, and where they differ."""
        car = LabGround().car
        return models_section(tables, SingleTrack(car=car.parameters, mu=car.mu))


EXPERIMENT = Models()


def creep_stiffness(mu: float, gravity: float, speed: float) -> float:
    """Return the cornering stiffness [1/rad] of a linear tire that creeps as MuJoCo's contacts at this speed [m/s].

    A contact that carries a side acceleration a moves sideways at a / rate (`solreffriction` over the impedance,
    see models/f1tenth.xml), which is a slip angle of a / (rate speed); a linear tire's is a / (mu g stiffness).
    """
    model = Vehicle.load().compile()
    tire = model.pair("front_left_tire").id
    rate = -float(model.pair_solreffriction[tire, 1]) / float(model.pair_solimp[tire, 0])  # [1/s]
    return rate * speed / (mu * gravity)


def measure_circle(steering: float, ks: Sequence[float]) -> list[Row]:
    """Return a row for each k: our car's settled yaw rate on a circle, and the models' at the same angle and speed."""
    car = LabGround(tires=_CONTACT).car
    mu, gravity, lr = car.mu, car.parameters.gravity, car.parameters.rear_axle_distance
    circle = SteadyCircle(mu, steering, tires=_CONTACT)
    kinematic = math.tan(steering) / car.parameters.wheelbase  # [1/m] curvature of the rear axle's path
    rows: list[Row] = []
    for k in ks:
        row: Row = {"steering_rad": steering, "k": k}
        try:
            reading = circle.at(k)
        except UnreachableError as error:
            rows.append({**row, **no_number(str(error), *_CIRCLE)})
            continue
        yaw_rate = reading.curvature * kinematic * reading.speed
        speed = math.hypot(reading.speed, yaw_rate * lr)  # of the centre of gravity
        gym, stiff = _models(car.parameters, mu, speed)
        theirs, as_stiff = (settled_yaw_rate(model, steering, speed) for model in (gym, stiff))
        on_rails = kinematic * speed / math.hypot(1.0, lr * kinematic)
        values = (
            speed, yaw_rate, theirs, as_stiff, yaw_rate / on_rails, theirs / on_rails,
            yaw_rate * speed / (mu * gravity), theirs * speed / (mu * gravity), reading.slide,
        )  # fmt: skip
        rows.append({**row, **dict(zip(_CIRCLE, values, strict=True)), "reason": ""})
    return rows


def measure_manoeuvre(name: str, swing: float, k: float) -> tuple[Row, list[Row]]:
    """Drive a manoeuvre, at its fastest at `k` times the law's speed for its greatest steering angle [rad].

    Returns:
      How the yaw rates differ over all of it, and a row for each tick.
    """
    ground = LabGround(tires=_CONTACT)
    mu, car = ground.car.mu, ground.car.parameters
    top = k * math.sqrt(car.gravity * mu * car.wheelbase / math.tan(swing))
    shares = [MANOEUVRES[name](tick * TICK - _START) for tick in range(round(_SECONDS / TICK))]
    ground.place(top * shares[0][1])
    trace = ground.run([DriveCommand(steering_angle=swing * turn, speed=top * pace) for turn, pace in shares])
    place, speed = _gravity_centre(trace, car)
    motions = [
        model.follow(trace.steering_angle, speed, timestep=trace.timestep)
        for model in _models(car, mu, float(speed.mean()))
    ]
    differences = [_rms(motion.yaw_rate - trace.yaw_rate) / _rms(trace.yaw_rate) for motion in motions]
    row: Row = {
        "manoeuvre": name, "steering_rad": swing, "k": k, "speed_m_s": float(speed.mean()),
        "yaw_rate_rad_s": _greatest(trace.yaw_rate), "gym_yaw_rate_rad_s": _greatest(motions[0].yaw_rate),
        "gym_difference": differences[0], "stiff_difference": differences[1],
        "slide_m_s": float(np.nanmax(trace.slip.sliding_speed)),
    }  # fmt: skip
    columns = {
        "time_s": trace.time - _START, "steering_rad": trace.steering_angle, "speed_m_s": speed,
        "x_m": place[:, 0] - place[0, 0], "y_m": place[:, 1] - place[0, 1], "yaw_rate_rad_s": trace.yaw_rate,
        "gym_x_m": motions[0].x, "gym_y_m": motions[0].y, "gym_yaw_rate_rad_s": motions[0].yaw_rate,
        "stiff_yaw_rate_rad_s": motions[1].yaw_rate,
    }  # fmt: skip
    ticks = slice(None, None, round(TICK / trace.timestep))
    values = zip(*(column[ticks].tolist() for column in columns.values()), strict=True)
    return row, [{"manoeuvre": name, "k": k, **dict(zip(columns, line, strict=True))} for line in values]


def settled_yaw_rate(model: SingleTrack, steering: float, speed: float) -> float:
    """Return the yaw rate [rad/s] that the model settles at, by driving it."""
    held = np.ones(round(_SETTLING / _TIMESTEP))
    return float(model.follow(steering * held, speed * held, timestep=_TIMESTEP).yaw_rate[-1])


def _models(car: CarParameters, mu: float, speed: float) -> tuple[SingleTrack, SingleTrack]:
    """Return the model with the gyms' stiffnesses, and with that of our tires' creep at this speed [m/s]."""
    stiffness = creep_stiffness(mu, car.gravity, speed)
    stiff = SingleTrack(car=car, mu=mu, front_stiffness=stiffness, rear_stiffness=stiffness)
    return SingleTrack(car=car, mu=mu), stiff


def _gravity_centre(trace: Trace, car: CarParameters) -> tuple[FloatArray, FloatArray]:
    """Return where the centre of gravity was, (n, 2) [m], and how fast over the ground, (n,) [m/s]."""
    cos, sin = np.cos(trace.heading), np.sin(trace.heading)
    ahead, turning = car.rear_axle_distance, car.rear_axle_distance * trace.yaw_rate
    place = trace.position + ahead * np.column_stack((cos, sin))
    velocity = trace.velocity + np.column_stack((-turning * sin, turning * cos))
    return place, np.hypot(*velocity.T)


def _rms(values: FloatArray) -> float:
    return math.sqrt(float((values**2).mean()))


def _greatest(values: FloatArray) -> float:
    return float(np.abs(values).max())
