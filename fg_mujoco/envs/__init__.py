"""Learning environments: the same episodes for dm_env, Gymnasium and Gymnasium's vector interface.

`dm_environment`, `gym_environment` and `gym_vector` are the interfaces; the add-on learn has PettingZoo's. They share
`episodes`: actions in; observations, rewards and ends out. Episodes drive the cars of `worlds`. `actions`,
`observations`, `rewards` and `end_conditions` describe the policy's side. Their own terms are functions of
`tick_state`. `starts` places the cars, and `environment_settings` has all settings. native/envs has the compiled
loops, of `compiled_step` a step as one call, and `rendering` draws pictures.

`register_once_imported` registers the environment with Gymnasium, whether that was imported before fg_mujoco or is
imported after it: until then a finder in `sys.meta_path` waits for it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

ID = "fg_mujoco/F1Tenth-v0"


def register(gymnasium: Any) -> None:
    """Register the environment and its vector environment by their names; they are imported when one is made."""
    if ID not in gymnasium.registry:
        gymnasium.register(
            id=ID,
            entry_point=f"{__package__}.gym_environment:F1TenthEnv",
            vector_entry_point=f"{__package__}.gym_vector:F1TenthVectorEnv",
        )


def register_once_imported() -> None:
    """Register the environment now if Gymnasium is imported, else as soon as it is."""
    gymnasium = sys.modules.get("gymnasium")
    if gymnasium is None:
        if not any(isinstance(finder, _Waiting) for finder in sys.meta_path):
            sys.meta_path.insert(0, _Waiting())
    elif hasattr(gymnasium, "registry"):  # else it is being imported
        register(gymnasium)


class _Waiting:
    """Finds Gymnasium where Python does, and registers the environment when it has been imported."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name != "gymnasium":
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            imports = spec.loader.exec_module

            def exec_module(module: ModuleType) -> None:
                imports(module)
                register(module)
                if self in sys.meta_path:
                    sys.meta_path.remove(self)

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec
