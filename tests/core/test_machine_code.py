"""Kernels on disk are called without numba, as numba calls them, and only for arguments of the types they are for."""

import ast
import json
import os
import pickle
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.compiled.kernels import cache_folder
from fg_mujoco.compiled.machine_code import kinds, text_of

Pair = namedtuple("Pair", ["first", "second"])
Other = namedtuple("Other", ["first", "second"])
ROW = np.dtype([("a", float), ("b", np.int64)])

PROGRAM = """
import json, sys
import numpy as np
from collections import namedtuple
from fg_mujoco.compiled.kernels import kernel
Pair = namedtuple("Pair", ["first", "second"])
ROW = np.dtype([("a", float), ("b", np.int64)])
@kernel
def total(values):
    found = 0.0
    for value in values:
        found += value
    return found
@kernel
def halves(values, share=0.5):
    return share * values, values[0]
@kernel
def both(pair):
    return pair.first[0] + pair.second
@kernel
def rows(of):
    of[0].a += 1.0
    return of[0].a
@kernel
def refuses(x):
    if x > 1.0:
        raise ValueError("too large", x)
    return x
square, table = np.arange(6.0).reshape(2, 3), np.zeros(2, ROW)
answers = [
    total(np.arange(3.0)), total(np.arange(6.0)[::2]), total(np.arange(3)), total((1.0, 2.0)),
    [part.tolist() if hasattr(part, "tolist") else part for part in halves(np.arange(2.0))],
    halves(np.arange(2.0), 2.0)[0].tolist(), halves(values=np.arange(2.0), share=3.0)[0].tolist(),
    both(Pair(square[0], 2)), both(Pair(second=1.5, first=square[1])), rows(table), rows(table),
]
without = "numba" not in sys.modules
for value in (0.5, 2.0):
    try:
        answers.append(refuses(value))
    except ValueError as error:
        answers.append(list(error.args))
try:
    refuses("text")
except Exception as error:
    answers.append("numba.core.errors.TypingError" in str(type(error)))
print(json.dumps([without, answers]))
"""
ANSWERS = [
    3.0, 6.0, 3.0, 3.0, [[0.0, 0.5], 0.0], [0.0, 2.0], [0.0, 3.0], 2.0, 4.5, 1.0, 2.0, 0.5, ["too large", 2.0], True,
]  # fmt: skip


def run(path, cache):
    environment = os.environ | {"XDG_CACHE_HOME": str(cache), "FG_MUJOCO_COMPILING": "in tests"}
    done = subprocess.run([sys.executable, str(path)], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """A program, and a cache that its kernels are in."""
    folder = tmp_path_factory.mktemp("program")
    path = folder / "program.py"
    path.write_text(PROGRAM)
    cache = folder / "cache"
    assert run(path, cache) == [False, ANSWERS]
    return path, cache


@pytest.mark.slow
def test_kernels_on_disk_answer_without_numba_as_with_it(program):
    assert run(*program) == [True, ANSWERS]


@pytest.mark.slow
def test_what_cannot_be_loaded_is_left_to_numba(program):
    path, cache = program
    broken = path.with_name("broken.py")
    broken.write_text(PROGRAM.replace("import json, sys", "import json, sys, broken_code"))
    path.with_name("broken_code.py").write_text(
        "import fg_mujoco.compiled.machine_code as code\n"
        "def refuse(*_): raise LookupError\ncode.MachineCode.load = refuse\n"
    )
    for _ in range(2):
        assert run(broken, cache) == [False, ANSWERS]


def test_arguments_of_other_types_are_of_other_kinds_and_of_one_type_of_one():
    whole = np.zeros(4)
    for first, second in (
        (np.zeros(2), np.zeros(2, np.float32)), (np.zeros(2), np.zeros((2, 1))), (whole, whole[::2]),
        (np.zeros((2, 3)), np.zeros((3, 2)).T), (np.zeros(2), 0.0), (np.zeros(()), np.float64(0.0)), (1, 1.0),
        (True, 1), (1, None), (np.int64(1), np.int32(1)), ((1, 2), (1, 2.0)), ((1, 2), (1, 2, 3)),
        ((1, 2), Pair(1, 2)), (Pair(1, 2), Other(1, 2)), (Pair(1, 2), Pair(1.0, 2)),
        (np.zeros(2, ROW), np.zeros(2, [("a", float), ("c", np.int64)])), (np.zeros(2, ROW), np.zeros(2, ROW)[0]),
        (np.zeros(2), np.frombuffer(bytes(16))), (np.zeros(2), np.zeros(2, ">f8")),
    ):  # fmt: skip
        assert kinds([first]) != kinds([second]) and text_of(kinds([first])) != text_of(kinds([second]))
    for value in (1.0, 3, True, None, np.float64(1.0), np.zeros(2), np.zeros(2, ROW)[0], (1, Pair(2.0, 3))):
        again = pickle.loads(pickle.dumps(value))
        assert text_of(kinds([value])) == text_of(kinds([again])) is not None
    assert text_of(kinds([whole[:2]])) == text_of(kinds([whole])), "who owns the memory does not matter"
    of_one_row, of_two = np.zeros((1, 3)), np.zeros((2, 3))
    assert text_of(kinds([of_one_row])) == text_of(kinds([of_two])), "and both are of one type to numba"


@pytest.mark.slow
def test_a_command_starts_without_numba_once_its_kernels_are_on_disk():
    code = "import sys, fg_mujoco.cli.main as m; m.main(['race', '--laps', '1', '--time-limit', '1', '--json']); "
    code += "print([name for name in ('numba', 'glfw.library', 'numpy.ma') if name in sys.modules], file=sys.stderr)"
    for _ in range(2):  # the first may compile
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr.strip().splitlines()[-1] == "[]"
    assert cache_folder().is_dir()


def test_every_public_name_is_where_type_checkers_look_for_it():
    tree = ast.parse(Path(fg.__file__).read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    typed = {name.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for name in node.names}
    homes = {name: home.partition(":")[0] for name, home in fg._HOMES.items()}
    assert {name: f"fg_mujoco.{module.removeprefix('fg_mujoco.')}" for name, module in typed.items()} == homes
    assert {*typed, "__version__"} == set(fg.__all__)
    assert set(fg.__all__) <= set(dir(fg)) and fg.__version__
