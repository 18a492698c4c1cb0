"""The tutorial notebook: its cells run from top to bottom in an empty folder, and what its text says is so."""

import ast
import json
import os
import re
import sys
from pathlib import Path

import pytest

import fg_mujoco as fg
from fg_mujoco.vehicle.vehicle import Vehicle

NOTEBOOK = Path(__file__).parents[2] / "docs" / "tutorial.ipynb"
if not NOTEBOOK.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)

CELLS = json.loads(NOTEBOOK.read_text("utf-8"))["cells"]
MAGIC = re.compile(r"%%writefile (\S+)\n")


def run_cell(code, names):
    """Run a cell as Jupyter does, and return the value of its last line, if that is an expression."""
    if magic := MAGIC.match(code):
        Path(magic[1]).write_text(code[magic.end() :] + "\n", "utf-8")
        return None
    body = ast.parse(code).body
    last = body.pop() if isinstance(body[-1], ast.Expr) else None
    exec(compile(ast.Module(body, []), "cell", "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), "cell", "eval"), names)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The names after the last cell, what each cell printed, and its value, by the cell's id."""
    folder, here = tmp_path_factory.mktemp("tutorial"), os.getcwd()
    names, printed, values = {"__name__": "__main__"}, {}, {}
    path, modules = list(sys.path), set(sys.modules)
    patch = pytest.MonkeyPatch()
    os.chdir(folder)
    sys.path.insert(0, "")  # as in a notebook
    try:
        for cell in CELLS:
            if cell["cell_type"] == "code":
                said = []
                patch.setitem(names, "print", lambda *words, said=said: said.append(" ".join(map(str, words))))
                values[cell["id"]] = run_cell("".join(cell["source"]), names)
                printed[cell["id"]] = said
    finally:
        os.chdir(here)
        sys.path[:] = path
        for name in set(sys.modules) - modules:
            if name == "my_planner":
                del sys.modules[name]
    return names, printed, values


def test_no_output_is_kept_and_each_cell_has_a_name():
    assert [cell["id"] for cell in CELLS if cell.get("outputs") or cell.get("execution_count")] == []
    assert len({cell["id"] for cell in CELLS}) == len(CELLS)
    assert NOTEBOOK.stat().st_size < 20_000


def test_the_first_planner_crashes_into_the_left_wall(ran):
    names, printed, values = ran
    first = names["first"]
    assert first.car.end_reason == "crash" and first.car.crash.into == "left wall"
    assert printed["where"] == ["crash", str(first.car.crash)]
    assert "crashed here" in values["race-first"]._repr_html_()
    x, y = first.car.column("x_m")[-1], first.car.column("y_m")[-1]
    track = names["track"]
    here = track.project([(x, y)])[0][0]
    ahead = abs(track.curvature[track.arc_length > here][:10])
    assert ahead.max() > 0.1  # "where the left curve begins"


def test_the_scan_shows_why(ran):
    names, printed, values = ran
    scan, farthest, left = names["scan"], names["farthest"], names["left"]
    assert "<svg" in values["scan"]._repr_html_()
    assert scan.ranges[farthest] > 3.0 and scan.ranges[left] < 0.8
    assert printed["goal"][0].startswith(f"farthest: {scan.ranges[farthest]:.1f} m")
    beside = scan.bearings[farthest] + 0.1  # a little further to the left there is the corner of the wall
    corner = scan.ranges[abs(scan.bearings - beside).argmin()]
    assert corner < 0.6 * scan.ranges[farthest]
    assert values["call"].steering_angle == scan.bearings[farthest] >= 0.0


def test_the_second_planner_laps(ran):
    names, _, values = ran
    second = names["second"]
    assert second.car.finished and second.car.collisions_wall == 0 and second.car.laps_completed == 2
    assert "no collision" in values["race-second"]._repr_html_()
    assert 0.15 < second.car.slide_time_fraction < 0.25  # "about a fifth"


def test_the_comparison_is_as_the_text_says(ran):
    cells = {(cell["planner"], cell["course"]): cell for cell in ran[0]["comparison"].cells if cell["course"] != "all"}
    assert all(cells["gap_finder", course]["successes"] == 1 for course in ("oval", "chicanes", "hairpins"))
    mine = {course: cell["successes"] for (planner, course), cell in cells.items() if "Deepest" in planner}
    assert mine == {"oval": 1, "chicanes": 1, "hairpins": 0}
    for course in ("oval", "chicanes"):
        mine, other = (cells[planner, course]["best_lap_s"] for planner in ("my_planner.py:Deepest", "gap_finder"))
        assert other < mine


def test_friction_does_what_the_text_says(ran):
    names, printed, _ = ran
    assert [", hit the " in line for line in printed["slippery"]] == [True, True]
    honest = names["honest"]
    car = Vehicle.load("f1tenth").parameters
    assert honest.car.finished and honest.car.mu == 0.5
    assert honest.car.planner_mu == pytest.approx(
        0.5 * min(car.front_peak, car.rear_peak) / max(car.front_peak, car.rear_peak)
    )
    dry = fg.race(names["track"], "gap_finder", laps=2)
    assert f"{dry.car.mu:.2f}" == "1.05" and dry.car.mean_speed_m_s > honest.car.mean_speed_m_s
