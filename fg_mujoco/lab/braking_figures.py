"""Figures of the braking experiment, from its tables."""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from fg_mujoco.controllers.safety.friction_limiter import FrictionLimiter, longitudinal_share

from ..pictures.pages import figure_kit as style
from ..pictures.pages.figure_kit import column
from ..vehicle.car import WHEELS
from ..vehicle.vehicle import Vehicle
from .experiment import Row, Tables

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure

_STOPS = {"held": "wheels held", "full": "full brake", "limiter": "limiter"}


def draw_stops(figure: matplotlib.figure.Figure, tables: Tables) -> None:
    """Draw stopping distances, and acceleration over speed, beside their closed forms."""
    left, right = figure.subplots(1, 2)
    mus = dict.fromkeys(column(tables["stops"], "mu").tolist())
    for (mu, how), colour in zip(product(mus, _STOPS), style.COLOURS, strict=False):
        rows = [row for row in tables["stops"] if row["mu"] == mu and row["how"] == how]
        best = column(rows, "best_m")
        style.theory(left, best, column(rows, "closed_form_m"), colour=colour)
        style.measured(left, best, column(rows, "distance_m"), f"{_STOPS[how]}, mu {mu:g}", colour=colour)
    style.finish(left, "v²/(2 mu g) [m]", "stopping distance [m]")
    for mu, colour in zip(dict.fromkeys(column(tables["throttle"], "mu").tolist()), style.COLOURS, strict=False):
        rows = [row for row in tables["throttle"] if row["mu"] == mu]
        speed = column(rows, "speed_m_s")
        style.measured(right, speed, column(rows, "acceleration_m_s2"), f"mu {mu:g}", colour=colour)
        closed = np.minimum(column(rows, "motor_limit_m_s2"), column(rows, "axle_limit_m_s2"))
        style.theory(right, speed, closed, colour=colour)
    right.set_ylim(0.0, None)
    style.finish(right, "speed [m/s]", "acceleration [m/s²]")


def _circle(axes: matplotlib.axes.Axes, radius: float, label: str) -> None:
    angle = np.linspace(0.0, 2.0 * math.pi, 200)
    style.theory(axes, radius * np.cos(angle), radius * np.sin(angle), label)


def draw_gg(figure: matplotlib.figure.Figure, points: list[Row]) -> None:
    """Draw the g-g diagram of all tires and of the car."""
    mu = max(column(points, "mu"))
    points = [row for row in points if row["mu"] == mu]
    left, right = figure.subplots(1, 2)
    for wheel, colour in zip(WHEELS, style.COLOURS, strict=False):
        along, across = column(points, f"along_{wheel}"), column(points, f"across_{wheel}")
        label = wheel.replace("_left", ", inner").replace("_right", ", outer")
        style.measured(left, across, along, label, colour=colour, markersize=1.5)
    style.measured(right, column(points, "across_g"), column(points, "along_g"), "car", markersize=1.8)
    _circle(left, mu, f"mu {mu:g}")
    _circle(right, mu, "mu g")
    for axes in (left, right):
        axes.set_aspect("equal")
    style.finish(left, "force across / load [-]", "force along / load [-]", legend=False)
    style.finish(right, "acceleration across [g]", "acceleration along [g]", legend=False)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=5)


def draw_splits(figure: matplotlib.figure.Figure, splits: list[Row]) -> None:
    """Draw what the car had along and across when its first tire slid, and what the friction limiter allows."""
    car = Vehicle.load().parameters
    axes = figure.add_subplot()
    across = np.linspace(0.0, 1.0, 100)
    half = np.linspace(0.0, math.pi, 200)
    style.theory(axes, np.cos(half), np.sin(half), "mu g")
    for mu, colour in zip(dict.fromkeys(column(splits, "mu").tolist()), style.COLOURS, strict=False):
        limiter = FrictionLimiter(car, mu)
        for most, exponent, label in (
            (-limiter.braking, limiter.braking_exponent, f"limiter, mu {mu:g}"),
            (limiter.accelerating, limiter.exponent, ""),
        ):
            allowed = np.array([most * longitudinal_share(share, exponent) for share in across]) / (mu * car.gravity)
            style.theory(axes, allowed, across, label, colour=colour)
        rows = [row for row in splits if row["mu"] == mu and not row["reason"]]
        label = f"first slide, mu {mu:g}"
        along, aside = column(rows, "longitudinal_share"), column(rows, "lateral_share")
        style.measured(axes, along, aside, label, colour=colour)
    axes.set_aspect("equal")
    style.finish(axes, "acceleration along / mu g [-], braking negative", "across / mu g [-]", legend=False)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right center")
