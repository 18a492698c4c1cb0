"""Policy files: a trained policy with its interface, in one of three forms, which races as a planner.

    policy = read_policy("runs/first")
    action = policy.act(observation)

| file | contents | needs |
| --- | --- | --- |
| `policy.json`, or the folder that has it | interface, weights of a Perceptron | nothing |
| `policy.onnx` | an ONNX model; the interface in its `metadata_props` | the extra `policies` |
| `policy.zip` | a model of Stable-Baselines3; interface and VecNormalize inside | the extra `train` |

`save_policy` writes them. The interface is a PolicyInterface: observation, action, period, beams and limits of the car
that the policy was trained with. An observation that is not flat goes in by its parts. Loading a zip file runs code
that is in it, as Stable-Baselines3 loads pickled objects; the two others are data.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fg_mujoco.course.documents import read_json
from fg_mujoco.course.files import is_folder, read_bytes
from fg_mujoco.course.writing import write_file
from fg_mujoco.display import brief, quoted
from fg_mujoco.envs.policy_interface import PolicyInterface
from fg_mujoco.errors import ControllerError, SettingsError
from fg_mujoco.messages import shown
from fg_mujoco.racing.planners import POLICY_ENDINGS, POLICY_FILE
from fg_mujoco.racing.run_folder import remember_made
from fg_mujoco.simulation.planner_failure import one_line

from .perceptron import Perceptron
from .policy_shapes import Act, Values, observed_shapes, parts_of, require_shapes, shapes_text

FORMAT = "fg_mujoco policy 1"
"""Of the description in a policy file; a reader refuses any other. It changes when a word of an interface comes to mean
something else, as `normalised` might: an older file would observe other numbers than it was trained with."""

MOST_BYTES = 64 * 2**20
"""Of a policy file."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Policy:
    """A policy that was read from a file.

    `act(observation)` is its action (2,) for an observation of one car, as `env.reset()` returns it. It is called with
    one observation at a time, so that its bits do not depend on how many there are.
    """

    path: Path
    content: bytes  # of the file
    interface: PolicyInterface
    act: Act
    trained: Mapping[str, Any] = field(default_factory=dict)  # facts of its training, as they were saved

    @property
    def network(self) -> Perceptron | None:
        """The network of ours that takes an observation in one part; None: it is another."""
        if isinstance(self.act, partial) and self.act.func is _act and len(self.act.args[1]) == 1:
            found: Perceptron = self.act.args[0]
            return found
        return None

    def __repr__(self) -> str:
        return brief(self, quoted(self.path), f"{self.interface.observation} -> {self.interface.action}")


def save_policy(
    policy: Any,
    path: str | Path,
    interface: PolicyInterface | None = None,
    *,
    trained: Mapping[str, Any] | None = None,
) -> Path:
    """Write a policy file, and return its path. The ending of the path decides on the form.

    Args:
      policy: an algorithm of Stable-Baselines3, a torch module that takes the parts of observations (n, ...) in their
        order and returns actions (n, 2), or a Perceptron, for a .json file.
      path: a .json, .onnx or .zip file, or a folder, which gets a policy.json.
      interface: `env.policy_interface` of the environment that it was trained in; None: that of the algorithm's own.
      trained: facts of its training, as JSON takes them.

    Raises:
      SettingsError: no interface, or a policy that the form cannot hold.
      ControllerError: the file cannot be written.
      MissingExtraError: the form needs an extra that is not installed.
    """
    path = Path(path)
    path = path if path.suffix in _FORMS else path / POLICY_FILE
    content = policy_content(policy, path.suffix, interface, trained)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, content)
    except OSError as error:
        reason = error.strerror or str(error)
        raise ControllerError(f"policy {path}: cannot be written: {reason}; accepted: a file that can be") from error
    if path.suffix == ".zip":  # from which this user's training may go on
        remember_made(hashlib.sha256(content).hexdigest())
    return path


def policy_content(
    policy: Any, ending: str, interface: PolicyInterface | None = None, trained: Mapping[str, Any] | None = None
) -> bytes:
    """Return the bytes of a policy file with an ending; otherwise as `save_policy`."""
    from .stable_baselines3_policy import (
        has_asymmetric_policy,
        is_model,
        module_of,
        network_of,
        normalize_described,
        zip_of_model,
    )

    model = policy if is_model(policy) else None
    if interface is None:
        interface = None if model is None else _interface_of(model)
        if interface is None:
            raise SettingsError("save_policy lacks the interface; accepted: env.policy_interface of the environment")
    if model is not None and has_asymmetric_policy(model):
        interface = replace(interface, privileged=())  # which its actor does not see
    described = description_of(interface, trained)
    inputs = list(observed_shapes(interface))
    if model is not None and hasattr(model.observation_space, "spaces"):
        inputs = [name for name in model.observation_space.spaces if name in inputs]
    if ending == ".zip":
        if model is None:
            said = f"a .zip file of a {type(policy).__name__}"
            raise SettingsError(f"{said}; accepted: of an algorithm of Stable-Baselines3")
        return zip_of_model(described, model)
    normalize = None if model is None else normalize_described(model)
    module = policy if model is None else model.policy
    if ending == ".onnx":
        if isinstance(policy, Perceptron):
            raise SettingsError("a .onnx file of a Perceptron; accepted: of a torch module, or a .json file")
        from .onnx_policy import onnx_of_module

        parts = list(observed_shapes(interface))
        return onnx_of_module(described, interface, module if model is None else module_of(module, normalize, parts))
    network = policy if isinstance(policy, Perceptron) else network_of(module, normalize, inputs)
    _require_width(interface, network)
    return json_policy(interface, network, trained, inputs)


def _interface_of(model: Any) -> PolicyInterface | None:
    """Return the interface of an algorithm's environment; None: it has none."""
    env = model.get_env()
    found = None if env is None else getattr(env.unwrapped, "policy_interface", None)
    if found is None and env is not None and env.has_attr("policy_interface"):
        found = env.get_attr("policy_interface")[0]
    return found if isinstance(found, PolicyInterface) else None


def policy_path(path: str | Path) -> Path:
    """Return the file of a policy; a folder's is its `policy.json`."""
    path = Path(path)
    return path / POLICY_FILE if is_folder(path) else path


def read_policy(path: str | Path) -> Policy:
    """Return the policy of a file, or of the folder that has a `policy.json`.

    Raises:
      ControllerError: it cannot be read, is no policy file, or its interface does not fit its network.
      MissingExtraError: the file needs an extra that is not installed.
    """
    path = policy_path(path)
    content = read_content(path)
    return policy_of(path, content)


def read_content(path: Path) -> bytes:
    """Return the bytes of a policy file.

    Raises:
      ControllerError: it cannot be read.
    """
    try:
        return read_bytes(path, MOST_BYTES)
    except OSError as error:
        reason = error.strerror or str(error)
        raise ControllerError(f"policy {path}: cannot be read: {reason}; accepted: {_ACCEPTED}") from error


def policy_of(path: Path, content: bytes) -> Policy:
    """Return the policy that a file's bytes are; errors are those of `read_policy`."""
    form = _FORMS.get(path.suffix)
    if form is None:
        raise ControllerError(f"policy {path} ends in {path.suffix!r}; accepted: {_ACCEPTED}")
    try:
        described, network = form(content)
        interface, trained = _read_description(described)
        return Policy(path=path, content=content, interface=interface, act=network(interface), trained=trained)
    except SettingsError as error:
        raise ControllerError(f"policy {path}: {error}") from error


def description_of(interface: PolicyInterface, trained: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return what every policy file has besides its network, as JSON takes it."""
    return {"format": FORMAT, "interface": interface.described(), "trained": dict(trained or {})}


def _read_description(described: Any) -> tuple[PolicyInterface, Mapping[str, Any]]:
    """Return the interface and the facts of the training.

    Raises:
      SettingsError: another format, or no interface.
    """
    known = described.get("format") if isinstance(described, Mapping) else None
    if known != FORMAT:
        raise SettingsError(f"its format is {shown(known)}; accepted: {FORMAT!r}, as save_policy writes it")
    trained = described.get("trained")
    interface = described.get("interface") or {}
    try:
        found = PolicyInterface.read(interface)
        observed_shapes(found)
    except (TypeError, ValueError, OverflowError, AttributeError) as error:
        if isinstance(error, SettingsError):
            raise
        said = f"its interface is damaged: {one_line(error)[:200]}"
        raise SettingsError(f"{said}; accepted: as save_policy writes it") from error
    return found, trained if isinstance(trained, Mapping) else {}


def _read_json(content: bytes) -> tuple[Any, Callable[[PolicyInterface], Act]]:
    """Return the description in a policy.json, and what makes the policy's function."""
    found = read_json(content, "as save_policy writes it")

    def network(interface: PolicyInterface) -> Act:
        perceptron, shapes = Perceptron.read(found.get("network") or {}), observed_shapes(interface)
        inputs = found.get("inputs", list(shapes))
        if not isinstance(inputs, list) or sorted(map(str, inputs)) != sorted(shapes):
            said = f"its network takes {shown(inputs)}, its observation is {shapes_text(shapes)}"
            raise SettingsError(f"{said}; accepted: the same parts")
        _require_width(interface, perceptron)
        return partial(_act, perceptron, tuple(inputs))

    return found, network


def _require_width(interface: PolicyInterface, network: Perceptron) -> None:
    """Refuse a network that takes or returns other numbers than its interface says.

    Raises:
      SettingsError: they differ.
    """
    shapes = observed_shapes(interface)
    width = sum(math.prod(shape) for shape in shapes.values())
    if network.inputs != width:
        said = f"its network takes {network.inputs} numbers, its observation has {width}: {shapes_text(shapes)}"
        raise SettingsError(f"{said}; accepted: as many")
    require_shapes(interface, shapes, network.outputs)


def _act(network: Perceptron, inputs: tuple[str, ...], observation: Any) -> Values:
    parts = parts_of(observation)
    if len(inputs) == 1:
        return network(parts[inputs[0]].ravel())
    return network(np.concatenate([parts[name].ravel() for name in inputs]))


def json_policy(
    interface: PolicyInterface,
    network: Perceptron,
    trained: Mapping[str, Any] | None = None,
    inputs: list[str] | None = None,
) -> bytes:
    """Return the contents of a `policy.json`.

    Args:
      interface: of the policy.
      network: that returns its action.
      trained: facts of its training, as JSON takes them.
      inputs: names of the observation's parts in the order in which the network takes them; None: in their own.
    """
    described = description_of(interface, trained) | ({} if inputs is None else {"inputs": inputs})
    return (json.dumps(described | {"network": network.described()}, indent=1) + "\n").encode()


def _read_onnx(content: bytes) -> tuple[Any, Callable[[PolicyInterface], Act]]:
    from .onnx_policy import read_onnx

    return read_onnx(content)


def _read_zip(content: bytes) -> tuple[Any, Callable[[PolicyInterface], Act]]:
    from .stable_baselines3_policy import read_zip

    return read_zip(content)


_FORMS: Mapping[str, Callable[[bytes], tuple[Any, Callable[[PolicyInterface], Act]]]] = dict(
    zip(POLICY_ENDINGS, (_read_json, _read_onnx, _read_zip), strict=True)
)
_ACCEPTED = "a .json, .onnx or .zip file that save_policy wrote, or a folder with a policy.json"
