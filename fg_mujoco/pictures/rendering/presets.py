"""Presets of the quality of pictures: `draft`, `good` and `best`."""

from __future__ import annotations

from dataclasses import dataclass

from ...errors import SettingsError, accepted_names


@dataclass(frozen=True, kw_only=True)
class Quality:
    """The settings of a preset."""

    samples: int  # of a pixel, by the graphics hardware or its software
    shadow_size: int  # [px] of the shadow map; 0: no shadows
    oversampling: int  # a picture is drawn so many times as wide and high, and then made smaller


QUALITIES = {
    "draft": Quality(samples=0, shadow_size=0, oversampling=1),
    "good": Quality(samples=0, shadow_size=1024, oversampling=1),
    "best": Quality(samples=4, shadow_size=4096, oversampling=2),
}
"""Presets by name: for looking something up, for video, and for print."""


def find_quality(name: str) -> Quality:
    """Return a preset; raise SettingsError for an unknown one."""
    if name not in QUALITIES:
        raise SettingsError(f"quality is {name!r}; {accepted_names(name, QUALITIES)}")
    return QUALITIES[name]
