"""What one scan costs: drawn as a picture (`raycast`), by Embree's rays, MuJoCo's sensors and its mj_multiRay.

    python benchmarks/lidar_backends.py [--track oval ...] [--scans 300] [--json FILE]

Medians, in one process on one core, the ways taking turns: scan after scan, and as in a race, each after the
physics steps of a tick, which empty the caches. Then how the cost grows with the number of wall segments: of a winding
corridor that gets longer, and of one that is cut finer.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from common import parser, report, stay_on_cores, table

from fg_mujoco.course.formats import track_names
from fg_mujoco.lidar.lidar import RaycastLidar, lidar_spec
from fg_mujoco.simulation.world import World

PREFIX = "lidar/"
BEAMS = 1081
Pose = tuple[float, ...]  # as a free joint has it in qpos
SEGMENTS = (100, 400, 1000, 2000, 5000)
SPACING = 0.5  # [m] of the corridor that gets longer
LENGTH = 200.0  # [m] of the one that is cut finer
HALF_WIDTH, HEIGHT, THICKNESS = 1.0, 0.3, 0.05  # [m]
WAVE_LENGTH, AMPLITUDE = 15.0, 1.0  # [m] of the corridor's winding


def embree(lidar: RaycastLidar, data: Any) -> Any:
    to_body = data.xmat[lidar.body].reshape(3, 3).T
    return lidar.cast(data, lidar.beams.origins @ to_body + data.xpos[lidar.body], lidar.beams.directions @ to_body)


def multi_ray(lidar: RaycastLidar, data: Any) -> Callable[[], object]:
    geoms, distances = np.zeros(BEAMS, np.int32), np.zeros(BEAMS)

    def cast() -> None:
        directions = lidar.beams.directions @ data.xmat[lidar.body].reshape(3, 3).T
        mujoco.mj_multiRay(
            lidar.model, data, data.xpos[lidar.body], directions.ravel(), None, True, lidar.body, geoms, distances,
            None, BEAMS, lidar.beams.range_max,
        )  # fmt: skip

    return cast


def medians(
    ways: dict[str, Callable[[], object]],
    draw_pose: Callable[[], Pose],
    put: Callable[[Pose], None],
    scans: int,
    before: Callable[[], object] = lambda: None,
) -> dict[str, float]:
    """Return the median time of a scan by each way [us]: ten scans by one, then the same ten poses by the next."""
    times: dict[str, list[float]] = {way: [] for way in ways}
    for way in ways.values():
        way()
    for _ in range(math.ceil(scans / 10)):
        poses = [draw_pose() for _ in range(10)]
        for name, way in ways.items():
            for pose in poses:
                put(pose)
                before()
                start = time.perf_counter()
                way()
                times[name].append(1e6 * (time.perf_counter() - start))
    return {way: float(np.median(taken)) for way, taken in times.items()}


def level(x: float, y: float, z: float, heading: float) -> Pose:
    return x, y, z, math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)


def on_track(track: str, scans: int) -> dict[str, dict[str, float]]:
    """Return the median time of a scan by each way on a track, in a row and in a race [us]."""
    plain, sensing = World(track), World(track, lidar="rangefinder")
    data, sensing_data = mujoco.MjData(plain.model), mujoco.MjData(sensing.model)
    lidar, sensors = plain.make_lidar(), sensing.make_lidar()
    assert isinstance(lidar, RaycastLidar)
    rng = np.random.default_rng(0)

    def draw_pose() -> Pose:
        x, y, heading = plain.track.start_pose(rng.uniform(0.0, plain.track.length), rng.uniform(-0.3, 0.3))
        return level(x, y, float(plain.model.qpos0[2]), heading + rng.uniform(-0.5, 0.5))

    def put(pose: Pose) -> None:
        for world, state in ((plain, data), (sensing, sensing_data)):
            state.qpos[:7], state.qvel[:] = pose, 0.0
            mujoco.mj_kinematics(world.model, state)

    ways = {
        "raycast": lambda: lidar.ranges(data),
        "Embree": lambda: embree(lidar, data),
        "rangefinder": lambda: sensors.ranges(sensing_data),
        "mj_multiRay": multi_ray(lidar, data),
    }
    return {
        "in a row": medians(ways, draw_pose, put, scans),
        "in a race": medians(ways, draw_pose, put, scans, lambda: mujoco.mj_step(plain.model, data, nstep=10)),
    }


def corridor_model(segments: int, length: float) -> Any:
    """A LiDAR on a free body, on the ground in a winding closed corridor of so many wall segments."""
    along = np.arange(segments // 2) * (math.tau / (segments // 2))
    waves = round(length / WAVE_LENGTH)
    radius = length / math.tau + AMPLITUDE * np.sin(waves * along)
    offsets = (-HALF_WIDTH, -HALF_WIDTH - THICKNESS, HALF_WIDTH, HALF_WIDTH + THICKNESS)  # faces and backs
    lines = [(radius + offset)[:, None] * np.column_stack((np.cos(along), np.sin(along))) for offset in offsets]
    vertices = np.concatenate([np.insert(line, 2, z, axis=1) for z in (0.0, HEIGHT) for line in lines])
    here = np.arange(len(along))
    ahead = np.roll(here, -1)
    bands = ((0, 4), (1, 5), (4, 5), (2, 6), (3, 7), (6, 7))  # face, back and top of each wall, between two lines
    faces = [
        np.column_stack((here + low * len(here), ahead + low * len(here), edge))
        for low, high in bands
        for edge in (ahead + high * len(here),)
    ] + [np.column_stack((here + a * len(here), ahead + b * len(here), here + b * len(here))) for a, b in bands]
    spec = mujoco.MjSpec()
    mesh = spec.add_mesh(name="walls", uservert=vertices.ravel(), userface=np.concatenate(faces).ravel())
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="walls", contype=0, conaffinity=0)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    car = spec.worldbody.add_body(name="car")
    car.add_freejoint()
    car.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.01, 0.01, 0.01), rgba=(0, 0, 0, 0))
    spec.attach(lidar_spec(sensors=False), frame=car.add_frame(), prefix=PREFIX)
    return spec.compile()


def in_corridor(segments: int, length: float, scans: int) -> dict[str, float]:
    """Return the median time of a scan by each way in a corridor, in a row [us]."""
    model = corridor_model(segments, length)
    data = mujoco.MjData(model)
    lidar = RaycastLidar(model, PREFIX)
    rng = np.random.default_rng(0)
    waves = round(length / WAVE_LENGTH)

    def draw_pose() -> Pose:
        angle = rng.uniform(0.0, math.tau)
        radius = length / math.tau + AMPLITUDE * math.sin(waves * angle)
        heading = angle + 0.5 * math.pi + rng.uniform(-0.5, 0.5)
        return level(radius * math.cos(angle), radius * math.sin(angle), 0.11, heading)

    def put(pose: Pose) -> None:
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)

    ways = {
        "raycast": lambda: lidar.ranges(data),
        "Embree": lambda: embree(lidar, data),
        "mj_multiRay": multi_ray(lidar, data),
    }
    return medians(ways, draw_pose, put, scans)


def table_of(head: str, rows: dict[str, dict[str, float]]) -> str:
    ways = list(next(iter(rows.values())))
    header = (head, *(f"{way} [us]" for way in ways))
    return table(header, [(name, *(f"{us:.1f}" for us in times.values())) for name, times in rows.items()])


def main() -> None:
    """Print the tables."""
    arguments = parser(__doc__)
    arguments.add_argument("--track", nargs="*", default=list(track_names()))
    arguments.add_argument("--scans", type=int, default=300)
    args = arguments.parse_args()
    stay_on_cores(1)
    tracks = {track: on_track(track, args.scans) for track in args.tracks}
    figures = {
        "in a row": {track: times["in a row"] for track, times in tracks.items()},
        "in a race": {track: times["in a race"] for track, times in tracks.items()},
        f"wall segments of {SPACING} m": {str(n): in_corridor(n, 0.5 * n * SPACING, args.scans) for n in SEGMENTS},
        f"wall segments in {LENGTH:.0f} m": {str(n): in_corridor(n, LENGTH, args.scans) for n in SEGMENTS},
    }
    tables = [f"One scan of {BEAMS} beams on one core, median of {args.scans}"]
    tables.append(table_of("in a race", figures["in a race"]))  # the JSON has the other ones, too
    report({"scans": args.scans, "median_us_per_scan": figures}, "\n\n".join(tables), args.json)


if __name__ == "__main__":
    main()
