"""Policy files: a trained policy with its interface, in one of two forms, which races as a planner.

    policy = read_policy("runs/first")
    action = policy.act(observation)

| file | contents | needs |
| --- | --- | --- |
| `policy.onnx`, or the folder that has it | an ONNX model; the interface in its `metadata_props` | extra `policies` |
| `policy.zip` | a model of Stable-Baselines3; interface and VecNormalize inside | extra `train` |

`save_policy` writes them. The interface is a PolicyInterface: observation, action, period, beams and limits of the car
that the policy was trained with. An observation that is not flat goes in by its parts. Loading a zip file runs code
that is in it, as Stable-Baselines3 loads pickled objects; an ONNX file is data.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from fg_mujoco.course.files import is_folder, read_bytes
from fg_mujoco.course.writing import write_file
from fg_mujoco.display import brief, quoted
from fg_mujoco.envs.policy_interface import PolicyInterface
from fg_mujoco.errors import ControllerError, SettingsError, gone
from fg_mujoco.messages import shown
from fg_mujoco.racing.planners import POLICY_ENDINGS, POLICY_FILE
from fg_mujoco.simulation.planner_failure import one_line

from .policy_shapes import Act, observed_shapes

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
      policy: an algorithm of Stable-Baselines3; or, for a .onnx file, a torch module that takes the parts of
        observations (n, ...) in their order and returns actions (n, 2), or an onnx.ModelProto that takes them by name.
      path: a .onnx or .zip file, or a folder, which gets a policy.onnx.
      interface: `env.policy_interface` of the environment that it was trained in; None: that of the algorithm's own.
      trained: facts of its training, as JSON takes them.

    Raises:
      SettingsError: no interface, or a policy that the form cannot hold.
      ControllerError: the file cannot be written.
      MissingExtraError: the form needs an extra that is not installed.
    """
    path = Path(path)
    if path.suffix == ".json":
        raise ControllerError(f"policy {path}: {gone('policy.json')}")
    path = path if path.suffix in _FORMS else path / POLICY_FILE
    content = _content(policy, path.suffix, interface, trained)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, content)
    except OSError as error:
        reason = error.strerror or str(error)
        raise ControllerError(f"policy {path}: cannot be written: {reason}; accepted: a file that can be") from error
    return path


def _content(
    policy: Any, ending: str, interface: PolicyInterface | None, trained: Mapping[str, Any] | None
) -> bytes:
    """Return the bytes of a policy file with an ending; otherwise as `save_policy`."""
    from .onnx_policy import onnx_of_module, with_description
    from .stable_baselines3_policy import has_asymmetric_policy, is_model, module_of, zip_of_model

    model = policy if is_model(policy) else None
    if interface is None:
        interface = None if model is None else _interface_of(model)
        if interface is None:
            raise SettingsError("save_policy lacks the interface; accepted: env.policy_interface of the environment")
    if model is not None and has_asymmetric_policy(model):
        interface = replace(interface, privileged=())  # which its actor does not see
    described = description_of(interface, trained)
    if ending == ".zip":
        if model is None:
            said = f"a .zip file of a {type(policy).__name__}"
            raise SettingsError(f"{said}; accepted: of an algorithm of Stable-Baselines3")
        return zip_of_model(described, model)
    if hasattr(policy, "SerializeToString"):
        return with_description(policy, described)
    if model is None and not hasattr(policy, "state_dict"):
        said = f"a .onnx file of a {type(policy).__name__}"
        raise SettingsError(f"{said}; accepted: of a model of Stable-Baselines3, a torch module or an onnx.ModelProto")
    module = policy if model is None else module_of(model, list(observed_shapes(interface)))
    return onnx_of_module(described, interface, module)


def _interface_of(model: Any) -> PolicyInterface | None:
    """Return the interface of an algorithm's environment; None: it has none."""
    env = model.get_env()
    found = None if env is None else getattr(env.unwrapped, "policy_interface", None)
    if found is None and env is not None and env.has_attr("policy_interface"):
        found = env.get_attr("policy_interface")[0]
    return found if isinstance(found, PolicyInterface) else None


def policy_path(path: str | Path) -> Path:
    """Return the file of a policy; a folder's is its `policy.onnx`."""
    path = Path(path)
    return path / POLICY_FILE if is_folder(path) else path


def read_policy(path: str | Path) -> Policy:
    """Return the policy of a file, or of the folder that has a `policy.onnx`.

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


def _read_onnx(content: bytes) -> tuple[Any, Callable[[PolicyInterface], Act]]:
    from .onnx_policy import read_onnx

    return read_onnx(content)


def _read_zip(content: bytes) -> tuple[Any, Callable[[PolicyInterface], Act]]:
    from .stable_baselines3_policy import read_zip

    return read_zip(content)


_FORMS: Mapping[str, Callable[[bytes], tuple[Any, Callable[[PolicyInterface], Act]]]] = dict(
    zip(POLICY_ENDINGS, (_read_onnx, _read_zip), strict=True)
)
_ACCEPTED = "a .onnx or .zip file that save_policy wrote, or a folder with a policy.onnx"
