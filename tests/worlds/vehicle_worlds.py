"""Vehicles for the tests: the bundled ones, one that is made of ours, and files that are none."""

import re
from functools import cache
from importlib.resources import files
from pathlib import Path
from tempfile import mkdtemp

import fg_mujoco as fg
from fg_mujoco.addons.realcar.fitting import fit
from fg_mujoco.vehicle.car import WHEELS

F1TENTH = (files("fg_mujoco.models") / "f1tenth.xml").read_text("utf-8")
MADE = {"wheelbase": 0.40, "width": 0.36, "mass": 5.5, "track_width": 0.286, "length": 0.65, "nominal_mu": 0.8}


@cache
def made_file():
    """Return the path of a longer, wider and heavier car on less grip, made of models/f1tenth.xml."""
    spec = fg.Vehicle.load("f1tenth").spec(mu=MADE["nominal_mu"])
    for body in ("steering", "front_left_carrier", "front_right_carrier"):
        spec.body(body).pos = (MADE["wheelbase"], *spec.body(body).pos[1:])
    for wheel in WHEELS:
        carrier = spec.body(f"{wheel}_carrier")
        carrier.pos = (carrier.pos[0], (0.5 if "left" in wheel else -0.5) * MADE["track_width"], carrier.pos[2])
    chassis = spec.geom("chassis")
    chassis.size, chassis.pos = (0.5 * MADE["length"], 0.5 * MADE["width"], chassis.size[2]), (0.2, 0.0, chassis.pos[2])
    fit(spec, mass=MADE["mass"], center_of_gravity=(0.2077, 0.074), yaw_inertia=0.1017)
    spec.compile()
    path = Path(mkdtemp()) / "made.xml"
    path.write_text(spec.to_xml(), encoding="utf-8")
    return str(path)


@cache
def open_file():
    """Return the path of models/f1tenth.xml with a differential for a shaft: its wheels roll without slip in bends."""
    path = Path(mkdtemp()) / "open.xml"
    path.write_text(with_drive_line(F1TENTH, centre="open"), encoding="utf-8")
    return str(path)


def load(name):
    """Return a bundled vehicle, or the made one."""
    return fg.Vehicle.load(made_file() if name == "made" else name)


def with_drive_line(text, **texts):
    """Return the text of a vehicle with other data of its drive line, as centre="open" and rear_axle="locked"."""
    for name, data in texts.items():
        text, found = re.subn(rf'(<(?:text|numeric) name="{name}" data=)"[^"]*"', rf'\1"{data}"', text)
        assert found == 1, name
    return text
