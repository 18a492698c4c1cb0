"""An experiment of the friction lab that measures nothing, in no time; the settings' seed says how it fares."""

import math
import os
import time

import numpy as np

from fg_mujoco.lab.experiment import Figure, Section, no_number
from fg_mujoco.pictures.pages.figure_kit import column, finish, measured, theory

FINE, FAILS, DIES, SLOW = range(4)
COUNT = 6
BAD = 3  # the cell at which it fails or dies


class Squares:
    name = "squares"
    title = "Squares of <numbers>"

    def cells(self, settings):
        count = 3 if settings.quick else COUNT
        return [{"number": number, "fares": settings.seed} for number in range(count)]

    def measure(self, cell):
        number, fares = cell["number"], cell["fares"]
        if fares == FAILS and number == BAD:
            raise ValueError("no such\nsquare")
        if fares == DIES and number == BAD:
            os._exit(3)
        if fares == SLOW:
            time.sleep(0.2)
        row = {"side_m": np.float64(number), "area_m2": np.int64(number**2), "even": np.bool_(number % 2 == 0)}
        return {"areas": [row],
                "roots": [{"side_m": float(number), "root": math.sqrt(number), "reason": ""}] if number
                else [{"side_m": 0.0, **no_number("nothing there", "root")}]}  # fmt: skip

    def section(self, tables):
        areas = tables["areas"]

        def draw(figure):
            axes = figure.add_subplot()
            theory(axes, [0, 5], [0, 25], "a & b")
            measured(axes, column(areas, "side_m"), column(areas, "area_m2"), "areas")
            finish(axes, "side [m]", "area [m²]")

        def draw_much(figure):
            measured(figure.add_subplot(), np.linspace(0.0, 1.0, 9000), np.random.default_rng(0).random(9000))

        return Section(sentences=(f"{len(areas)} squares, the greatest of {areas[-1]['area_m2']} m².",
                                  "2 < 3 & so on."),
                       figures=(Figure(name="areas", caption="Area < side.", draw=draw),
                                Figure(name="again", caption="The same.", draw=draw),
                                Figure(name="much", caption="Many points.", draw=draw_much)),
                       columns={"areas": ("side_m", "area_m2", "even"), "roots": ("side_m", "root", "reason")},
                       expected=(("greatest area", "25 m²", f"{areas[-1]['area_m2']} m²"),))  # fmt: skip


EXPERIMENT = Squares()
