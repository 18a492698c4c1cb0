"""What add-ons bring to the core, where somebody asks for it: the one module of the core that names them.

    from .. import from_addons
    points = from_addons.raceline(map_line, car, mu, max_speed, settings)

Each is imported when it is first used. Commands, planners, scenes and other things that a user names have registries,
which packages of others add to.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .registry import ADDONS, imported

if TYPE_CHECKING:
    from fg_mujoco.addons.arena.race_control.race_control import RaceControl as RaceControl
    from fg_mujoco.addons.arena.race_control.race_control import Standings as Standings
    from fg_mujoco.addons.arena.race_control.race_control import standings as standings
    from fg_mujoco.addons.arena.random_courses.generator import generate_track as generate_track
    from fg_mujoco.addons.arena.random_courses.moving import with_moving as with_moving
    from fg_mujoco.addons.arena.tight_courses.tight import generate_tight_track as generate_tight_track
    from fg_mujoco.addons.drivers.racelines.raceline import make_raceline as make_raceline
    from fg_mujoco.addons.formats.boundaries import between_boundaries as between_boundaries
    from fg_mujoco.addons.formats.cars import load_car as load_car
    from fg_mujoco.addons.formats.tables import line_table as line_table
    from fg_mujoco.addons.learn.dataset import Dataset as Dataset
    from fg_mujoco.addons.learn.ray_cluster import drive_on_ray as drive_on_ray
    from fg_mujoco.addons.learn.ray_cluster import require_ray as require_ray
    from fg_mujoco.addons.learn.residual import Residual as Residual
    from fg_mujoco.addons.look.commands import report_race as report_race
    from fg_mujoco.addons.look.notebook import driven_line as driven_line
    from fg_mujoco.addons.look.notebook import notebook_html as notebook_html
    from fg_mujoco.addons.look.notebook import show as show
    from fg_mujoco.addons.realcar.bag_drive import read_bag_drive as read_bag_drive
    from fg_mujoco.addons.realcar.floors import Floor as Floor
    from fg_mujoco.addons.realcar.floors import floor_names as floor_names
    from fg_mujoco.addons.realcar.measured_errors import MeasuredErrors as MeasuredErrors
    from fg_mujoco.addons.realcar.measured_errors import effect_names as effect_names
else:

    def __getattr__(name: str) -> Any:
        """Import what an add-on brings when it is first used; refuse it in one line where that cannot be imported."""
        module = next((module for module, names in PLACES.items() if name in names.split()), None)
        if module is None:
            raise AttributeError(f"no add-on brings {name!r}")
        found = globals()[name] = imported(f"{ADDONS}.{module}:{name}", repr(name))
        return found


PLACES = {
    "arena.race_control.race_control": "RaceControl Standings standings",
    "arena.random_courses.generator": "generate_track",
    "arena.random_courses.moving": "with_moving",
    "arena.tight_courses.tight": "generate_tight_track",
    "drivers.racelines.raceline": "make_raceline",
    "formats.boundaries": "between_boundaries",
    "formats.cars": "load_car",
    "formats.tables": "line_table",
    "learn.dataset": "Dataset",
    "learn.ray_cluster": "drive_on_ray require_ray",
    "learn.residual": "Residual",
    "look.commands": "report_race",
    "look.notebook": "driven_line notebook_html show",
    "realcar.bag_drive": "read_bag_drive",
    "realcar.floors": "Floor floor_names",
    "realcar.measured_errors": "MeasuredErrors effect_names",
}
"""Module of an add-on -> what of it the core uses."""
