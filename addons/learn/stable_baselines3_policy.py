"""Policies of Stable-Baselines3: its zip files with an interface inside, and their networks as torch modules.

A zip file is what `model.save` writes, with one member more, `fg_mujoco.json`: the description of the policy, the class
of the algorithm, and the statistics of VecNormalize where the training had one. `Algorithm.load` reads it as any other.
Loading runs code that is in the file, as it holds pickled objects. It needs the extra `train`.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from fg_mujoco.course.documents import read_json
from fg_mujoco.envs.observations import Observed
from fg_mujoco.envs.observer import PRIVILEGED
from fg_mujoco.envs.policy_interface import PolicyInterface
from fg_mujoco.errors import SettingsError, missing_extra
from fg_mujoco.simulation.planner_failure import one_line

from .policy_shapes import Act, Values, observed_shapes, parts_of, require_shapes

MEMBER = "fg_mujoco.json"
"""Of the zip file."""

_MOST_BYTES = 2**24  # of the member
_PACKAGES = ("stable_baselines3", "sb3_contrib")
_STATISTICS = ("obs_rms", "ret_rms")
_GREATEST = 1e38  # of `clip_obs`, of float32: JSON knows no infinity


def is_model(policy: Any) -> bool:
    """Return whether an object is an algorithm of Stable-Baselines3 with its policy."""
    return hasattr(policy, "policy") and hasattr(policy, "get_vec_normalize_env") and hasattr(policy, "save")


def has_asymmetric_policy(model: Any) -> bool:
    """Return whether the actor of an algorithm does not see what is privileged in its observations."""
    return any(kind.__name__ == "AsymmetricPolicy" for kind in type(model.policy).__mro__)


def zip_of_model(described: Mapping[str, Any], model: Any) -> bytes:
    """Return the contents of a policy.zip.

    Args:
      described: the description of the policy.
      model: an algorithm of Stable-Baselines3.
    """
    file = io.BytesIO()
    model.save(file)
    kinds = ((kind.__module__.partition(".")[0], kind.__name__) for kind in type(model).__mro__)
    package, name = next(each for each in kinds if each[0] in _PACKAGES)  # of a class of one's own: what it is made of
    own = {"algorithm": f"{package}.{name}", "vec_normalize": normalize_described(model)}
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr(zipfile.ZipInfo(MEMBER), json.dumps({**described, **own}, indent=1))
    return file.getvalue()


def zip_description(content: bytes) -> dict[str, Any]:
    """Return what `fg_mujoco.json` has in a zip file.

    Raises:
      SettingsError: it is no zip file of Stable-Baselines3, or has no such member.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = archive.namelist()
            if MEMBER not in names:
                of_sb3 = "data" in names
                ways = "save_policy(model, path) instead of model.save(path)" if of_sb3 else "a file of save_policy"
                raise SettingsError(f"has no {MEMBER}, which has the policy's interface; accepted: {ways}")
            if archive.getinfo(MEMBER).file_size > _MOST_BYTES:
                raise SettingsError(f"its {MEMBER} has more than {_MOST_BYTES} bytes; accepted: as it was written")
            found = read_json(archive.read(MEMBER), "as save_policy writes it")
    except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
        if isinstance(error, SettingsError):
            raise
        raise SettingsError(f"is no zip file of Stable-Baselines3: {one_line(error)}; accepted: one") from error
    return found if isinstance(found, dict) else {}


def read_zip(content: bytes) -> tuple[Any, Callable[[PolicyInterface], Act]]:
    """Return the description in a zip file, and what makes the policy's function.

    Raises:
      SettingsError: as `zip_description`.
    """
    described = zip_description(content)
    return described, partial(_function, content, described)


def _function(content: bytes, described: Mapping[str, Any], interface: PolicyInterface) -> Act:
    """Return the policy's function.

    Raises:
      SettingsError: the model cannot be loaded, or takes something else than its interface says.
      MissingExtraError: Stable-Baselines3 is not installed.
    """
    model = load_model(content, described)
    space = model.observation_space
    spaces = getattr(space, "spaces", None)
    wanted = observed_shapes(interface)
    shapes = {name: each.shape for name, each in spaces.items()} if spaces else {next(iter(wanted)): space.shape}
    unseen: Observed = {}
    if has_asymmetric_policy(model) and PRIVILEGED in shapes:
        unseen[PRIVILEGED] = np.zeros(shapes.pop(PRIVILEGED), np.float32)
    require_shapes(interface, shapes, int(np.prod(model.action_space.shape)))
    return partial(_act, model, statistics_of(described), unseen)


def load_model(content: bytes, described: Mapping[str, Any], **changes: Any) -> Any:
    """Return the algorithm of a zip file, on the CPU.

    Args:
      content: of the file.
      described: what its `fg_mujoco.json` has.
      changes: keywords of the algorithm's `load`.

    Raises:
      SettingsError: it cannot be loaded.
      MissingExtraError: Stable-Baselines3 is not installed.
    """
    package, _, name = str(described.get("algorithm")).partition(".")
    try:
        import stable_baselines3 as algorithms

        if package == _PACKAGES[1]:
            import sb3_contrib as algorithms
    except ImportError as error:
        said = "policies of Stable-Baselines3 need Stable-Baselines3"
        raise missing_extra(said, "train") from error
    kind: Any = getattr(algorithms, name, None)
    if package not in _PACKAGES or not hasattr(kind, "load"):
        said = f"its algorithm is {described.get('algorithm')!r}"
        raise SettingsError(f"{said}; accepted: one of {', '.join(_PACKAGES)}, such as stable_baselines3.PPO")
    try:
        return kind.load(io.BytesIO(content), device="cpu", **changes)
    except Exception as error:
        said = f"Stable-Baselines3 cannot load it: {one_line(error)}"
        raise SettingsError(f"{said}; accepted: a file of a version that it reads") from error


Statistics = dict[str, tuple[Any, Any]]
"""Mean and standard deviation of an observation's parts by name; of a flat one as "observation"; float64."""


def normalize_described(model: Any) -> dict[str, Any] | None:
    """Return the statistics of the VecNormalize of a model's environment, as JSON takes them; None: there is none."""
    wrapper = model.get_vec_normalize_env()
    if wrapper is None:
        return None
    found: dict[str, Any] = {name: getattr(wrapper, name) for name in ("norm_obs", "epsilon")}
    found["clip_obs"] = min(wrapper.clip_obs, _GREATEST)
    for name in _STATISTICS:
        own = getattr(wrapper, name, None) if name != "obs_rms" or wrapper.norm_obs else None
        if own is None:
            continue
        each = own if isinstance(own, dict) else {"": own}
        found[name] = {
            part: {of: np.asarray(getattr(rms, of)).tolist() for of in ("mean", "var", "count")}
            for part, rms in each.items()
        }
    return found


def restore_normalize(wrapper: Any, described: Mapping[str, Any]) -> None:
    """Write the statistics that `normalize_described` has described to a VecNormalize."""
    for name in _STATISTICS:
        for part, saved in (described.get(name) or {}).items():
            rms = getattr(wrapper, name)
            rms = rms[part] if part else rms
            rms.mean, rms.var, rms.count = np.array(saved["mean"]), np.array(saved["var"]), saved["count"]


def statistics_of(described: Mapping[str, Any]) -> tuple[Statistics, float]:
    """Return the statistics by which observations are normalised, empty where they are not, and where they are cut."""
    own = described.get("vec_normalize") or {}
    if not own.get("norm_obs"):
        return {}, 0.0
    found = {
        part or "observation": (np.array(each["mean"]), np.sqrt(np.array(each["var"]) + own["epsilon"]))
        for part, each in own["obs_rms"].items()
    }
    return found, float(own["clip_obs"])


def _act(model: Any, statistics: tuple[Statistics, float], unseen: Observed, observation: Any) -> Values:
    """Return the action; the observation is normalised as by VecNormalize, with zeros for what the actor lacks."""
    known, clip = statistics
    if unseen:
        observation = parts_of(observation) | unseen
    if known:
        parts = dict(parts_of(observation))
        for name, (mean, std) in known.items():
            if name in unseen:
                continue
            parts[name] = np.clip((parts[name] - mean) / std, -clip, clip).astype(np.float32)
        observation = parts if isinstance(observation, dict) else parts["observation"]
    found: Values = model.predict(observation, deterministic=True)[0]
    return found


def module_of(model: Any, inputs: list[str]) -> Any:
    """Return a torch module of observations, whose parts it takes in their order, that returns mean actions (n, 2).

    Args:
      model: an algorithm of Stable-Baselines3.
      inputs: names of the observation's parts.
    """
    import torch

    policy = model.policy
    statistics, clip = statistics_of({"vec_normalize": normalize_described(model)})
    tensors = {name: tuple(torch.as_tensor(each, dtype=torch.float32) for each in pair)
               for name, pair in statistics.items() if name in inputs}  # fmt: skip
    spaces = getattr(policy.observation_space, "spaces", {})
    unseen = {name: space.shape for name, space in spaces.items() if name not in inputs}  # by the actor

    class MeanAction(torch.nn.Module):  # type: ignore[misc]
        """The mean action of a policy, as `predict` returns it before it is clipped."""

        def __init__(self) -> None:
            super().__init__()
            self.policy = policy

        def forward(self, *parts: Any) -> Any:
            named = dict(zip(inputs, parts, strict=True))
            for name, (mean, std) in tensors.items():
                named[name] = torch.clamp((named[name] - mean) / std, -clip, clip)
            for name, shape in unseen.items():
                named[name] = parts[0].new_zeros((len(parts[0]), *shape))
            action = self.policy._predict(named if spaces else named[inputs[0]], deterministic=True)
            if not self.policy.squash_output:
                return action
            low, high = (torch.as_tensor(each) for each in (policy.action_space.low, policy.action_space.high))
            return low + 0.5 * (action + 1.0) * (high - low)

    return MeanAction()
