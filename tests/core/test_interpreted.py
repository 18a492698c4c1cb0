"""With NUMBA_DISABLE_JIT=1 Python runs kernels, and they give the bits of compiled ones."""

import json
import os
import subprocess
import sys

import pytest

PLANNERS = (
    "follow_the_gap", "disparity_extender[guidance=false]", "wall_follow[guidance=false]", "pure_pursuit",
    "overtaker[guidance=false]",
)  # fmt: skip
"""Without gap_finder, which the race with an obstacle has. Guidance takes Python longest, and is the same for all."""

RACES = f"""
import numpy as np
import fg_mujoco as fg
angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)  # small: Python looks all over a course for long
circle = np.column_stack([2.0 * np.cos(angles), 2.0 * np.sin(angles), np.full((60, 2), 0.8)])
np.savetxt("circle.csv", circle, delimiter=",", header="x_m, y_m, w_tr_right_m, w_tr_left_m")
for planner in {PLANNERS!r}:
    print(planner, fg.race("circle.csv", planner, laps=1, time_limit=0.05, max_speed=3.0).trajectory_sha256)
crossing = fg.race("scene:crossing_box:0", "gap_finder", laps=1, time_limit=0.05, max_speed=3.0)
print("obstacle", crossing.trajectory_sha256)
print("contact", fg.race("circle.csv", "pure_pursuit", laps=1, time_limit=0.05, tires="contact").trajectory_sha256)
print("slides", fg.race("circle.csv", "pure_pursuit", laps=1, time_limit=0.2, mu=0.2, planner_mu=1.0).trajectory_sha256)
worlds = fg.rollout("circle.csv", "pure_pursuit", n=2, laps=1, time_limit=0.05, randomize={{"mu": (0.5, 1.0)}}).worlds
print("rollout", worlds.tobytes().hex())
"""

ARITHMETIC = """
import json, math
import numpy as np
from fg_mujoco.compiled.array_table import ArrayTable, matrix, numbers, rows, short_numbers
from fg_mujoco.compiled.kernels import inlined, kernel
from fg_mujoco.vehicle.arithmetic import add_scaled_4, unlikely

ROW = np.dtype([("size", np.float64), ("at", np.float64, (2,)), ("inner", [("count", np.int32)])])

@kernel
def quotients(a, b, out):
    for i in range(len(a)):
        for j in range(len(b)):
            out[i, j, 0], out[i, j, 1], out[i, j, 2] = a[i] / b[j], a[i] // b[j], a[i] % b[j]
            kept = 1.0
            kept /= b[j] - b[j]
            out[i, j, 3] = kept

@kernel
def of_math(a, out):
    for i in range(len(a)):
        x = a[i]
        out[i, 0], out[i, 1], out[i, 2] = math.sqrt(x), math.sin(x), math.exp(x)
        out[i, 3], out[i, 4], out[i, 5] = math.hypot(x, 0.3), math.atan2(x, -0.0), math.asin(x)
        out[i, 6], out[i, 7], out[i, 8] = x**2, x**3, x**5
        out[i, 9], out[i, 10] = math.floor(x), int(x)
        out[i, 11], out[i, 12] = min(x, 1.0), max(0.5, x)
        out[i, 13], out[i, 14] = math.tan(x), abs(x) ** 0.3
        out[i, 15] = round(x)

@kernel
def whole(a, b):
    return a // b, a % b, a / b

@kernel
def narrow(small, out):
    for i in range(len(small)):
        out[i] = small[i] * small[i] + 3 * small[i]
        small[i] = small[i] - 1

@inlined
def seen(row):
    return unlikely(row.size > 1.0)

@kernel
def of_records(rows):
    for row in range(len(rows)):
        each = rows[row]
        if seen(each):
            each.size = each.at[0] / each.at[1]
        each.at[1] += 1.0
        each.inner.count += 2
        rows[row].inner.count *= 3

@kernel
def of_table(table):
    numbers(table[0])[1], matrix(table[1])[1, 0] = 5.0, 6.0
    short_numbers(table[2])[0] += 7
    rows(table[3], ROW)[0].size = 2.5
    add_scaled_4(numbers(table[0]), 0, 4, 0.1)
    return len(numbers(table[4]))

answers, draw = {}, np.random.default_rng(0)
a = np.array([0.0, -0.0, 1.5, -2.5, math.inf, -math.inf, math.nan, 7.25])
out = np.zeros((len(a), len(a), 4))
quotients(a, a, out)
out[np.isnan(out)] = np.nan  # of either sign
answers |= {f"quotients {i}": out[..., i].tobytes().hex() for i in range(4)}
odd, drawn = np.append(a, [710.0, 1e300, -0.5, 2.5]), draw.normal(scale=3.0, size=3000)
for name, values in {"odd": odd, "drawn": drawn}.items():
    out = np.zeros((len(values), 16))
    of_math(values, out)
    out[np.isnan(out)] = np.nan
    for i, column in enumerate(out.T):
        answers[f"{name} {i}"] = column.tobytes().hex()
answers["whole"] = [repr(whole(x, y)) for x in (7, -7, 0) for y in (2, -2, 0)]
small = [np.arange(300, 305, dtype=np.uint16) * 100, np.array([0, 200], np.uint8), np.array([0, -100], np.int8)]
for each in small:
    out = np.zeros(len(each), np.int64)
    narrow(each, out)
    answers[str(each.dtype)] = [out.tolist(), each.tolist()]
table = np.zeros(3, ROW)
table["size"], table["at"] = [0.5, 2.0, 3.0], [[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0]]
of_records(table)
answers["records"] = repr(table.tolist())
arrays = {"a": np.arange(8.0), "b": np.zeros((2, 2)), "c": np.zeros(1, np.int32), "d": np.zeros(1, ROW)}
count = of_table(ArrayTable(("a", "b", "c", "d", "e"), arrays).rows)
answers["table"] = [count, repr([array.tolist() for array in arrays.values()])]
print(json.dumps(answers))
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

RAISES_WITHIN_C = """
import fg_mujoco as fg
from fg_mujoco.simulation import compiled_tick

def fail(*_):
    raise RuntimeError("in a kernel that C calls")

compiled_tick.place_obstacles = fail
try:
    fg.race("oval", "pure_pursuit", laps=1, time_limit=0.1)
except RuntimeError as error:
    print(error)
"""


def run(code, tmp_path, interpreted):
    program = tmp_path / "program.py"
    program.write_text(code)
    setting = {"NUMBA_DISABLE_JIT": "1"} if interpreted else {}  # compiled kernels of other settings are kept apart
    environment = {**os.environ, **setting}
    done = subprocess.run([sys.executable, str(program)], env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not interpreted or done.stderr == ""
    return done.stdout


def test_races_have_the_same_bits(tmp_path):
    interpreted, compiled = (run(RACES, tmp_path, mode).splitlines() for mode in (True, False))
    assert len(compiled) == len(PLANNERS) + 4 and interpreted == compiled


def test_arithmetic_has_the_same_bits(tmp_path):
    compiled, interpreted = (json.loads(run(ARITHMETIC, tmp_path, mode)) for mode in (False, True))
    assert compiled.keys() == interpreted.keys()
    for name, answer in compiled.items():
        assert interpreted[name] == answer, name


def test_kernels_keep_their_lines(tmp_path):
    assert run(LINES, tmp_path, True) == "[('<module>', 18), ('outer', 8), ('inner', 14)]\n"


def test_what_a_kernel_raises_that_c_calls_is_raised(tmp_path):
    assert "in a kernel that C calls" in run(RAISES_WITHIN_C, tmp_path, True)


def test_the_command_runs():
    command = [sys.executable, "-m", "fg_mujoco", "race", "--controller", "pure_pursuit", "--time-limit", "0.05"]
    done = subprocess.run(command, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True)
    assert "oval, pure_pursuit, f1tenth" in done.stdout and done.stderr == ""


@pytest.mark.parametrize("value", ("0", ""))
def test_other_values_leave_kernels_compiled(value):
    code = "from fg_mujoco.compiled.array_table import numbers; print(type(numbers))"
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "NUMBA_DISABLE_JIT": value}, capture_output=True, text=True
    )
    assert "_Kernel" in done.stdout
