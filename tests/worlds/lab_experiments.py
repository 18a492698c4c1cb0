"""An experiment of the friction lab that measures nothing, in no time; the settings' mu says how it fares."""

import math
import os
import time

import numpy as np

from fg_mujoco.lab.experiment import LabSettings, Section
from fg_mujoco.pictures.pages.figure_kit import column, finish, measured, theory

FINE, FAILS, DIES, SLOW = ({"mus": (number / 10,)} for number in range(1, 5))
COUNT = 6
BAD = 3  # the cell at which it fails or dies


class Squares:
    name = "squares"
    title = "Squares of <numbers>"
    uses = ("mu",)

    def cells(self, settings: LabSettings):
        return [{"number": number} for number in range(COUNT)]

    def measure(self, cell, settings):
        number, fares = cell["number"], {"mus": settings.mus}
        if fares == FAILS and number == BAD:
            raise ValueError("no such\nsquare")
        if fares == DIES and number == BAD:
            os._exit(3)
        if fares == SLOW:
            time.sleep(0.2)
        return [{"side_m": np.float64(number), "area_m2": np.int64(number**2), "even": np.bool_(number % 2 == 0),
                 "root": math.sqrt(number) if number else math.nan}]  # fmt: skip

    def section(self, rows, settings):
        def draw(figure):
            axes = figure.add_subplot()
            theory(axes, [0, 5], [0, 25], "a & b")
            measured(axes, column(rows, "side_m"), column(rows, "area_m2"), "areas")
            finish(axes, "side [m]", "area [m²]")

        columns = {"side": "side_m", "area": "area_m2", "even": "even", "root": "root"}
        sentences = (f"{len(rows)} squares, the greatest of {rows[-1]['area_m2']} m².", "2 < 3 & so on.")
        return Section(sentences=sentences, columns=columns, draw=draw)


EXPERIMENT = Squares()
