"""Names of the columns of lines, as stacks spell them, and their units. `line_file` says which are known.

places_of("line.csv: line 1", ("x_m", "y_m", "vx_mps"))   # of x and y, of what else is known, and of boundaries
unit_of("speed [km/h]", "speed")                          # in SI: 1 / 3.6
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from ..errors import TrackError

COLUMNS = ("x_m", "y_m", "w_tr_right_m", "w_tr_left_m")
RACELINE = ("s_m", *COLUMNS[:2], "psi_rad", "kappa_radpm", "vx_mps", "ax_mps2")
SHOWN = 8
"""Names of a header in a message."""

_LINES = (
    *("{}", "{}_ref", "ref_{}", "{}_center", "center_{}", "{}_centre", "centre_{}", "centerline_{}", "centreline_{}"),
    *("{}_pos", "pos_{}", "position_{}", "pose_{}", "{}_position"),
)
_SIDES = (
    *("w_tr_{}", "w_{}", "width_{}", "{}_width", "width_tr_{}", "track_width_{}", "d_{}", "dist_{}", "{}_dist"),
    *("distance_{}", "{}_distance", "dist_to_{}", "{}"),
)
_NAMES = {side: tuple(form.format(side) for form in _SIDES) for side in ("right", "left")} | {
    "width": ("width", "track_width"),
    "speed": ("vx", "v", "speed", "velocity", "vel", "v_x", "v_ref", "vx_ref", "ref_speed", "target_speed", "linear_x"),
    "s": ("s", "arc_length", "arclength", "station"),
    "psi": ("psi", "yaw", "theta", "heading", "yaw_angle", "psi_ref"),
    "kappa": ("kappa", "curvature", "curv", "kappa_ref"),
    "ax": ("ax", "acc", "acceleration", "a_x", "acc_x"),
}
_BOUNDARIES = tuple(  # of the two of a course: x and y of either, left and right or inside and outside
    tuple(names.split())
    for names in (
        "left_boundary_x left_boundary_y right_boundary_x right_boundary_y",
        "left_bound_x left_bound_y right_bound_x right_bound_y",
        "left_x left_y right_x right_y",
        "x_left y_left x_right y_right",
        "x_l y_l x_r y_r",
        "x_i y_i x_o y_o",
        "x_inner y_inner x_outer y_outer",
        "inner_x inner_y outer_x outer_y",
    )
)
_LENGTHS = {"": 1.0, "m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0, "cm": 0.01, "mm": 0.001}
_SPEEDS = {"": 1.0, "mps": 1.0, "m_s": 1.0, "ms": 1.0, "kmh": 1.0 / 3.6, "km_h": 1.0 / 3.6, "kph": 1.0 / 3.6}
_ANGLES = {"": 1.0, "rad": 1.0, "radians": 1.0, "deg": math.pi / 180.0, "degrees": math.pi / 180.0}
_OTHERS = {"": 1.0, "radpm": 1.0, "rad_m": 1.0, "1_m": 1.0, "mps2": 1.0, "m_s2": 1.0, "ms2": 1.0}
_UNITS = {"speed": _SPEEDS, "psi": _ANGLES, "kappa": _OTHERS, "ax": _OTHERS}
_LONGEST = 100  # name of a column that may be known
_VARIANT = re.compile(r"_(iqp|sp|opt|racetraj|raceline)$")  # of which optimiser a column is
_OF_A_MESSAGE = re.compile(r".*_((position|pose|linear)_[xyz])")  # of ROS, behind what it is in: pose.pose.position.x


def unit_of(name: str, quantity: str) -> float:
    """Return the unit in the name of a column of a quantity, in SI; 1 without one."""
    units = _UNITS.get(quantity, _LENGTHS)
    return units[plain_name(name, units)[1]]


def plain_name(name: str, units: Iterable[str] = _LENGTHS) -> tuple[str, str]:
    """Return a name in small letters without its unit, and the unit, one of some."""
    if len(name) > _LONGEST:
        return name, ""
    name = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name.strip()).casefold()
    words = [word for word in re.split(r"[\s_\-\[\](){}/^.]+", name) if word]
    count = next((n for n in (2, 1) if len(words) > n and "_".join(words[-n:]) in units), 0)
    plain = _VARIANT.sub("", "_".join(words[: len(words) - count]))
    return _OF_A_MESSAGE.sub(r"\1", plain), "_".join(words[len(words) - count :])


def lines_of(names: Iterable[str]) -> list[tuple[int, int]]:
    """Return the places of x and y of each line that columns name."""
    plain = [plain_name(name)[0] for name in names]
    pairs = (
        tuple([k for k, name in enumerate(plain) if name == form.format(axis)] for axis in "xy") for form in _LINES
    )
    return [pair for xs, ys in pairs for pair in zip(xs, ys, strict=False)]


def name_a_line(names: tuple[str, ...]) -> bool:
    """Return whether columns of these names have a line or two boundaries."""
    plain = {plain_name(name)[0] for name in names}
    return bool(lines_of(names)) or any(set(forms) <= plain for forms in _BOUNDARIES)


def places_of(where: str, columns: tuple[str, ...]) -> tuple[tuple[int, ...], dict[str, int], tuple[int, ...]]:
    """Return the columns of x and y, of what else is known, and of two boundaries; nothing where there are none.

    Raises:
      TrackError: no line or several, a column twice, or one side's width only; `where` is said.
    """
    named = ", ".join(columns[:SHOWN])
    lines = lines_of(columns)
    plain = [plain_name(name)[0] for name in columns]
    forms = next((forms for forms in _BOUNDARIES if set(forms) <= set(plain)), ())
    bounds = tuple(plain.index(form) for form in forms)
    if len(lines) != 1 and not (bounds and not lines):
        found = "no x and y" if not lines else f"several lines, {', '.join(columns[x] for x, _ in lines)}"
        raise TrackError(f"{where} names {found}, in {named}; accepted: one x and one y, as {', '.join(COLUMNS)}")
    for form in _LINES:
        xs, ys = ([n for n, each in zip(columns, plain, strict=True) if each == form.format(axis)] for axis in "xy")
        if xs and ys and len(xs) != len(ys):
            twice = " and ".join(map(repr, xs if len(xs) > len(ys) else ys))
            raise TrackError(f"{where} has a column twice, {twice}; accepted: each once")
    places: dict[str, int] = {}
    for quantity, forms in _NAMES.items():
        plain = [plain_name(name, _UNITS.get(quantity, _LENGTHS))[0] for name in columns]
        for form in forms:
            if plain.count(form) > 1:
                twice = " and ".join(repr(name) for name, each in zip(columns, plain, strict=True) if each == form)
                raise TrackError(f"{where} has a column twice, {twice}; accepted: each once")
            if form in plain:
                places.setdefault(quantity, plain.index(form))
    sides = [quantity for quantity in ("right", "left") if quantity in places]
    if len(sides) == 1:
        one = columns[places[sides[0]]]
        raise TrackError(f"{where} names one side's width only, {one}; accepted: one to either side")
    if sides:
        places.pop("width", None)
    return lines[0] if lines else (), places, bounds
