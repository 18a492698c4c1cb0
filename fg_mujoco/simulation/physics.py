"""Many states of one model, stepped in C: MuJoCo's batch functions, called from Python and from the native core.

The bits of each state are those that `mujoco.mj_step` gives it alone. What one state raises, such as a stack that is
too small, fails that state only.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..arguments import Uncopied
from ..errors import EngineError, ModelError
from ..messages import FloatArray
from ..native import mujoco_library

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
"""The parts of a state: all that the next step depends on."""

BAD_STATE = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADQACC) + 1)
"""Warnings after which MuJoCo resets a state by itself."""

BAD_WARNINGS = slice(2 * BAD_STATE.start + 1, 2 * BAD_STATE.stop, 2)
"""The indices of their counts in `Batch.warnings`."""

_WARNINGS = int(mujoco.mjtWarning.mjNWARNING)

CHANGEABLE = (
    "body_mass", "body_inertia", "body_ipos", "body_subtreemass", "body_invweight0", "dof_M0", "dof_invweight0",
    "tendon_invweight0", "actuator_acc0", "pair_friction", "actuator_gainprm", "actuator_biasprm", "actuator_delay",
)  # fmt: skip
"""Fields of a model that states may have values of their own of: those that are changed, and those that follow."""

_ALL_STAGES = int(mujoco.mjtStage.mjSTAGE_ACC)
_PARTS = {
    "time": mujoco.mjtState.mjSTATE_TIME,
    "qpos": mujoco.mjtState.mjSTATE_QPOS,
    "qvel": mujoco.mjtState.mjSTATE_QVEL,
    "ctrl": mujoco.mjtState.mjSTATE_CTRL,
    "mocap_pos": mujoco.mjtState.mjSTATE_MOCAP_POS,
    "userdata": mujoco.mjtState.mjSTATE_USERDATA,
}


class _Config(ctypes.Structure):
    """mjBatchConfig."""

    _fields_ = (("nthread", ctypes.c_int), ("persistent", ctypes.c_ubyte))


_LIBRARY = mujoco_library()

_ADDRESS, _INT = ctypes.c_void_p, ctypes.c_int
_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "mjb_makeBatch": (_ADDRESS, (_ADDRESS, _INT, _ADDRESS, _ADDRESS, _INT)),
    "mjb_deleteBatch": (None, (_ADDRESS,)),
    "mjb_state": (_ADDRESS, (_ADDRESS,)),
    "mjb_warning": (_ADDRESS, (_ADDRESS,)),
    "mjb_status": (_ADDRESS, (_ADDRESS,)),
    "mjb_error": (ctypes.c_char_p, (_ADDRESS, _INT)),
    "mjb_output": (_ADDRESS, (_ADDRESS, ctypes.c_char_p, _ADDRESS, _ADDRESS)),
    "mjb_expand": (_ADDRESS, (_ADDRESS, ctypes.c_char_p, _ADDRESS, _ADDRESS)),
    "mjb_expanded": (_ADDRESS, (_ADDRESS, ctypes.c_char_p, _ADDRESS, _ADDRESS)),
    "mjb_setConst": (_INT, (_ADDRESS, _ADDRESS, _INT)),
    "mjb_setModels": (None, (_ADDRESS, _ADDRESS)),
    "mjb_forward": (_INT, (_ADDRESS, _ADDRESS, _INT, _INT)),
    "mjb_reset": (_INT, (_ADDRESS, _ADDRESS, _INT, _ADDRESS, _INT)),
    "mjb_getData": (None, (_ADDRESS, _INT, _ADDRESS)),
}  # fmt: skip
for _name, (_result, _arguments) in _FUNCTIONS.items():
    _function = getattr(_LIBRARY, _name)
    _function.restype, _function.argtypes = _result, _arguments


def span_of(model: mujoco.MjModel, part: mujoco.mjtState) -> tuple[int, int]:
    """Return the place of a part of a state in its row: the first index, and the one behind the last."""
    earlier = (1 << bit for bit in range(int(part).bit_length() - 1))
    before = sum(mujoco.mj_stateSize(model, bit) for bit in earlier if int(STATE) & bit)
    return before, before + mujoco.mj_stateSize(model, int(part))


class StateLayout(NamedTuple):
    """The places of the parts of a state in its row: the first index, and the one behind the last."""

    time: int
    qpos: tuple[int, int]
    qvel: tuple[int, int]
    ctrl: tuple[int, int]
    mocap_pos: tuple[int, int]
    userdata: tuple[int, int]

    @classmethod
    def of(cls, model: mujoco.MjModel) -> StateLayout:
        """Return the layout of the states of a model."""
        places = {name: span_of(model, part) for name, part in _PARTS.items()}
        return cls(time=places.pop("time")[0], **places)


class Batch:
    """States of one model, copied, that are stepped together. Arrays are live.

    Attributes:
      address, first: of the batch, and the number that state 0 has there.
      states: (n, k) as mj_getState has them with STATE: what is written here is stepped from.
      sensors: (n, nsensordata) after the last step or forward pass.
      records: (n, steps, nsensordata) room for the sensors of each step of a tick.
      warnings: (n, 2 kinds) what MuJoCo's last warning of a kind was about, and how many there were.
      status: (n,) not 0 where the last call failed.

    Raises:
      EngineError: MuJoCo cannot make the batch.
    """

    def __init__(self, model: mujoco.MjModel, count: int, steps: int) -> None:
        self.model = model
        message = ctypes.create_string_buffer(1024)
        config = _Config(1, 1)
        self._handle = _Handle(
            _LIBRARY.mjb_makeBatch(model._address, count, ctypes.byref(config), message, len(message))
            or _failed(message)
        )
        self.address = self._handle.address
        self.first, self._count, self._all = 0, count, count
        size = mujoco.mj_stateSize(model, int(STATE))
        self.states: FloatArray = _view(self._handle, _LIBRARY.mjb_state(self.address), (count, size), np.float64)
        self.warnings: NDArray[np.int32] = _view(
            self._handle, _LIBRARY.mjb_warning(self.address), (count, 2 * _WARNINGS), np.int32
        )
        self.status: NDArray[np.int32] = _view(self._handle, _LIBRARY.mjb_status(self.address), (count,), np.int32)
        self.sensors: FloatArray = self._live("mjb_output", "sensordata", (model.nsensordata,))
        self.records = np.zeros((count, steps, model.nsensordata))
        self._models: tuple[mujoco.MjModel, ...] = ()

    def like(self) -> Batch:
        """Return another batch of the same model, with as many states."""
        return Batch(self.model, self._all, self.records.shape[1])

    def part(self, first: int, count: int) -> Batch:
        """Return some consecutive states as a batch of their own, numbered from 0; not for another thread."""
        own, rows = copy(self), slice(first, first + count)
        own.first, own._count = self.first + first, count
        for name in ("states", "sensors", "warnings", "status", "records"):
            setattr(own, name, getattr(self, name)[rows])
        return own

    @property
    def warned(self) -> NDArray[np.bool_]:
        """Whether MuJoCo has met a bad state. Shape (n,)."""
        warned: NDArray[np.bool_] = np.any(self.warnings[:, BAD_WARNINGS], axis=1)
        return warned

    def has_warned(self, i: int) -> bool:
        """Return whether MuJoCo has met a bad state in state i."""
        return bool(self.warnings[i, BAD_WARNINGS].any())

    def expand(self, name: str) -> Any:
        """Return the values of a field of the model, a row for each state, to be written to. Live."""
        return self._live("mjb_expand", name, np.shape(getattr(self.model, name)))

    def expanded(self, name: str) -> Any:
        """Return what `expand` has given of a field, live; None: it was not asked for."""
        given = _LIBRARY.mjb_expanded(self.address, name.encode(), None, None)
        return self.expand(name) if given else None

    def set_const(self) -> None:
        """Work out anew what follows from fields that `expand` gave."""
        ids = np.arange(self.first, self.first + self._count, dtype=np.int32)
        self._check(_LIBRARY.mjb_setConst(self.address, ids.ctypes.data, len(ids)))

    def set_models(self, models: Sequence[mujoco.MjModel]) -> None:
        """Give each state a model of its own, all of the same sizes."""
        self._models = tuple(models)
        addresses = (ctypes.c_void_p * len(models))(*(model._address for model in models))
        _LIBRARY.mjb_setModels(self.address, addresses)

    @contextmanager
    def as_model(self, i: int) -> Iterator[mujoco.MjModel]:
        """Give `model` the values that `expand` gave state i, for as long as the context lasts."""
        own = {name: values for name in CHANGEABLE if (values := self.expanded(name)) is not None}
        plain = {name: getattr(self.model, name).copy() for name in own}
        try:
            for name, values in own.items():
                getattr(self.model, name)[:] = values[i]
            yield self.model
        finally:
            for name, values in plain.items():
                getattr(self.model, name)[:] = values

    def read(self, i: int, data: mujoco.MjData) -> None:
        """Write state i, and all that was worked out of it last, into `data`."""
        _LIBRARY.mjb_getData(self.address, self.first + i, data._address)

    def reset(self, ids: NDArray[np.int32]) -> None:
        """Forget warnings, and all else that no state holds, of some states."""
        own = ids + np.int32(self.first)
        self._check(_LIBRARY.mjb_reset(self.address, own.ctypes.data, len(own), None, 0))

    def forward(self, ids: NDArray[np.int32]) -> None:
        """Work out everything of some states, sensors too, as mj_forward does."""
        own = ids + np.int32(self.first)
        self._check(_LIBRARY.mjb_forward(self.address, own.ctypes.data, len(own), _ALL_STAGES))

    def error(self, i: int) -> str:
        """Return why the last call failed for state i."""
        return str(_LIBRARY.mjb_error(self.address, self.first + i).decode())

    def _live(self, function: str, name: str, shape: tuple[int, ...]) -> Any:
        size, bytes_each = ctypes.c_int(), ctypes.c_int()
        address = getattr(_LIBRARY, function)(
            self.address, name.encode(), ctypes.byref(size), ctypes.byref(bytes_each)
        )  # fmt: skip
        if not address or bytes_each.value != 8 or size.value != math.prod(shape):
            raise EngineError(f"MuJoCo gives no values of {name!r} for each state; accepted: a field of numbers")
        values = _view(self._handle, address, (self._all, *shape), np.float64)
        return values[self.first : self.first + self._count]

    def _check(self, failed: int) -> None:
        if failed:
            first = int(np.flatnonzero(self.status)[0])
            raise EngineError(f"MuJoCo failed in world {first}: {self.error(first)}")


class _Handle(Uncopied):
    """Holds one of MuJoCo's batches; it goes when nobody holds its handle any more."""

    def __init__(self, address: int) -> None:
        self.address = address

    def __del__(self) -> None:
        _LIBRARY.mjb_deleteBatch(self.address)


def _view(handle: _Handle, address: int, shape: tuple[int, ...], kind: Any) -> Any:
    """Return an array of what lies at an address in a batch, which lives as long as the array."""
    count = math.prod(shape)
    if count == 0:
        return np.zeros(shape, kind)
    buffer = (ctypes.c_byte * (count * np.dtype(kind).itemsize)).from_address(address)
    buffer.handle = handle
    return np.frombuffer(buffer, kind).reshape(shape)


def _failed(message: Any) -> int:
    raise EngineError(f"MuJoCo makes no batch: {' '.join(message.value.decode().split())}")


def whole_steps(period: float, timestep: float) -> int:
    """Return the number of physics steps in one period; ModelError: not a whole number of them."""
    steps = round(period / timestep)
    if steps < 1 or abs(steps * timestep - period) > 1e-9:
        raise ModelError(f"timestep is {timestep} s; accepted: a whole fraction of the LiDAR's period of {period} s")
    return steps
