"""A kernel is compiled again where anything changes that its machine code depends on, and only there."""

import importlib
import linecache
import sys

import pytest

from fg_mujoco.compiled.kernel_keys import identity

OTHER = """
from fg_mujoco.compiled.kernels import kernel, inlined
SCALE = 2.0
def unused(x):
    return x
@inlined
def half(x):
    return 0.5 * x
@kernel
def scaled(x):
    return SCALE * half(x)
"""
SOURCE = '''
"""A module."""
import enum
import math
from typing import NamedTuple
import numpy as np
from numba import njit
import other_module
from fg_mujoco.compiled.kernels import inlined, kernel, numbas
from other_module import scaled
GAIN = 3.0
UNUSED = 1.0
TABLE = np.array([1.0, 2.0])
PAIR = (1, 2.0)
ROW = np.dtype([("a", np.float64), ("b", np.int64)])
class Pair(NamedTuple):
    first: float
    second: float
class Side(enum.IntEnum):
    LEFT = 1
    RIGHT = 2
@numbas(None)
def array_at():
    from numba import carray
    return carray
@njit
def of_others(x):
    return x + 1.0
def maker(factor):
    @kernel
    def product(x):
        return factor * x
    return product
doubled = maker(2.0)
def plain(x):
    """Not compiled."""
    return 2 * x
@kernel
def refuses(x):
    if x < 0.0:
        raise ValueError("negative")
    return x
@kernel
def turns(x, share=0.5):
    """Return something."""
    if x < share:
        return odd(x)
    return x
@kernel
def odd(x):
    return turns(x - 1.0)
@kernel
def found(x):
    """Return a number."""
    # a comment
    total = GAIN * scaled(x) + other_module.SCALE + TABLE[0] + PAIR[1] + doubled(x) + of_others(x) + turns(x)
    pair = Pair(x, total)
    if x == Side.LEFT:
        total += np.empty(2, ROW)[0].a + math.sqrt(pair.first)
    return total + array_at(x)
@kernel
def raises(x):
    return refuses(x)
'''


@pytest.fixture
def key(tmp_path, monkeypatch):
    """Writes both modules and returns the identities of the kernels `found` and `raises`."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def keys(source=SOURCE, other=OTHER):
        for name, text in (("key_module", source), ("other_module", other)):
            (tmp_path / f"{name}.py").write_text(text)
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        linecache.clearcache()
        module = importlib.import_module("key_module")
        return identity(module.found.py_func), identity(module.raises.py_func)

    yield keys
    for name in ("key_module", "other_module"):
        sys.modules.pop(name, None)


CHANGES = {
    "a constant": ("GAIN = 3.0", "GAIN = 4.0"),
    "its sign of zero": ("GAIN = 3.0", "GAIN = -0.0"),
    "an array": ("[1.0, 2.0]", "[1.0, 3.0]"),
    "a field of a record": ('("b", np.int64)', '("c", np.int64)'),
    "the order of named fields": ("first: float\n    second: float", "second: float\n    first: float"),
    "a member of an enumeration": ("LEFT = 1", "LEFT = 3"),
    "its own code": ("total + array_at(x)", "total - array_at(x)"),
    "the name of an argument": ("def found(x):", "def found(x, y=1):"),
    "a function of numba's": ("return x + 1.0", "return x + 2.0"),
    "something of numba's": ("return carray", "return carray or 1"),
    "a closure": ("maker(2.0)", "maker(3.0)"),
    "what was a kernel": ("@kernel\ndef odd", "@inlined\ndef odd"),
    "what a name means": ("from other_module import scaled", "from other_module import half as scaled"),
}
CHANGES_OF_THE_OTHER = {
    "a constant of another module": ("SCALE = 2.0", "SCALE = 2.5"),
    "a kernel of another module": ("SCALE * half(x)", "SCALE / half(x)"),
    "what is written out": ("0.5 * x", "0.25 * x"),
}
NO_CHANGES = {
    "a docstring": ("Return a number.", "Return a number, which is less than another one, and a\n    second line."),
    "a docstring of a kernel that it calls": ("Return something.", "Return something\n\n    Else.\n    "),
    "a comment": ("# a comment", "# another comment\n    # of two lines"),
    "a constant that it does not read": ("UNUSED = 1.0", "UNUSED = 2.0"),
    "a function that it does not call": ("return 2 * x", "return 3 * x"),
}


def test_what_the_machine_code_depends_on_is_in_the_name(key):
    plain = key()[0]
    assert key()[0] == plain
    for change, (before, after) in CHANGES.items():
        assert SOURCE.count(before) == 1
        assert key(SOURCE.replace(before, after))[0] != plain, change
    for change, (before, after) in CHANGES_OF_THE_OTHER.items():
        assert OTHER.count(before) == 1
        assert key(other=OTHER.replace(before, after))[0] != plain, change


def test_nothing_else_is_in_the_name(key):
    plain = key()[0]
    for change, (before, after) in NO_CHANGES.items():
        assert SOURCE.count(before) == 1
        assert key(SOURCE.replace(before, after).replace('"""Not compiled."""', ""))[0] == plain, change


def test_lines_are_in_the_name_only_of_kernels_that_raise(key):
    found, raises = key()
    assert key("\n\n" + SOURCE)[0] == found
    assert key("\n\n" + SOURCE)[1] != raises, "its traceback names the line"


def test_a_constant_that_is_set_at_run_time_is_in_the_name(key):
    before = key()[0]
    module = sys.modules["key_module"]
    module.GAIN = 5.0
    assert identity(module.found.py_func) != before
    module.GAIN = 3.0
    assert identity(module.found.py_func) == before
