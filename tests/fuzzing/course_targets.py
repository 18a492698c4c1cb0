"""Targets of courses: centreline CSVs, maps, their images, and the names of tracks."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from numpy.random import Generator

from .mutations import NUMBERS, mutated, mutated_binary, one_of
from .target import SHORT, Attempt, Target, as_text, command


def ring(samples: Path) -> None:
    """Write a round map as PNG and PGM, its YAML, and a centreline."""
    from PIL import Image

    y, x = np.mgrid[:90, :90] - 44.5
    free = np.abs(np.hypot(x, y) - 30.0) < 9.0
    picture = Image.fromarray(np.where(free, 254, 0).astype(np.uint8))
    picture.save(samples / "map.png")
    picture.save(samples / "map.pgm")
    settings = {"image": "map.png", "resolution": 0.1, "origin": [-4.5, -4.5, 0.0], "negate": 0}
    settings |= {"occupied_thresh": 0.65, "free_thresh": 0.196}
    (samples / "map.yaml").write_text("".join(f"{key}: {value}\n" for key, value in settings.items()))
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    points = np.column_stack([3.0 * np.cos(angle), 3.0 * np.sin(angle), np.full(60, 0.9), np.full(60, 0.9)])
    rows = "\n".join(",".join(f"{value:.4f}" for value in row) for row in points)
    (samples / "ring.csv").write_text("# x_m, y_m, w_tr_right_m, w_tr_left_m\n" + rows + "\n")


def _track_csv(samples: Path, here: Path, rng: Generator) -> Attempt:
    (here / "ring.csv").write_bytes(mutated((samples / "ring.csv").read_bytes(), rng))
    return command(
        "race", "--track", one_of(rng, ("ring.csv", "ring.csv[width=2]", "ring.csv[direction=clockwise]")), *SHORT
    )


def _map_yaml(samples: Path, here: Path, rng: Generator) -> Attempt:
    shutil.copy(samples / "map.png", here)
    (here / "map.yaml").write_bytes(mutated((samples / "map.yaml").read_bytes(), rng))
    return command("race", "--track", one_of(rng, ("map.yaml", "map.yaml[close=0.3]", "map.yaml[border=wall]")), *SHORT)


def _map_image(samples: Path, here: Path, rng: Generator) -> Attempt:
    name = one_of(rng, ("map.png", "map.pgm"))
    (here / "map.yaml").write_text((samples / "map.yaml").read_text().replace("map.png", name))
    (here / name).write_bytes(mutated_binary((samples / name).read_bytes(), rng))
    return command("race", "--track", "map.yaml", *SHORT)


TRACKS = (
    "oval",
    "random:3",
    "random:3:tight",
    "scene:u_turn_trap:3",
    "ring.csv[width=2]",
    "map.yaml[close=.3,loop=1]",
    "maze",
)


def _track_name(samples: Path, here: Path, rng: Generator) -> Attempt:
    for name in ("map.yaml", "map.png", "ring.csv"):
        shutil.copy(samples / name, here)
    name = as_text(mutated(one_of(rng, TRACKS).encode(), rng))
    options = ("--obstacles", one_of(rng, (*NUMBERS, "2"))) if rng.random() < 0.3 else ()
    return command("race", f"--track={name}", *(f"{option}" for option in options), *SHORT)


_HEADS = {
    "x": ("x", "x_m", "x_ref", "center_x_m", "x_cm", "X [m]"),
    "y": ("y", "y_m", "y_ref", "center_y_m", "y_cm", "Y [m]"),
    "right": ("w_tr_right_m", "width_right", "d_right", "w_right [cm]"), "left": ("w_tr_left_m", "width_left", "left"),
    "width": ("width", "track_width"), "v": ("vx_mps", "speed [km/h]", "v"), "yaw": ("psi_rad", "yaw", "theta"),
    "other": ("s_m", "index", "kappa_radpm", "z", "qx", ""),
}  # fmt: skip


def _field_course(samples: Path, here: Path, rng: Generator) -> Attempt:
    """A course or a line as teams have them: some of these columns, in any order, with any separator and unit."""
    kinds = [str(kind) for kind in rng.permutation(list(_HEADS))[: int(rng.integers(2, 9))]]
    kinds = kinds if rng.random() < 0.2 else list(dict.fromkeys(("x", "y", *kinds)))
    angle = np.linspace(0.0, 2.0 * np.pi * one_of(rng, (1.0, 1.0, 1.0, 0.5)), int(one_of(rng, (60, 60, 400, 3))))
    scale = float(one_of(rng, (1.0, 1.0, 1.0, 100.0, 1000.0, 1e-3)))
    values = {"x": 9.0 * np.cos(angle), "y": 9.0 * np.sin(angle), "yaw": angle, "v": 3.0 + np.sin(angle)}
    columns = [values.get(kind, np.full(len(angle), 1.0)) * (1.0 if kind == "yaw" else scale) for kind in kinds]
    between = one_of(rng, (",", ", ", ";", "\t", " "))
    head = between.join(one_of(rng, _HEADS[kind]) for kind in kinds)
    rows = [between.join(f"{value:.5g}" for value in row) for row in np.column_stack(columns)]
    text = "\n".join([one_of(rng, (head, f"# {head}", "")), *rows]).encode()
    name = one_of(rng, ("course.csv", "course.csv", "course.txt", "course.json", "course.npy", "course.stl"))
    (here / name).write_bytes(mutated(text, rng) if rng.random() < 0.3 else text)
    ways = (("--track", name), ("--track", f"{name}[width=2]"), ("--controller", f"pure_pursuit[line={name}]"))
    return command("race", *one_of(rng, ways), *SHORT)


TARGETS = {
    "field_course": Target(attempt=_field_course),
    "track_csv": Target(attempt=_track_csv, prepare=ring),
    "map_yaml": Target(attempt=_map_yaml, prepare=ring),
    "map_image": Target(attempt=_map_image, prepare=ring),
    "track_name": Target(attempt=_track_name, prepare=ring),
}
