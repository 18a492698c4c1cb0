"""Policies as ONNX models, with their interface in `metadata_props` (as mjlab keeps its contract there).

The model takes the parts of an observation by their names, each (n, ...) float32, and returns actions (n, 2). A flat
observation is its only input, of any name. A normaliser of the observation is part of the model. Reading needs the
extra `policies`, which is onnxruntime. Torch writes, with the extra `train`.
"""

from __future__ import annotations

import importlib.util
import json
import logging
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from fg_mujoco.course.documents import read_json
from fg_mujoco.envs.policy_interface import PolicyInterface
from fg_mujoco.errors import SettingsError, missing_extra
from fg_mujoco.simulation.planner_failure import one_line

from .policy_shapes import ACTION_SIZE, Act, Values, observed_shapes, parts_of, require_shapes

METADATA = "fg_mujoco_policy"
"""Key of the description, a JSON text, in `metadata_props`."""

_OPSET = 18  # which onnxruntime has read since 1.14
LONGEST = 5.0
"""[s] that a model may run for an action."""

_PULSE = 0.25  # [s] between two looks at how long the runs have taken


def read_onnx(content: bytes) -> tuple[Any, Callable[[PolicyInterface], Act]]:
    """Return the description in an ONNX model, and what makes the policy's function.

    Raises:
      SettingsError: it is no ONNX model, or has no description.
      MissingExtraError: onnxruntime is not installed.
    """
    onnxruntime = require_onnxruntime()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # the same bits whatever else runs
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(content, options, ["CPUExecutionProvider"], enable_fallback=0)
        text = session.get_modelmeta().custom_metadata_map.get(METADATA)
    except Exception as error:
        raise SettingsError(f"is no ONNX model: {one_line(error)[:200]}; accepted: as save_policy writes it") from error
    if text is None:
        raise SettingsError(f"has no {METADATA!r} in its metadata_props; accepted: as save_policy writes it")
    return read_json(text, "as save_policy writes it"), partial(_function, session)


def _function(session: Any, interface: PolicyInterface) -> Act:
    """Return the policy's function.

    Raises:
      SettingsError: the model takes or returns something else than its interface says.
    """
    wanted, taken = observed_shapes(interface), session.get_inputs()
    names = {each.name: each.name for each in taken}
    if len(wanted) == len(taken) == 1:
        names = {taken[0].name: next(iter(wanted))}
    shapes = {names[each.name]: tuple(size if isinstance(size, int) else None for size in each.shape[1:])
              for each in taken}  # fmt: skip
    returned = session.get_outputs()
    if not returned:
        raise SettingsError("its network returns nothing; accepted: an action")
    width = returned[0].shape[-1] if returned[0].shape else 0
    require_shapes(interface, shapes, width if isinstance(width, int) else ACTION_SIZE)
    other = [each.type for each in (*taken, returned[0]) if each.type != "tensor(float)"]
    if other:
        raise SettingsError(f"its network takes or returns a {other[0]}; accepted: tensor(float)")
    return _Runs(session, names, returned[0].name)


class _Runs:
    """A policy's function: it runs a model for at most LONGEST. No signal interrupts its code, as an endless Loop."""

    def __init__(self, session: Any, names: Mapping[str, str], output: str) -> None:
        self._session, self._names, self._output = session, names, output
        self._new_options = require_onnxruntime().RunOptions
        self._ends: dict[Any, float] = {}  # when each run is ended, by its options
        self._watcher: threading.Thread | None = None
        self._endless = False

    def __call__(self, observation: Any) -> Values:
        if self._watcher is None or not self._watcher.is_alive():  # a fork has no threads
            self._watcher = threading.Thread(target=_end_late_runs, args=(weakref.ref(self),), daemon=True)
            self._watcher.start()
        parts = parts_of(observation)
        given = {name: parts[part][np.newaxis] for name, part in self._names.items()}
        options = self._new_options()
        options.log_severity_level = 4
        try:
            if not self._endless:
                self._ends[options] = time.monotonic() + LONGEST
                found: Values = self._session.run([self._output], given, options)[0][0]
                return found
        except Exception:
            if not options.terminate:
                raise
            self._endless = True
        finally:
            self._ends.pop(options, None)
        raise TimeoutError(f"no answer within {LONGEST:g} s, and what loops without an end does not run again")

    def end_late_runs(self) -> None:
        """End the runs that have taken too long."""
        for options, end in list(self._ends.items()):
            if time.monotonic() > end:
                options.terminate = True


def _end_late_runs(of: weakref.ref[_Runs]) -> None:
    while (runs := of()) is not None:
        runs.end_late_runs()
        del runs
        time.sleep(_PULSE)


def onnx_of_module(described: Mapping[str, Any], interface: PolicyInterface, module: Any) -> bytes:
    """Return an ONNX model of a torch module, which takes the parts of observations (n, ...) in their order.

    Args:
      described: the description of the policy.
      interface: of the policy.
      module: that returns actions (n, 2).

    Raises:
      MissingExtraError: onnx or torch are not installed.
    """
    onnx = require_onnx()
    import torch

    shapes = observed_shapes(interface)
    example = tuple(torch.zeros((1, *shape)) for shape in shapes.values())
    module = module.to("cpu").eval()
    checks = torch.distributions.Distribution
    checked, log = checks._validate_args, logging.getLogger("torch.onnx")
    checks.set_default_validate_args(False)  # a check of values cannot be exported
    level = log.level
    log.setLevel(logging.ERROR)  # it warns of torchvision, which nothing here needs
    try:
        with tempfile.TemporaryDirectory() as folder, torch.no_grad():
            file = f"{folder}/policy.onnx"
            torch.onnx.export(
                module, example, file, input_names=list(shapes), output_names=["action"], opset_version=_OPSET,
                dynamo=True, verbose=False, external_data=False,
            )  # fmt: skip
            return with_description(onnx.load(file), described)
    finally:
        checks.set_default_validate_args(checked)
        log.setLevel(level)


def with_description(model: Any, described: Mapping[str, Any]) -> bytes:
    """Return the bytes of an ONNX model with the description of a policy in its metadata."""
    import onnx

    onnx.helper.set_model_props(model, {METADATA: json.dumps(described)})
    content: bytes = model.SerializeToString()
    return content


def require_onnxruntime() -> Any:
    """Return onnxruntime.

    Raises:
      MissingExtraError: it is not installed.
    """
    if importlib.util.find_spec("onnxruntime") is None:
        raise missing_extra("policies in ONNX files need onnxruntime", "policies")
    return importlib.import_module("onnxruntime")


def require_onnx() -> Any:
    """Return onnx.

    Raises:
      MissingExtraError: it is not installed.
    """
    if importlib.util.find_spec("onnx") is None:
        raise missing_extra("writing ONNX files needs onnx", "train")
    return importlib.import_module("onnx")
