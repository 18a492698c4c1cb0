"""Environments of several agents, without PettingZoo until one is made."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .pettingzoo_environment import F1TenthParallelEnv


def parallel_env(agents: int = 2, *, render_mode: str | None = None, **settings: Any) -> F1TenthParallelEnv:
    """Return a PettingZoo ParallelEnv of some cars in one world, each driven by an agent: car_0, car_1 and so on.

    Args:
      agents: how many cars learn, from 1 to 16 with the opponents.
      render_mode: "rgb_array" or None.
      settings: those of the Gymnasium environment, by name: track, laps, opponents, grid, beam_step and so on.

    Raises:
      MissingExtraError: PettingZoo is not installed; the message has the command that installs it.
      TrackError, SettingsError: what cannot be driven.
      ControllerError: an opponent that cannot be loaded.
    """
    from .pettingzoo_environment import F1TenthParallelEnv

    return F1TenthParallelEnv(agents, render_mode=render_mode, **settings)
