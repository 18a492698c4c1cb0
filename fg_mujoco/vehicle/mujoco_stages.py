"""MuJoCo's stages of a physics step, and the arrays of its models and data, for kernels.

A kernel gets a mujoco.MjModel and a mujoco.MjData as their addresses (`model._address`), and calls MuJoCo's own
functions. The arrays of both are found by where the structures keep their addresses; that is looked up once in this
process, in a model of two joints, because it depends on how MuJoCo was built.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding
import mujoco
import numpy as np
from numpy.typing import NDArray

from ..compiled.array_table import carray, pointer
from ..compiled.interpreted import word_at
from ..compiled.kernels import kernel, library_function, numbas
from ..errors import EngineError


@cache
def library_path() -> str:
    """Return the MuJoCo library that the Python package uses; EngineError: there is none beside it."""
    folder = Path(mujoco.__file__).parent
    for pattern in ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll"):
        for path in sorted(folder.glob(pattern)):
            return str(path)
    raise EngineError(f"there is no MuJoCo library in {folder}; accepted: the package `mujoco` as pip installs it")


llvmlite.binding.load_library_permanently(library_path())  # so that kernels, compiled or read from disk, find it
# The package has MuJoCo ask for the time some fifty times a tick, for MjData.timer, which nobody reads.
ctypes.c_void_p.in_dll(ctypes.CDLL(library_path()), "mjcb_time").value = None


def _function(name: str, result: str, *arguments: str) -> Any:
    """Return a function of MuJoCo as kernels call it, by the names of numba's types."""
    return library_function(library_path(), name, result, *arguments)


def _stage(name: str) -> Any:
    return _function(name, "void", "uintp", "uintp")


step = _stage("mj_step")
check_positions = _stage("mj_checkPos")
check_velocities = _stage("mj_checkVel")
check_accelerations = _stage("mj_checkAcc")
kinematics = _stage("mj_kinematics")
mass_centers = _stage("mj_comPos")
cameras_and_lights = _stage("mj_camlight")
tendons = _stage("mj_tendon")
make_inertia = _stage("mj_makeM")
find_contacts = _stage("mj_collision")
make_constraints = _stage("mj_makeConstraint")
make_islands = _stage("mj_island")
project_constraints = _stage("mj_projectConstraint")
transmissions = _stage("mj_transmission")
stage_velocity = _stage("mj_fwdVelocity")
stage_actuation = _stage("mj_fwdActuation")
stage_acceleration = _stage("mj_fwdAcceleration")
stage_constraint = _stage("mj_fwdConstraint")
sensors_of_position = _stage("mj_sensorPos")
sensors_of_velocity = _stage("mj_sensorVel")
body_accelerations = _stage("mj_rnePostConstraint")  # the sensors' own call believes those of mj_forward to be new
sensors_of_acceleration = _stage("mj_sensorAcc")
factor_inertia = _stage("mj_factorM")
advance = _stage("mj_Euler")
reset = _stage("mj_resetData")
set_state = _function("mj_setState", "void", "uintp", "uintp", "uintp", "int32")
get_state = _function("mj_getState", "void", "uintp", "uintp", "uintp", "int32")
solve_inertia = _function("mj_solveM", "void", "uintp", "uintp", "uintp", "uintp", "int32")
read_control = _function("mj_readCtrl", "uintp", "uintp", "uintp", "int32", "float64", "uintp", "int32")


class Fields(NamedTuple):
    """Offsets of the arrays' addresses in the structures, in bytes."""

    # of mjModel
    dof_damping: int
    dof_dampingpoly: int
    actuator_gainprm: int
    actuator_biasprm: int
    actuator_delay: int
    actuator_forcerange: int
    pair_friction: int
    # of mjData
    qpos: int
    qvel: int
    ctrl: int
    userdata: int
    sensordata: int
    mocap_pos: int
    xpos: int
    xmat: int
    cdof: int
    subtree_com: int
    inertia: int
    inertia_factor: int
    inverse_diagonal: int
    qfrc_passive: int
    qfrc_smooth: int
    qfrc_constraint: int
    qacc: int
    qacc_smooth: int
    actuator_force: int
    actuator_length: int
    time: int
    contacts: int  # their number itself, 32 bits
    warnings: int  # the mjWarningStat themselves, two numbers of 32 bits each


_OF_MODEL = (
    "dof_damping", "dof_dampingpoly", "actuator_gainprm", "actuator_biasprm", "actuator_delay", "actuator_forcerange",
    "pair_friction",
)  # fmt: skip
_OF_DATA = {
    "inertia": "M", "inertia_factor": "qLD", "inverse_diagonal": "qLDiagInv",
    **{name: name for name in (
        "qpos", "qvel", "ctrl", "userdata", "sensordata", "mocap_pos", "xpos", "xmat", "cdof", "subtree_com",
        "qfrc_passive", "qfrc_smooth", "qfrc_constraint", "qacc", "qacc_smooth", "actuator_force", "actuator_length",
    )},
}  # fmt: skip
_SAMPLE = """
<mujoco>
  <size nuserdata="3"/>
  <contact><pair geom1="one" geom2="two"/></contact>
  <worldbody>
    <body mocap="true"/>
    <body>
      <freejoint/><geom name="one" size=".1"/>
      <body><joint name="a"/><geom name="two" size=".1" pos="0 .2 0"/></body>
    </body>
  </worldbody>
  <actuator><position joint="a"/></actuator>
  <sensor><jointpos joint="a"/></sensor>
</mujoco>
"""
_PAGE, _MOST_WORDS = 512, 2**15  # words
_BEFORE = 40  # words before the anchor, from which on all that is looked for lies
_BEHIND_IN_MODEL, _BEHIND_IN_DATA = 340, 120  # and behind it: the structures are longer


@cache
def fields() -> Fields:
    """Return where this build of MuJoCo keeps the arrays of its structures; EngineError: they are not found."""
    model = mujoco.MjModel.from_xml_string(_SAMPLE)
    data = mujoco.MjData(model)
    found = _places(model, {name: name for name in _OF_MODEL}, anchor="dof_damping", behind=_BEHIND_IN_MODEL)
    found |= _places(data, _OF_DATA, anchor="qvel", behind=_BEHIND_IN_DATA)
    moment = 0.123456789
    data.time = moment
    before = found["qpos"] // 8
    hits = np.flatnonzero(_words(data, before - _BEFORE, before).view(np.float64) == moment)
    if len(hits) != 1:
        raise _unknown("time")
    return Fields(
        **found, time=8 * (before - _BEFORE + int(hits[0])), contacts=_place_of_contacts(found["qpos"]),
        warnings=_place_of_warnings(model, found["qpos"]),
    )  # fmt: skip


def _place_of_contacts(end: int) -> int:
    """Return where a mujoco.MjData keeps how many contacts there are: the last number before `end` that tells it."""
    found: set[int] = set()
    for count in (7, 11):  # balls of one body on a plane
        balls = "".join(f'<geom size=".1" pos="{place} 0 0.05"/>' for place in range(count))
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><worldbody><geom type="plane" size="0 0 1"/><body><freejoint/>{balls}</body></worldbody></mujoco>'
        )
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        buffer: Any = (ctypes.c_int32 * (end // 4)).from_address(data._address)
        numbers = np.frombuffer(buffer, np.int32)
        hits = {4 * int(place) for place in np.flatnonzero(numbers == count)}
        found = found & hits if found else hits
    if not found:
        raise _unknown("ncon")
    return max(found)  # before it lies the greatest number so far


def _place_of_warnings(model: mujoco.MjModel, end: int) -> int:
    """Return where a mujoco.MjData keeps its warnings, before `end`."""
    data, seen = mujoco.MjData(model), (123456789, 987654321)
    data.warning[0].lastinfo, data.warning[0].number = seen
    buffer: Any = (ctypes.c_int32 * (end // 4)).from_address(data._address)
    numbers = np.frombuffer(buffer, np.int32)
    hits = np.flatnonzero((numbers[:-1] == seen[0]) & (numbers[1:] == seen[1]))
    if len(hits) != 1:
        raise _unknown("warning")
    return 4 * int(hits[0])


def _words(structure: Any, first: int, end: int) -> NDArray[np.uintp]:
    """Return the words of a structure from one up to another."""
    size = ctypes.sizeof(ctypes.c_size_t)
    buffer: Any = (ctypes.c_size_t * (end - first)).from_address(structure._address + size * first)
    words: NDArray[np.uintp] = np.frombuffer(buffer, np.uintp)
    return words


def _places(structure: Any, names: dict[str, str], anchor: str, behind: int) -> dict[str, int]:
    """Return where a structure keeps the addresses of its arrays, all of them near that of `anchor`."""
    wanted, at = getattr(structure, anchor).ctypes.data, None
    for first in range(0, _MOST_WORDS, _PAGE):  # page by page, because nobody says where the structure ends
        hits = np.flatnonzero(_words(structure, first, first + _PAGE) == wanted)
        if len(hits):
            at = first + int(hits[0])
            break
    if at is None:
        raise _unknown(anchor)
    first = max(at - _BEFORE, 0)
    words, found = _words(structure, first, at + behind), {}
    for name, attribute in names.items():
        hits = np.flatnonzero(words == getattr(structure, attribute).ctypes.data)
        if not len(hits):
            raise _unknown(name)
        found[name] = 8 * (first + int(hits[-1]))  # an empty array before it has the same address
    return found


def _unknown(name: str) -> EngineError:
    return EngineError(f"MuJoCo {mujoco.__version__} keeps {name!r} where it is not found; accepted: MuJoCo 3.17 to 4")


@numbas(word_at)
def _pointer_at() -> Any:
    """Return what reads the pointer that lies at an address, for carray."""
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic

    def pointer_at(context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.load(builder.inttoptr(arguments[0], cgutils.voidptr_t.as_pointer()))

        return types.voidptr(types.int64), generate

    return intrinsic(pointer_at)


@kernel
def vector(structure: int, place: int, count: int) -> Any:
    """Return the array of `count` numbers whose address a structure keeps at a place of `fields`."""
    return carray(_pointer_at(structure + place), (count,), np.float64)


@kernel
def whole_number_at(address: int) -> Any:
    """Return the 32-bit whole number at an address, as an array (1,)."""
    return carray(pointer(address), (1,), np.int32)


@kernel
def number_at(address: int) -> Any:
    """Return the number at an address, as an array (1,)."""
    return carray(pointer(address), (1,), np.float64)
