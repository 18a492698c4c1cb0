"""With NUMBA_DISABLE_JIT=1 Python runs kernels, and a debugger can step through them."""

import json
import os
import subprocess
import sys

import pytest

RACES = """
import json
import numpy as np
import fg_mujoco as fg
angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)  # small: Python looks all over a course for long
circle = np.column_stack([2.0 * np.cos(angles), 2.0 * np.sin(angles), np.full((60, 2), 0.8)])
np.savetxt("circle.csv", circle, delimiter=",", header="x_m, y_m, w_tr_right_m, w_tr_left_m")
short = {"laps": 1, "time_limit": 0.05, "max_speed": 3.0}
results = [
    fg.race("scene:crossing_box:0", "gap_finder[assist=safe]", **short),
    fg.race("circle.csv", "pure_pursuit", laps=1, time_limit=0.2, mu=0.2, planner_mu=1.0),  # it slides
]
ends = [each.car.telemetry[-1].tolist() for each in results]
print(json.dumps(ends))
"""

KERNELS = """
import math
import numpy as np
from fg_mujoco.compiled.array_table import ArrayTable, numbers, rows
from fg_mujoco.compiled.kernels import kernel

ROW = np.dtype([("size", np.float64), ("at", np.float64, (2,)), ("inner", [("count", np.int32)])])

@kernel
def divides(x, values, out):
    out[0], out[1], out[2] = 1.0 / x, values[0] / values[1], math.sqrt(x - 1.0)
    out[3] = math.cos(x) / (math.hypot(x, 0.0))

@kernel
def narrow(small):
    small[0] = small[0] - 1
    return small[1] * small[1], small[2:][0] * small[1]

@kernel
def of_records(records):
    for row in range(len(records)):
        each = records[row]
        each.size = each.at[0] / each.at[1]
        each.at[1] += 1.0
        records[row].inner.count += 2

@kernel
def of_table(table):
    numbers(table[0])[1] = 5.0
    rows(table[1], ROW)[0].size = 2.5

out = np.zeros(4)
divides(0.0, np.zeros(2), out)
assert np.array_equal(out, [math.inf, math.nan, math.nan, math.inf], equal_nan=True), out
small = np.array([7, 60000, 50000], np.uint16)
assert narrow(small) == (60000**2, 60000 * 50000) and small[0] == 6
records = np.zeros(2, ROW)
records["at"] = [[1.0, 0.0], [3.0, 2.0]]
of_records(records)
assert repr(records.tolist()) == repr([(math.inf, np.array([1.0, 1.0]), (2,)), (1.5, np.array([3.0, 3.0]), (2,))])
arrays = {"a": np.zeros(2), "b": np.zeros(1, ROW)}
of_table(ArrayTable(("a", "b"), arrays).rows)
assert arrays["a"].tolist() == [0.0, 5.0] and arrays["b"]["size"].tolist() == [2.5]
"""

LINES = """
import numpy as np
from fg_mujoco.compiled.kernels import kernel

@kernel
def outer(values):
    # a comment
    return inner(values, 5) / 2.0

@kernel
def inner(values, place):
    if len(values) > 0:
        return (
            values[place])
    return 0.0

try:
    outer(np.zeros(2))
except IndexError as error:
    import traceback
    frames = traceback.extract_tb(error.__traceback__)
    print([(frame.name, frame.lineno) for frame in frames if frame.filename == __file__])
"""


def run(code, tmp_path, interpreted=True):
    program = tmp_path / "program.py"
    program.write_text(code)
    environment = {**os.environ, **({"NUMBA_DISABLE_JIT": "1"} if interpreted else {})}
    done = subprocess.run([sys.executable, str(program)], env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not interpreted or done.stderr == ""
    return done.stdout


def test_races_end_where_compiled_ones_end(tmp_path):
    ends, compiled = (json.loads(run(RACES, tmp_path, mode)) for mode in (True, False))
    assert ends == [pytest.approx(each, rel=1e-6, abs=1e-6, nan_ok=True) for each in compiled]


def test_divisions_narrow_numbers_and_records_are_those_of_kernels(tmp_path):
    run(KERNELS, tmp_path, interpreted=True)
    run(KERNELS, tmp_path, interpreted=False)


def test_kernels_keep_their_lines(tmp_path):
    assert run(LINES, tmp_path) == "[('<module>', 18), ('outer', 8), ('inner', 14)]\n"
