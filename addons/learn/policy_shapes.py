"""What the networks of policies take and return: the shapes of one car's observation and action."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fg_mujoco.envs.observations import Observed
from fg_mujoco.envs.policy_interface import PolicyInterface
from fg_mujoco.errors import SettingsError

Values = NDArray[np.float32]
Act = Callable[[Any], Values]
"""A function of an observation of one car that returns its action (2,)."""

FLAT = "observation"
"""Name of the only part of a flat observation."""

ACTION_SIZE = 2


def observed_shapes(interface: PolicyInterface) -> dict[str, tuple[int, ...]]:
    """Return the shapes of an observation's parts by name; of a flat one that of "observation"."""
    bounds = interface.observer().bounds
    if isinstance(bounds, dict):
        return {name: each.low.shape for name, each in bounds.items()}
    return {FLAT: bounds.low.shape}


def parts_of(observation: Any) -> Observed:
    """Return the parts of an observation by name; of a flat one, itself as "observation"."""
    return observation if isinstance(observation, dict) else {FLAT: observation}


def require_shapes(interface: PolicyInterface, taken: Mapping[str, tuple[int | None, ...]], returned: int) -> None:
    """Refuse a network that takes or returns something else than its interface says.

    Args:
      interface: of the policy.
      taken: shapes of one observation's parts by name, as the network takes them; None stands for any number.
      returned: how many numbers it returns.

    Raises:
      SettingsError: they differ.
    """
    wanted = observed_shapes(interface)
    fits = set(taken) == set(wanted) and all(
        len(shape) == len(wanted[name]) and all(a in (None, b) for a, b in zip(shape, wanted[name], strict=True))
        for name, shape in taken.items()
    )
    if not fits:
        said = f"its network takes {shapes_text(taken)}, its observation is {shapes_text(wanted)}"
        raise SettingsError(f"{said}; accepted: the same")
    if returned != ACTION_SIZE:
        said = f"its network returns {returned} numbers, its action {interface.action} has {ACTION_SIZE}"
        raise SettingsError(f"{said}; accepted: as many")


def shapes_text(shapes: Mapping[str, tuple[int | None, ...]]) -> str:
    """Return shapes by name for messages."""
    sizes = {name: ", ".join("n" if size is None else str(size) for size in shape) for name, shape in shapes.items()}
    return ", ".join(f"{name} ({size})" for name, size in sizes.items())
