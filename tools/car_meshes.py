"""Meshes of the visible parts of the car: writes models/assets/*.obj.

    python tools/car_meshes.py [FOLDER]

models/f1tenth_look.xml has the place and the material of each part. Coordinates are in the frame of the body that
carries it (x ahead, y left, z up) [m], and below the LiDAR's beams, .0614 over `base_link`. Wheels are drawn for the
left side.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from solids import block, cuboid, joined, lathe, loft, mirrored, plate, rounded, upright_lathe

_CREASE = np.radians(35.0)  # edges sharper than this are not shaded as round
_TIRE_RADIUS, _TIRE_HALF_WIDTH = 0.049, 0.0215  # [m] as in models/f1tenth.xml
_TREAD_DEPTH = 0.0022  # [m]


def tub() -> Any:
    """Return the chassis pan with side rails, front skid and rear overhang: black nylon."""
    pan = mirrored(
        [(-0.085, -0.040), (-0.030, -0.052), (0.060, -0.062), (0.100, -0.118), (0.235, -0.118), (0.275, -0.062),
         (0.345, -0.048), (0.405, -0.040)]
    )  # fmt: skip
    rails = [block(0.168, side * 0.121, -0.021, 0.002, 0.150, 0.010, 0.004) for side in (-1.0, 1.0)]
    boxes = [block(0.3302, 0.0, -0.012, 0.012, 0.062, 0.052), block(0.0, 0.0, -0.012, 0.012, 0.070, 0.056)]
    return joined(plate(rounded(pan, 0.012), -0.0225, -0.0125, 0.002), *rails, *boxes)


def deck() -> Any:
    """Return the plate that carries the electronics, with the side panels of the body: painted."""
    outline = mirrored(
        [(-0.045, -0.034), (-0.035, -0.050), (0.058, -0.056), (0.092, -0.080), (0.240, -0.080), (0.268, -0.058),
         (0.315, -0.052), (0.325, -0.040)]
    )  # fmt: skip
    top = plate(rounded(outline, 0.008), 0.0105, 0.0144, 0.0008)
    return joined(top, *(_side_pod(side) for side in (-1.0, 1.0)))


def _side_pod(side: float) -> Any:
    """Return a panel at the side of the battery that bulges out and tapers to both ends."""
    stations = [(0.088, 0.0030), (0.100, 0.0095), (0.130, 0.0125), (0.200, 0.0125), (0.235, 0.0085), (0.252, 0.0030)]
    rings = []
    for x, rise in stations:
        section = [(0.074, -0.012), (0.112, -0.012), (0.1165, -0.008), (0.1145, rise - 0.006), (0.108, rise),
                   (0.080, rise + 0.001), (0.074, rise - 0.002)]  # fmt: skip
        rings.append([(x, side * y, z) for y, z in section])
    return loft(rings)


def nose() -> Any:
    """Return the fairing from the deck down to the bumper: painted."""
    stations = [(0.300, 0.045, 0.0130, 0.0250), (0.330, 0.043, 0.0120, 0.0250), (0.370, 0.040, 0.0080, 0.0190),
                (0.405, 0.036, 0.0000, 0.0080), (0.428, 0.030, -0.0080, -0.0030)]  # fmt: skip
    angles = np.linspace(0.0, np.pi, 11)
    rings = []
    for x, half, shoulder, crown in stations:
        arch = [(x, half * np.cos(a), shoulder + (crown - shoulder) * np.sin(a) ** 0.8) for a in angles]
        rings.append([*arch, (x, -half, shoulder - 0.014), (x, half, shoulder - 0.014)])
    return loft(rings)


def stripe() -> Any:
    """Return the two stripes on the tail of the deck: white."""
    tail = [block(-0.012, side * 0.019, 0.0140, 0.0150, 0.052, 0.012, 0.001) for side in (-1.0, 1.0)]
    return joined(*tail)


def bumper() -> Any:
    """Return the foam bumper, swept back at its ends, and its two brackets."""
    angles = np.radians(np.linspace(-62.0, 62.0, 13))
    rings = []
    for a in angles:
        x, y = 0.308 + 0.142 * np.cos(a) ** 0.7, 0.150 * np.sin(a)
        ring = []
        for t in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
            ring.append(
                (x + 0.0115 * np.cos(a) * np.cos(t), y + 0.0115 * np.sin(a) * np.cos(t), -0.006 + 0.0135 * np.sin(t))
            )
        rings.append(ring)
    brackets = [block(0.418, side * 0.028, -0.014, -0.006, 0.056, 0.012) for side in (-1.0, 1.0)]
    return joined(loft(rings), *brackets)


def rear_bumper() -> Any:
    """Return the rear bar and its brackets."""
    bar = mirrored([(-0.112, -0.082), (-0.103, -0.095), (-0.094, -0.088), (-0.094, -0.060)])
    brackets = [block(-0.088, side * 0.030, -0.020, -0.008, 0.030, 0.010) for side in (-1.0, 1.0)]
    return joined(plate(rounded(bar, 0.006, 3), -0.014, 0.006, 0.002), *brackets)


def towers() -> Any:
    """Return the shock towers, where the dampers hang, over both axles."""
    outline = [(-0.026, -0.010), (0.026, -0.010), (0.040, 0.030), (0.046, 0.046), (0.034, 0.050), (0.018, 0.040),
               (-0.018, 0.040), (-0.034, 0.050), (-0.046, 0.046), (-0.040, 0.030)]  # fmt: skip
    parts = []
    for x in (0.356, -0.028):
        tower = plate(rounded(outline, 0.004, 3), x - 0.002, x + 0.002, 0.0006)
        tower.vertices = tower.vertices[:, [2, 0, 1]]  # the outline stands upright, across the car
        parts.append(tower)
    return joined(*parts)


def computer() -> Any:
    """Return the computer with the fins of its heat sink."""
    box = block(0.108, 0.0, 0.0200, 0.0400, 0.100, 0.084, 0.005)
    fins = [cuboid(0.108, y, 0.0400, 0.0560, 0.070, 0.0026) for y in np.linspace(-0.031, 0.031, 9)]
    feet = [cuboid(0.108 + a, b, 0.0140, 0.0205, 0.007, 0.007) for a in (-0.042, 0.042) for b in (-0.034, 0.034)]
    return joined(box, *fins, *feet)


def motor_controller() -> Any:
    """Return the motor controller and the receiver behind the LiDAR, each a small case."""
    return joined(
        block(0.205, 0.024, 0.0140, 0.0290, 0.052, 0.034, 0.003),
        block(0.205, -0.026, 0.0140, 0.0240, 0.044, 0.028, 0.003),
    )


def battery() -> Any:
    """Return the battery between pan and deck."""
    return block(0.160, 0.0, -0.0125, 0.0100, 0.140, 0.062, 0.004)


def standoffs() -> Any:
    """Return the posts between pan and deck."""
    places = [
        (x, side * y) for x, y in ((-0.02, 0.034), (0.07, 0.046), (0.25, 0.052), (0.305, 0.040)) for side in (-1, 1)
    ]
    return joined(*(cuboid(x, y, -0.0130, 0.0110, 0.005, 0.005) for x, y in places))


def lidar_base() -> Any:
    """Return the LiDAR but for its window, in the frame of the body `hokuyo`, whose origin the beams leave."""
    cap = upright_lathe([(0.0235, 0.011), (0.0235, 0.020), (0.0205, 0.023)], 24)
    return joined(block(0.0, 0.0, -0.047, -0.0085, 0.050, 0.050, 0.006), cap)


def lidar_window() -> Any:
    """Return the LiDAR's window, which its beams go through."""
    return upright_lathe([(0.0226, -0.0090), (0.0226, 0.0112)], 24)


def tire() -> Any:
    """Return a tire with three rows of tread blocks, the middle one between the others."""
    r, w, rim = _TIRE_RADIUS - _TREAD_DEPTH, _TIRE_HALF_WIDTH, 0.0315
    profile = [(rim, -w + 0.002), (0.0400, -w), (r, -w + 0.005), (r, w - 0.005), (0.0400, w), (rim, w - 0.002)]
    parts = [lathe(profile, 24, closed=True)]
    count = 16
    for row, (middle, half) in enumerate(((-0.0135, 0.0048), (0.0, 0.0056), (0.0135, 0.0048))):
        for i in range(count):
            parts.append(_tread_block(2.0 * np.pi * (i + 0.5 * (row == 1)) / count, middle, half))
    return joined(*parts)


def _tread_block(angle: float, y: float, half: float) -> Any:
    """Return a block of the tread: its foot stands in the carcass, its top is narrower."""
    across, low, high = 0.0060, _TIRE_RADIUS - _TREAD_DEPTH - 0.0008, _TIRE_RADIUS
    rings = []
    for radius, shrink in ((low, 0.0), (high, 0.0007)):
        a, b = across - shrink, half - shrink
        rings.append([(radius, x, y + v) for x, v in ((-a, -b), (a, -b), (a, b), (-a, b))])
    up, x, v = np.moveaxis(np.array(rings), -1, 0)
    sin, cos = np.sin(angle), np.cos(angle)
    return loft(np.stack((up * sin + x * cos, v, up * cos - x * sin), axis=-1), ends=(False, True))


def rim() -> Any:
    """Return a wheel with five twin spokes, its outer face to the left."""
    lip = lathe([(0.0285, -0.019), (0.0325, -0.019), (0.0325, 0.0200), (0.0285, 0.018)], 20, closed=True)
    hub = lathe([(0.0080, 0.004), (0.0080, 0.0150), (0.0055, 0.0170)], 8)
    parts = [lip, hub]
    for i in range(5):
        for lean in (-0.14, 0.14):
            parts.append(_spoke(2.0 * np.pi * i / 5 + 0.0, lean))
    return joined(*parts)


def _spoke(angle: float, lean: float) -> Any:
    """Return a bar from the hub to the lip, dished, its outer end turned by `lean` [rad]."""
    rings = []
    for radius, y, half, at in (
        (0.0050, 0.0135, 0.0026, angle),
        (0.0180, 0.0150, 0.0021, angle + 0.8 * lean),
        (0.0295, 0.0180, 0.0024, angle + 1.5 * lean),
    ):
        sin, cos = np.sin(at), np.cos(at)
        rings.append(
            [
                (radius * sin + x * cos, v, radius * cos - x * sin)
                for x, v in ((-half, y - 0.005), (half, y - 0.005), (half, y), (-half, y))
            ]
        )
    return loft(rings)


def brake_disc() -> Any:
    """Return the hex and disc behind the spokes."""
    return lathe([(0.0210, -0.004), (0.0210, 0.002)], 14)


def knuckle() -> Any:
    """Return a front upright of the left side: kingpin post, stub axle and the arm that the tie rod pulls."""
    post = block(0.0, -0.030, -0.019, 0.019, 0.016, 0.012, 0.003)
    stub = lathe([(0.0055, -0.034), (0.0055, 0.004)], 8)
    arm = block(-0.016, -0.033, -0.004, 0.002, 0.036, 0.008, 0.002)
    return joined(post, stub, arm)


def knuckle_right() -> Any:
    """Return the mirror image of `knuckle`: the arm points back on both sides."""
    mesh = knuckle()
    mesh.vertices = mesh.vertices * (1.0, -1.0, 1.0)
    mesh.invert()
    return mesh


def carrier() -> Any:
    """Return a rear upright of the left side."""
    post = block(0.0, -0.030, -0.017, 0.017, 0.022, 0.012, 0.003)
    stub = lathe([(0.0055, -0.034), (0.0055, 0.004)], 8)
    return joined(post, stub)


PARTS: dict[str, Callable[[], Any]] = {
    part.__name__: part
    for part in (
        tub, deck, nose, stripe, bumper, rear_bumper, towers, computer, motor_controller, battery, standoffs,
        lidar_base, lidar_window, tire, rim, brake_disc, knuckle, knuckle_right, carrier,
    )
}  # fmt: skip
"""Makers of all parts, by name."""


def as_obj(mesh: Any) -> str:
    """Return a mesh as Wavefront OBJ text with a normal at each corner: round surfaces are smooth, edges sharp."""
    import trimesh

    shaded = trimesh.graph.smooth_shade(mesh, angle=_CREASE)
    normals = shaded.vertex_normals
    lines = [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in shaded.vertices]
    lines += [f"vn {x:.3f} {y:.3f} {z:.3f}" for x, y, z in normals]
    lines += ["f " + " ".join(f"{i + 1}//{i + 1}" for i in face) for face in shaded.faces]
    return "\n".join(lines).replace("-0.00000", "0.00000").replace("-0.000", "0.000") + "\n"


def write_all(folder: Path) -> None:
    """Write every part into a folder, as `name.obj`."""
    for name, make in PARTS.items():
        (folder / f"{name}.obj").write_text(as_obj(make()), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "models" / "assets"
    write_all(target)
    print(f"{target}: {', '.join(f'{name}.obj' for name in PARTS)}")
