"""`make`: an environment by its name, of either interface."""

from __future__ import annotations

from typing import Any

from ..errors import SettingsError
from .old_api import F110Env, GymEnv


def make(name: str = "f110_gym:f110-v0", **settings: Any) -> Any:
    """Return an environment, as gym.make does: of v0.2 by the name `f110-v0`, of v1.0 by `f1tenth-v0` or a `config`.

    `settings` are those of its F110Env; that of v0.2 has one car on the oval where nothing else is said.

    Raises:
      SettingsError: another environment's name.
    """
    id = name.rpartition(":")[2]
    if id == "f1tenth-v0":
        return _new(**settings)
    if id != "f110-v0":
        raise SettingsError(f"environment {name!r}; accepted: f110_gym:f110-v0, f1tenth_gym:f1tenth-v0")
    return _new(**settings) if "config" in settings else F110Env(**settings)


def environment_of_gym(**settings: Any) -> Any:
    """Return gym's `f110-v0`: the environment of v0.2, or, with a `config`, the one of v1.0."""
    return _new(**settings) if "config" in settings else GymEnv(**settings)


def _new(**settings: Any) -> Any:
    from .new_api import F110Env as Environment  # which imports gymnasium, where it is installed

    return Environment(**settings)
