"""A planner that is wrong about the friction: what the experiment measures, and what it says of it."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from cases import each
from fg_mujoco.lab import mismatch
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.mismatch import EXPERIMENT
from fg_mujoco.vehicle.tire_slip import BRISTLES_SLIDE
from fg_mujoco.vehicle.vehicle import Vehicle


@pytest.fixture(scope="module")
def tables():
    cells = json.loads(json.dumps(EXPERIMENT.cells(LabSettings(quick=True))))
    return {"laps": [row for cell in cells for row in EXPERIMENT.measure(cell)["laps"]]}


def test_believing_in_less_friction_is_slower_and_in_more_slides(tables):
    # measured on the oval at .7, 1 and 1.3: best laps of 10.15, 8.57, 8.48 s; the last slides by up to 5.1 m/s
    careful, right, bold = tables["laps"]
    assert careful["best_lap_s"] > 1.1 * right["best_lap_s"] > 1.1 * bold["best_lap_s"]
    assert careful["max_slide_m_s"] < right["max_slide_m_s"] < BRISTLES_SLIDE < bold["max_slide_m_s"]
    assert careful["sliding_share"] == right["sliding_share"] == 0.0 < bold["sliding_share"]
    assert right["planner_mu"] == right["mu"] == Vehicle.load().nominal_mu


@each("threshold", [0.95, 1.1, 1.234])
def test_knee_is_found_where_the_tires_begin_to_slide(monkeypatch, threshold):
    monkeypatch.setattr(
        mismatch, "drive_believing", lambda *cell: SimpleNamespace(slide_time_fraction=0.1 * (cell[2] > threshold))
    )
    (row,) = EXPERIMENT.measure({"track": "oval", "mu": 0.6, "ratio": None})["knee"]
    assert row["holds_at"] <= threshold <= row["slides_at"] and row["slides_at"] - row["holds_at"] <= 0.02
    assert row["sliding_from"] == pytest.approx(threshold, abs=0.01) and row["reason"] == ""


@each(("slide", "reason"), [(0.0, "slides at no ratio up to 1.5"), (1.0, "slides at 0.9")])
def test_knee_that_is_not_there_is_nan_with_a_reason(monkeypatch, slide, reason):
    monkeypatch.setattr(mismatch, "drive_believing", lambda *_: SimpleNamespace(slide_time_fraction=slide))
    (row,) = EXPERIMENT.measure({"track": "oval", "mu": 0.6, "ratio": None})["knee"]
    assert math.isnan(row["sliding_from"]) and row["reason"] == reason


@each(
    ("ratios", "said"),
    [([1.18, 1.182], "+18 %"), ([0.998, 1.002], "+0 %"), ([1.18, math.nan, 1.3], "+18 to +30 %"), ([], "no lap")],
)
def test_a_change_of_lap_times_is_one_number_where_both_ends_read_alike(ratios, said):
    assert mismatch._change(np.array(ratios)) == said


def test_a_slide_of_zero_is_in_the_picture():
    from matplotlib.figure import Figure

    rows = [
        {"track": "oval", "mu": 1.0, "ratio": ratio, "best_lap_s": 9.0, "max_slide_m_s": slide, "sliding_share": 0.0,
         "crashed": False}
        for ratio, slide in ((0.7, 0.0), (1.0, 0.001), (1.3, 5.0))
    ]  # fmt: skip
    figure = Figure()
    mismatch._draw(figure, rows)
    slides = figure.axes[1]
    (line,) = [each for each in slides.lines if len(each.get_xdata()) == 3]
    heights = slides.transData.transform(np.column_stack((line.get_xdata(), line.get_ydata())))[:, 1]
    low, high = slides.get_window_extent().y0, slides.get_window_extent().y1
    assert np.isfinite(heights).all() and low - 1e-6 <= heights[0] < heights[1] < heights[2] <= high
