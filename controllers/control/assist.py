"""Assist: which stages stand between a planner's reference and the car's command.

    assist="none"            the planner alone, with the speed laws of its source
    assist="grip"            the same with the friction limiter
    assist="safe"            speed laws, sight, safety filter, prediction, recovery and friction limiter
    assist="full"            the same with guidance and remember: the default
    assist="sight,limiter"   stages of one's own choice, in any order
    assist="grip+sight"      names of stages and of assists may be joined, by a comma or by +
    assist="full-prediction" and stages may be left out

The stages are called in their own order, not in that of the text. A planner's class says in `source_laws` which
speed laws its source has, and in `assists` which of the four assists mean something else for it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.registry import Registry

SAFE = (
    "mean_range", "distance_ahead", "sight", "safety_filter", "prediction", "recovery", "limiter",
)  # fmt: skip
"""Stages of the assist `safe`."""

ASSISTS: Mapping[str, tuple[str, ...]] = {
    "none": (),
    "grip": ("limiter",),
    "safe": SAFE,
    "full": (*SAFE, "guidance", "remember"),
}
"""The four assists; `none` and `grip` have the speed laws of the planner's source besides."""

_DECISION = "fg_mujoco.controllers.control.decision:"

STAGES: Registry[object] = Registry(
    "stage",
    SettingsError,
    "fg_mujoco.stages",
    {
        "mean_range": f"{_DECISION}MEAN_RANGE_STAGE",
        "distance_ahead": f"{_DECISION}DISTANCE_AHEAD_STAGE",
        "friction_law": f"{_DECISION}FRICTION_LAW_STAGE",
        "prediction": f"{_DECISION}PREDICTION_STAGE",
        "guidance": f"{_DECISION}GUIDANCE_STAGE",
        "limiter": f"{_DECISION}LIMITER_STAGE",
        "sight": f"{_DECISION}SIGHT_STAGE",
        "safety_filter": f"{_DECISION}SAFETY_FILTER_STAGE",
        "recovery": f"{_DECISION}RECOVERY_STAGE",
        "remember": "fg_mujoco.controllers.safety.lap_raceline:REMEMBER",
    },
)
"""Stages by name, each a `stages.Stage`, in the order of their calls; other packages may register theirs.

Of those that write the command the last one does: with sight, what the limiter does is a part of its work.
"""


def names_in(assist: object, what: str = "assist") -> tuple[tuple[str, str], ...]:
    """Return the signs, + or -, and the names that a text joins, each of a stage or an assist.

    Raises:
      SettingsError: no text, an empty part, an unknown name, or one that stands there twice.
    """
    parts = re.split("([,+-])", assist) if isinstance(assist, str) else [""]
    names = [part.strip() for part in parts[::2]]
    for name in names:
        if name not in ASSISTS and name not in STAGES and not (name and STAGES.entry_points(name)):
            said = f"{what} is {assist!r}" if len(names) < 2 else f"{what} {assist!r}: there is no stage {name!r}"
            accepted = accepted_names(name, (*ASSISTS, *STAGES.names()), ", or several joined by commas")
            raise SettingsError(f"{said}; {accepted}")
        if names.count(name) > 1:
            raise SettingsError(f"{what} {assist!r} has {name} twice; accepted: each stage once")
    return tuple(("-" if sign == "-" else "+", name) for sign, name in zip(("+", *parts[1::2]), names, strict=True))


def stages_of(assist: str, source_laws: Sequence[str], assists: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Return the names of the stages that an assist means for a planner, in the order of their work.

    Args:
      assist: as in `names_in`.
      source_laws: names of the speed laws that the planner's source has.
      assists: those of the four assists that mean something else for the planner.

    Raises:
      SettingsError: as in `names_in`, or a law that is no stage.
    """
    chosen: set[str] = set()
    for sign, name in names_in(assist):
        laws = source_laws if name in ("none", "grip") and name not in assists else ()
        meant = {*laws, *assists.get(name, ASSISTS.get(name, (name,)))}
        chosen = chosen | meant if sign == "+" else chosen - meant
    order = list(STAGES)  # those of other packages come last
    return tuple(sorted(chosen, key=lambda name: (order.index(name) if name in order else len(order), name)))
