"""Functions of the native core, which is compiled from native/. Arrays are contiguous, of these very types."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

_Numbers = NDArray[np.float64]
_Whole = NDArray[np.int64]
_Short = NDArray[np.int32]
_Tuple = tuple[Any, ...]
_Single = NDArray[np.float32]
_Flags = NDArray[np.bool_]
_Records = NDArray[np.void]
_Record = np.void | _Records

INTERFACE: int
SOURCES: str
"""Hash of the sources that it was built from."""
RECORDS: dict[str, tuple[int, dict[str, int]]]
"""Records by name: their size, and the offsets of their fields [bytes]."""
STEPS: dict[str, int]
"""Steps of planners by name: addresses of functions in C of the address of a stage's table."""
CALL_PYTHON: int
"""Address of a function in C that calls an object without arguments, by its `id`."""

class Scene:
    """The input of a scan, or of points, checked: SceneArrays of lidar/visible_surfaces.py."""

    def __init__(
        self, beams: _Numbers, limits: _Numbers, edges: _Numbers, triangles: NDArray[np.uint16], boxes: _Numbers,
        spans: _Short, planes: _Numbers, frames: _Short, shapes: _Numbers, spheres: _Numbers,
    ) -> None: ...  # fmt: skip
    def along(self, beams: _Numbers, limits: _Numbers) -> Scene:
        """Return the same scene for other beams."""

class Scratch:
    """Working arrays of scans: Scratch of lidar/visible_surfaces.py."""

    def __init__(
        self, cuts: _Numbers, columns: _Short, nearest: _Numbers, views: _Short, bins: _Short, poses: _Numbers
    ) -> None: ...

def cast_bursts(
    scene: Scene, elevations: _Numbers, materials: _Numbers, joint: int, offset_position: _Numbers,
    offset_rotation: _Numbers, tree: int, links: _Records, before: _Numbers, after: _Numbers, shares: _Numbers,
    placed: _Numbers, first: int, out: _Numbers,
) -> None:  # fmt: skip
    """Write the points of bursts to `out`, see PointCaster.cast of lidar/point_cloud.py."""

class Poses:
    """Arrays of a BodyPoses."""

    def __init__(
        self, sources: _Short, offset_positions: _Numbers, offset_rotations: _Numbers, positions: _Numbers,
        rotations: _Numbers,
    ) -> None: ...  # fmt: skip

def scan(
    scene: Scene, scratch: Scratch, position: _Numbers, rotation: _Numbers, moving_positions: _Numbers,
    moving_rotations: _Numbers, out: _Numbers, own_tree: int,
) -> None:  # fmt: skip
    """Write the readings of one scan to `out`."""

def scan_poses(
    scene: Scene, scratch: Scratch, positions: _Numbers, rotations: _Numbers, optics: _Numbers, out: _Numbers
) -> None:  # fmt: skip
    """Write the readings with the LiDAR at the first of some poses, and what moves at the others."""

def scan_state(
    scene: Scene, scratch: Scratch, poses: Poses, qpos: _Numbers, mocap_pos: _Numbers, mocap_quat: _Numbers,
    xpos: _Numbers, xmat: _Numbers, optics: _Numbers, out: _Numbers,
) -> None:  # fmt: skip
    """Do `read_poses`, then `scan_poses`."""

def read_poses(
    poses: Poses, qpos: _Numbers, mocap_pos: _Numbers, mocap_quat: _Numbers, xpos: _Numbers, xmat: _Numbers
) -> None:
    """Write the poses at the state of a mujoco.MjData."""

def mounted_pose(
    pose: _Numbers, level: bool, offset_position: _Numbers, offset_rotation: _Numbers, position: _Numbers,
    rotation: _Numbers,
) -> None:  # fmt: skip
    """Write the pose of what is fixed to a free body."""

def link_fields() -> dict[str, int]:
    """Return the offsets of the fields of a link [bytes]."""

def draw_shares(state: _Whole, out: _Numbers) -> None:
    """Draw numbers from 0 to 1."""

def draw_normals(state: _Whole, limits: _Whole, widths: _Numbers, heights: _Numbers, out: _Numbers) -> None:
    """Draw standard normal numbers."""

def apply_effects(
    rows: _Whole, ranges: _Numbers, states: _Whole, limits: _Whole, widths: _Numbers, heights: _Numbers,
    deviations: _Numbers, noise: _Numbers, dropouts: _Numbers, shares: _Numbers, no_returns: _Numbers, lates: _Whole,
    sweeps: _Whole, held: _Numbers, table_of: _Whole, knots: _Numbers, values: _Numbers, range_min: float,
    range_max: float,
) -> None:  # fmt: skip
    """Apply effects to some rows of ranges, in place."""

def add_noise(ranges: _Numbers, deviation: float, range_max: float, noise: _Numbers) -> None:
    """Turn noise into ranges with noise."""

def error_at(knots: _Numbers, values: _Numbers, which: int, distance: float) -> float:
    """Return noise, bias or dropout at a distance [m]."""

# controllers/control

def slip_angle(axle: _Record, force: float) -> float:
    """Return the slip angle [rad] at which an axle has a lateral force over its load."""

def held_on_arc(
    slip: _Record, car: _Record, angle: float, lateral: float, back: bool, brakes: bool, use: float
) -> float:
    """Return the acceleration over g at which an inner tire has a share of its peak."""

def steered(slip: _Record, car: _Record, angle: float, speed: float) -> float:
    """Return the steering angle [rad] with which a car runs on the arc of an angle [rad]."""

def arc_angle(slip: _Record, car: _Record, steering_angle: float, speed: float) -> float:
    """Return the angle [rad] of the arc on which a car runs in the end."""

def find_tightest(
    slip: _Record, speeds: _Numbers, forces: _Numbers, lock: float, wheelbase: float, gravity: float
) -> None:
    """Write the arcs at the lock, for 128 speeds [m/s] and greatest lateral accelerations over g."""

def tightest_arc(slip: _Record, speed: float) -> float:
    """Return the greatest angle [rad] of an arc at a speed [m/s]."""

def lock_arc(slip: _Record, car: _Record) -> float:
    """Return the angle [rad] of the tightest arc of a slow car."""

def stable_braking(slip: _Record, use: float, speed: float) -> float:
    """Return the braking over g up to which a car is stable."""

def held_arc(slip: _Record, car: _Record, angle: float, curvature: float) -> float:
    """Return the angle [rad] of the arc to command so that a car keeps its path."""

def path_lag(slip: _Record, speed: float) -> float:
    """Return the way [m] over which the path of a car follows its steering."""

def drag(car: _Record, speed: float) -> float:
    """Return by how much friction of gears and of rolling slows a car [m/s^2]."""

def ground_speed(slip: _Record, car: _Record, wheels: float, angle: float, command: float) -> float:
    """Return how fast a car moves [m/s], by its wheels."""

def friction_speed(steering_angle: float, mu: float, wheelbase: float, gravity: float) -> float:
    """Return the greatest speed [m/s] on the circle of a steering angle [rad]."""

def friction_steering(speed: float, mu: float, wheelbase: float, gravity: float) -> float:
    """Return the greatest steering angle [rad] at a speed [m/s]."""

def distance_ahead_speed(distance: float, safe: float, full_speed: float, top_speed: float) -> float:
    """Return a speed [m/s] by the distance straight ahead [m]."""

def mean_range_speed(ranges: _Numbers, lookahead: float, gain: float, top_speed: float) -> float:
    """Return a speed [m/s] by the mean of ranges [m]."""

def saturate(value: float, limit: float) -> float:
    """Return a value held within +-`limit`."""

def pursue(bearing: float, distance: float, lidar_offset: float, wheelbase: float) -> float:
    """Return the steering angle [rad] whose arc leads the rear axle through a goal."""

def arc_through(x: float, y: float, wheelbase: float) -> float:
    """Return the steering angle [rad] whose arc leads the rear axle through a place [m]."""

def bearing_of_arc(steering_angle: float, distance: float, lidar_offset: float, wheelbase: float) -> float:
    """Return the bearing [rad] of a point at a distance [m] on the arc of a steering angle [rad]."""

def late_by(car: _Record) -> float:
    """Return by how much later than on the F1TENTH car the wheels turn [s]."""

def next_point(points: _Numbers, index: int, x: float, y: float, heading: float) -> int:
    """Return the index of the first point of a motion (n, 4 or more) that lies ahead of the car."""

def errors(point: _Numbers, x: float, y: float, heading: float) -> tuple[float, float, float]:
    """Return the position of a car on the arc that ends at a point of a motion."""

def steer_along(
    points: _Numbers, index: int, pose: tuple[float, float, float], speed: float, wheelbase: float, late: float,
    path_late: float,
) -> float:  # fmt: skip
    """Return the steering angle [rad] that keeps a car on a motion (n, 4 or more)."""

def refer_to_goal(tick: _Record, filtered: _Numbers, bearing: float, distance: float) -> None:
    """Write the reference that leads to a goal."""

def refer(
    tick: _Record, filtered: _Numbers, steering_angle: float, speed: float, bearing: float, distance: float
) -> None:
    """Write a reference, no faster than by the law of the mean range."""

def propose(
    tick: _Record, trajectories: _Record, ranges: _Numbers, ranges_without_movers: _Numbers, command: _Numbers,
    path: _Numbers, speed: float,
) -> bool:  # fmt: skip
    """Propose a motion to the judge in place of the planner's; return whether the car drives it."""

def read_speedometer(memory: _Record, speed: float, car: _Record, period: float) -> None:
    """Take a measured speed [m/s] into the memory of type SPEEDOMETER."""

def command_speed(
    memory: _Record, speed: float, car: _Record, max_speed: float, period: float, left_alone: float
) -> float:
    """Return the speed to command so that the measured one becomes `speed` [m/s], and keep it."""

def least_on_ring(bands: _Numbers, gradient: _Numbers, low: _Numbers, high: _Numbers, x: _Numbers) -> bool:
    """Write where a program on a ring is least to x (n,), and return whether the method converges."""

def solve_ring(bands: _Numbers, right: _Numbers, x: _Numbers) -> None:
    """Write x of H x = right (n,)."""

# controllers/safety: the friction limiter, the judge, motions and lines

class Ends:
    """Ends of beams by the squares in which they lie."""

def find_held(axles: _Numbers, mu: float, moved: float, soft: bool, shaft: bool, found: _Numbers) -> None:
    """Write the acceleration over g at each share of a limiter (257,), by numbers of both axles (6, 2)."""

def limited(
    limiter: _Record, memory: _Record, reference: tuple[float, float], least_lateral_use: float,
    present: tuple[float, float], period: float, planned: bool,
) -> tuple[float, float]:  # fmt: skip
    """Return the command nearest to a reference that the tires hold: steering angle [rad] and speed [m/s]."""

def held_on_circle(
    limiter: _Record, steering_angle: float, speed: float, now: float, least_lateral_use: float
) -> tuple[float, float]:
    """Return the steering angle [rad] and the speed [m/s] that a steady circle leaves of a reference."""

def longitudinal_share(limiter: _Record, lateral_use: float, braking: bool) -> float:
    """Return the share of braking or accelerating that is left at a share of the lateral grip."""

def simulate(here: _Tuple, plan: _Tuple, use: float, speed: float) -> tuple[float, float, int]:
    """Return Met of rollout.py, of a Situation and a Plan."""

def reading(here: _Tuple, bearing: float) -> float:
    """Return the widened reading [m] of a Situation at a bearing [rad]."""

def judge(here: _Tuple, wanted: _Tuple, memory: _Record) -> None:
    """Write the best of all proposals to a memory of type JUDGE, of a Situation and of Wanted."""

def search_motion(frontier: _Record, limiter: _Record, motion: _Record, query: _Tuple) -> bool:
    """Write the motion that a Query asks for; return whether there is one."""

def sorted_ends(world: _Record, count: int) -> Ends:
    """Return the first ends of beams of a local map by their squares."""

def touches(ends: Ends, car: _Record, x: float, y: float, cos: float, sin: float, margin: float) -> bool:
    """Return whether an end of a beam lies in the outline of a car, wider by a margin [m]."""

def speed_to_stop(geometry: _Record, ranges: _Numbers, limiter: _Record, settings: _Record) -> float:
    """Return the speed [m/s] from which the car stops ahead of what is in front of it."""

def keep_lap(remembered: _Record, geometry: _Record, ranges: _Numbers, odometry: _Record, driver: _Record) -> None:
    """Record the lap or find the car in it, and do a tick's part of the work on the line."""

def shape_line(line: _Record, lap: _Record, walls: _Numbers, limiter: _Record, max_speed: float) -> None:
    """Move the points of a line once, within the walls of the lap (n, beams, 3)."""

def propose_line(
    remembered: _Record, odometry: _Record, limiter: _Record, shift: float
) -> tuple[int, _Numbers, float, float]:
    """Return LineProposal of lap_raceline.py."""

def move_car(trial: _Record, limiter: _Record, since: float, period: float) -> None:
    """Move the car of a trial by a step of the model."""

def on_line(limiter: _Record) -> tuple[float, float]:
    """Return settings turn_in_use and lateral_use_in_braking of a car on its line."""

def describe_line(line: _Record, limiter: _Record) -> None:
    """Write what is known of each point of a line."""

def line_ahead(line: _Record, first: int, x: float, y: float, heading: float, limiter: _Record) -> _Numbers:
    """Return the points of a line from the one before `first` on, in the frame of a car. Shape (64, 7)."""

def write_speeds(window: _Numbers, spacing: float, limiter: _Record) -> None:
    """Write the greatest speed at each point of a window (n, 7)."""

def position_on(window: _Numbers, point: int, spacing: float) -> tuple[float, float, float]:
    """Return the position of the car between two points of a window (n, 7)."""

def speed_on(window: _Numbers, position: float, spacing: float, now: float) -> float:
    """Return the greatest speed [m/s] at a position in points of a window (n, 7)."""

def limited_grip(
    limiter: _Record, max_speed: float, uses: tuple[float, float, float], turning_use: float
) -> tuple[float, _Numbers, _Numbers, float, float, float, float, float, float]:
    """Return Grip of line_optimizer.py."""

def normals_of(line: _Numbers) -> _Numbers:
    """Return the directions to the left of the points of a closed line (n, 2)."""

def measure(line: _Numbers, bends: _Numbers, to: _Numbers, on: _Numbers) -> None:
    """Write the curvatures [1/m] of a closed line (n, 2), and the steps to each point and from it [m]."""

def begin_step(line: _Numbers, step: int, spacing: float) -> tuple[_Numbers, float]:
    """Return the points for a step (n, 2), and how far each may move then [m]."""

def improve(
    line: _Numbers, normals: _Numbers, room: tuple[_Numbers, _Numbers], step: int, weight: float, grip: _Tuple
) -> tuple[int, float]:
    """Move all points of a closed line (n, 2) once, and return the next step and its weight."""

def spread(line: _Numbers, count: int) -> _Numbers:
    """Return so many points at even steps on the closed curve through points (n, 2)."""

def fastest_lap(
    bends: _Numbers, steps: _Numbers, grip: _Tuple, speeds: _Numbers, by_bend: _Numbers, by_step: _Numbers
) -> float:
    """Return the time of a lap [s], and write speeds and derivatives (n,)."""

# controllers/perception

_Bytes = NDArray[np.uint8]
_Cells = NDArray[np.uint16]

def mark_cells(world: _Record, bits: _Bytes) -> int:
    """Write the bits of all cells (256, 256), and how near walls are to the map's; return how many may be free."""

def cell_at(x: float, y: float) -> int:
    """Return the cell at a place [m]."""

def dijkstra(bits: _Bytes, distance: _Cells, distance_to_goal: _Cells, goal: _Cells, free: int) -> None:
    """Write the way to go [0.01 m] from all free cells (65536,), and of blocks (128, 128), to the nearest of `goal`."""

def search_frontier(
    geometry: _Record, ranges: _Numbers, odometry: _Record, lidar_offset: float, memory: _Record, every: int,
    every_plain: int, led: bool,
) -> None:  # fmt: skip
    """Take a scan and odometry into the memory, in every tick; search the frontier after some of them."""

def move(memory: _Record, speed: float, yaw_rate: float, period: float) -> None:
    """Take the car on by one tick, and make the cells unknown that come into the window."""

def enter_scan(memory: _Record, geometry: _Record, ranges: _Numbers, lidar_offset: float) -> None:
    """Enter a scan of readings (n,) [m], without NaN or inf, into a local map."""

def extend_path(memory: _Record, geometry: _Record, ranges: _Numbers) -> None:
    """Add the car's place to its path, with the room to its sides, if the last point is far enough behind."""

def cut_path(memory: _Record, along: float) -> None:
    """Cut the path off beyond a place [m] along it."""

def in_window(memory: _Record, i: int, j: int) -> bool:
    """Return whether the map has a cell, by its column and row."""

def see_lap(lap: _Record, geometry: _Record, ranges: _Numbers, odometry: _Record, lidar_offset: float) -> None:
    """Take the car on by one tick, and record or match a scan."""

def walls_of(lap: _Record, geometry: _Record, count: int, lidar_offset: float) -> _Numbers:
    """Return where the beams kept at each place ended, x and y [m], and on which side. Shape (places, 64, 3)."""

def track_targets(
    memory: _Record, geometry: _Record, ranges: _Numbers, odometry: _Record, lidar_offset: float, course: float
) -> int:
    """Follow what is in a scan, and return how many targets move; `course` is where the car moves [rad]."""

def valid_ranges(ranges: _Numbers, range_max: float) -> _Numbers:
    """Return ranges with every beam a distance in [0, range_max].

    No return (+inf) is `range_max`; too close (-inf, or negative) is 0; a failed reading (NaN) takes the nearer of its
    next valid neighbours on either side, so that a dropout is neither an obstacle nor a gap. Without any valid reading
    all are 0.
    """

def noise_of(ranges: _Numbers, range_max: float) -> float:
    """Return the standard deviation of readings [m]."""

def clip_to_lookahead(ranges: _Numbers, lookahead: float) -> _Numbers:
    """Return ranges cut off at `lookahead` [m]."""

def bubble_beams(ranges: _Numbers, radius: float, angle_increment: float) -> _Short:
    """Return the number of beams to either side of each one that pass its end within `radius` [m]."""

def safety_bubbles(ranges: _Numbers, beams: _Whole, angle_increment: float, radius: float) -> _Numbers:
    """Return ranges with a bubble of `radius` [m] round the end of each of `beams`."""

def extend_disparities(ranges: _Numbers, angle_increment: float, threshold: float, radius: float) -> _Numbers:
    """Return ranges with every edge widened by `radius` [m]."""

def widen_all(ranges: _Numbers, angle_increment: float, radius: float) -> _Numbers:
    """Return ranges with every reading widened by `radius` [m]."""

def greatest_beam(ranges: _Numbers) -> int:
    """Return the beam of the greatest of ranges, the rightmost of several; 0 of none."""

def mask_nearest(ranges: _Numbers, angle_increment: float, radius: float) -> _Numbers:
    """Return ranges with the bubble of `radius` [m] round the nearest point set to 0."""

def mask_bubble(ranges: _Numbers, angle_increment: float, radius: float) -> _Numbers:
    """Return ranges with beams to either side of the nearest set to 0, by an arctangent."""

def mask_points(ranges: _Numbers, angle_increment: float, radius: float) -> _Numbers:
    """Return ranges with all readings that end within `radius` [m] of the nearest point set to 0."""

def rolling_mean(ranges: _Numbers, angle_increment: float, radius: float) -> _Numbers:
    """Return the mean of each range over the bubble of `radius` [m] at its own end."""

def prioritise_centre(ranges: _Numbers, bearings: _Numbers, edge_weight: float = 0.999) -> _Numbers:
    """Return ranges weighted from `edge_weight` at the widest bearing to 1 straight ahead."""

def write_debug_run(kept: _Numbers, ranges: _Numbers, first: int, end: int) -> None:
    """Write `ranges[first:end]` into an intermediate scan (n,) [m], and NaN elsewhere."""

def chord(a: float, b: float, angle: float) -> float:
    """Return the distance [m] between the ends of two readings [m] with `angle` [rad] between them."""

def longest_run(ranges: _Numbers) -> tuple[int, int]:
    """Return the longest run of readings that are not 0."""

def runs_beyond(ranges: _Numbers, threshold: float, least: int) -> _Whole:
    """Return all runs of at least `least` readings beyond `threshold` [m]. Shape (gaps, 2)."""

def deepest_run(ranges: _Numbers, first: int, end: int, tolerance: float) -> tuple[int, int]:
    """Return the longest run within `ranges[first:end]` of readings at most `tolerance` [m] short of the greatest."""

def furthest_beam(ranges: _Numbers, first: int, end: int) -> int:
    """Return the beam of the greatest of `ranges[first:end]`; -1 where there are none."""

def disparities(ranges: _Numbers, first: int, end: int, threshold: float) -> _Whole:
    """Return the beams within `ranges[first:end]` whose next one to the left differs by more than a threshold [m]."""

def middle_of(first: int, end: int) -> float:
    """Return the position of the middle of a run, in beams."""

def range_at(ranges: _Numbers, position: float) -> float:
    """Return the reading [m] at a position between two beams: the nearer of the two."""

def run_around(ranges: _Numbers, beam: int, first: int, end: int) -> tuple[int, int]:
    """Return the run of readings above 0 that a beam is in, within `ranges[first:end]`."""

def sees(geometry: _Record, ranges: _Numbers) -> bool:
    """Return whether there is a scan to plan with."""

def bearing_of(geometry: _Record, beam: float) -> float:
    """Return the bearing of a beam [rad]."""

def bearings_of(geometry: _Record, first: int, end: int) -> _Numbers:
    """Return the bearings [rad] of the beams from `first` to before `end`."""

def nearest_beam(angle_min: float, angle_increment: float, ahead: float, left: float) -> float:
    """Return the beam whose bearing is nearest to that of a point; below 0 or beyond the last: there is none."""

def beams_between(geometry: _Record, count: int, right: float, left: float) -> tuple[int, int]:
    """Return the beams with bearings from `right` to `left` [rad], of so many: first, and last + 1."""

# controllers/safety: things that move, turns, recovery and planned stops

def interval(row: _Numbers, time: float) -> tuple[float, float]:
    """Return the interval of its line in which a target (12,) may be at a time [s]: ways from where it is now [m]."""

def occupied(row: _Numbers, time: float, bold: float) -> tuple[float, float]:
    """Return the same interval as the plan in time counts on; `bold` from 0 to 1, as the car has waited."""

def meets(rows: _Numbers, ahead: float, left: float, radius: float, time: float) -> bool:
    """Return whether a disc at a place [m] could touch a target at a time [s]; `rows` are predictions (k, 12)."""

def write_predictions(memory: _Record) -> bool:
    """Predict the targets that move; return whether there is one."""

def separate(geometry: _Record, seen: _Numbers, ranges_without_movers: _Numbers, memory: _Record) -> None:
    """Take the targets out of a scan, copy it, and write how far each of them can go on and back."""

def turned(memory: _Record, angle: float) -> _Numbers:
    """Return the predictions (k, 12) in a frame that is turned to the left by an angle [rad] round the LiDAR."""

PROFILES: list[tuple[float, float, float, float]]
"""Of a plan in time: share of the onward speed and its time [s], twice; then the car brakes."""

def plan_in_time(
    here: _Tuple, plan: _Record, pose: tuple[float, float, float], goal: tuple[float, float], onwards: float,
    may_back_off: bool,
) -> tuple[int, float, float]:  # fmt: skip
    """Return what to do, DRIVES and so on, and the steering angle [rad] and the speed [m/s] of a car that drives.

    Args:
      here: a Situation.
      plan: of type PLAN_IN_TIME, written to.
      pose: x, y [m] and heading [rad] of the LiDAR in the frame of the targets.
      goal: bearing of the reference's goal from the LiDAR [rad], and its distance [m].
      onwards: speed at which the car would go on [m/s].
      may_back_off: whether the car stands, and may reverse.
    """

def reaches_of(car: _Record, rows: _Numbers, bold: float) -> _Numbers:
    """Return for each target (k,) how near its middle a disc of the car may come [m]."""

def spans_of(rows: _Numbers, bold: float) -> _Numbers:
    """Return for each step and target (53, 3 k) where it may be on its line [m]: from, to, and from if it turns now."""

def lay_path(among: _Tuple, x: float, y: float, path: _Numbers) -> int:
    """Write the path (56, 6) through a place [m] and on to the goal; return how many of its points are free."""

def try_profile(
    among: _Tuple, path: _Numbers, free: int, profile: tuple[float, float, float, float], turns_now: bool
) -> tuple[float, float]:
    """Return the room beside targets and the way [m] of a profile on a path; `turns_now`: if targets turn back now."""

def judge_path(among: _Tuple, path: _Numbers, free: int, cost: float, scores: _Numbers) -> None:
    """Write the scores [m] of all profiles on a path."""

def turn_in_moves(
    frontier: _Record, limiter: _Record, memory: _Record, steering_angle: float, speed: float, period: float
) -> None:
    """Begin, follow or end a turn in several moves. While it is active, its command is in the memory."""

def reverses(
    memory: _Record, settings: _Record, world: _Record, speed: float, stands: bool, found: bool, waits: bool,
    period: float,
) -> bool:  # fmt: skip
    """Return whether the car is to reverse now, with the steering angle of `angle_back`.

    Args:
      memory: of type RECOVERY, written to.
      settings: fields of RecoverySettings.
      world: of type LOCAL_MAP.
      speed: present [m/s].
      stands: the car does not move.
      found: there is a way to a frontier.
      waits: no frontier is known, or something moves.
      period: of the tick [s].
    """

def angle_back(world: _Record, settings: _Record, car: _Record) -> float:
    """Return the steering angle [rad] back along the path of a local map; NaN: it is no longer than the reach."""

def safe_speed(
    trajectories: _Record, widened: _Numbers, angle_min: float, angle_increment: float, speed: float,
    steering_angle: float,
) -> float:  # fmt: skip
    """Return the greatest speed [m/s] with a free braking trajectory, 0 where there is none."""

def all_trajectories(
    limiter: _Record, settings: _Record, speeds: _Numbers, bearings: _Numbers, distances: _Numbers
) -> None:
    """Write bearings [rad] and distances [m] of the points of all braking trajectories that turn left."""

def call_all(calls: _Whole) -> None:
    """Call functions in C, (k, 2): the address of each, and the whole number that it is called with."""

def rectangle_distance(
    ax: float, ay: float, bx: float, by: float, half_length: float, half_width: float
) -> float:  # fmt: skip
    """Return the distance from a segment to a rectangle about the origin, its length along x; 0 where they overlap."""

def least_clearance(
    poses: _Numbers, segments: _Numbers, ahead: float, half_length: float, half_width: float
) -> float:  # fmt: skip
    """Return the least distance to segments, (1 or n, m, 4), of the rectangle whose middle is `ahead` of each pose."""

def clearances(
    poses: _Numbers, segments: _Numbers, ahead: float, half_length: float, half_width: float, found: _Numbers
) -> None:  # fmt: skip
    """Write to `found` (n,) the least distance at each pose (n, 3)."""

def time_lap(
    timers: _Records, i: int, lap_times: _Numbers, time: float, x: float, y: float, table: _Numbers, length: float,
    modulus: float,
) -> None:  # fmt: skip
    """Give timer i of (n,) of LAP_TIMER after `first_seen` the place x, y [m] of its car at a time [s].

    The times of its laps are written to `lap_times`, (n, at least one more than completed) [s]. `table`, `length` and
    `modulus` are those of the Course.
    """

def overlaps(
    low: _Numbers, high: _Numbers, other_low: _Numbers, other_high: _Numbers, blocks_low: _Numbers,
    blocks_high: _Numbers, found_first: _Whole, found_second: _Whole,
) -> int:  # fmt: skip
    """Return the number of pairs of boxes that overlap, and write as many of them as there is room for.

    Boxes are low and high corners (n, 2), (m, 2) and, of each 32 of the second kind in a row, (b, 2).
    """

def follow(x: float, y: float, near: float, table: _Numbers, modulus: float) -> tuple[float, float]:
    """Return progress and offset of a point [m], see course/projection.py."""

def by_sections(x: float, y: float, s: float, segment: int, table: _Numbers, on_left: bool) -> float:
    """Return the progress of a point by the sections of the stretch of its nearest segment; without any, `s`."""

def load_mujoco(path: str) -> None:
    """Look up the functions of the MuJoCo library in a file; RuntimeError: it is another one than was compiled for."""

def read_all(tables: _Whole, firsts: _Whole, which: _Flags) -> None:
    """Write the odometry of the cars `which` (r,), and the first columns of their rows of telemetry.

    Args:
      tables: addresses of the tables of several batches, see simulation/compiled_tick.py.
      firsts: of each the first row of its cars in `which`.
    """

def sense_all(tables: _Whole, firsts: _Whole, which: _Flags) -> None:
    """Do `read_all`, and write what the LiDARs of those cars measure, where scans are drawn."""

def drive_all(tables: _Whole) -> None:
    """Hold the commands for a tick in worlds where any car races, and write what tires and chassis did meanwhile."""

def judge_all(tables: _Whole) -> None:
    """Time the laps of the cars that race and end what is over; without a course there are none."""

def read_times(tables: _Whole, firsts: _Whole, times: _Numbers) -> None:
    """Write the time of each world (n,) of several tables [s]; `firsts` as in `read_all`."""

def read_motions_all(
    tables: _Whole, firsts: _Whole, which: _Flags, poses: _Numbers, velocities: _Numbers
) -> None:  # fmt: skip
    """Do `motion.read_motions` for each of several tables, as `read_all`; all arrays have the rows of `which`."""

def hold(table: int, count: int) -> None:
    """Write the commands of all cars of the first `count` worlds of `ids` to their actuators, and to the telemetry."""

def step(table: int, count: int, first: int, end: int, advance: bool) -> None:
    """Do steps `first` up to `end` of a tick in the first `count` worlds of `ids`; not `advance`: work out forces."""

def book(table: int, count: int) -> None:
    """Note failures, touches, telemetry and statistics of a tick's steps in the first `count` worlds of `ids`."""

def ticks(
    table: int, calls: _Whole, limit: float, kept: int, took: _Numbers, waiting: _Flags
) -> tuple[int, int]:  # fmt: skip
    """Do several ticks of worlds of one car; return how the worst of them ended, and how many the last world did.

    A world does all its ticks before the next one, so that what it remembers stays near the processor. A car whose
    command is no number is not driven, and does none of the ticks that follow. A single tick all worlds do together,
    and none is driven then.

    Args:
      calls: of the planners, as in `call_all`.
      limit: of a decision [s].
      kept: address of a table of KEPT; for more than a tick, of one world.
      took: (k,) [s] of each decision of the last world, written to; of one that raises, less the time of its beginning.
      waiting: (r,) False; where a decision raises, the cars that run and are not marked as running are left there.
    """

def end_row(row: _Numbers, slip: _Numbers) -> None:
    """Write to a tick's `row` (len(TELEMETRY),) what the tires did: `slip` (QUANTITIES, steps, 4) of `measure_slip`."""

def add_row(statistics: _Records, i: int, row: _Numbers, slip: _Numbers) -> None:
    """Add a tick's `row` to the running statistics (n,) of STATISTICS at `i`; arguments as in `end_row`."""

def outline(
    vertices: NDArray[np.float32], starts: _Short, ends: _Whole, places: _Numbers, turns: _Numbers, points: _Numbers
) -> None:  # fmt: skip
    """Write the corners of prisms from above into `points` (k, 2) [m], counterclockwise about each one's middle.

    Args:
      vertices: (v, 3) of all prisms, in their own frames [m].
      starts, ends: (n,) where in `vertices` those of a prism begin, and where in `points` they end.
      places, turns: (n, 3) [m] and (n, 4) wxyz of the prisms.
    """

def fill(points: _Numbers, ends: _Whole, corner: _Numbers, distances: _Numbers) -> None:
    """Lower the distances from cells to the convex outlines of `points` (k, 2) that end before `ends`."""

def touches_nothing(
    qpos: _Numbers, cars: _Records, distances: _Numbers, corner: _Numbers, bodies: _Numbers
) -> bool:  # fmt: skip
    """Return whether the `cars` (m,) of a world are clear of all that is solid, as they are now; see ClearGround."""

# --- vehicle ---

def planar_pose(qpos: _Numbers, car: _Records) -> tuple[float, float, float]:
    """Return x [m], y [m] and heading [rad] of base_link in the world; `car` is (1,) of vehicle.motion.CAR."""

def uprightness(qpos: _Numbers, car: _Records) -> float:
    """Return the cosine of base_link's tilt: 1 on its wheels, 0 on its side, -1 on its roof."""

def is_rolled_over(qpos: _Numbers, car: _Records) -> bool:
    """Return whether a car is tilted by more than ROLLED_OVER."""

def speed_ahead(qpos: _Numbers, qvel: _Numbers, car: _Records) -> float:
    """Return the true speed of base_link along its heading [m/s], forward positive."""

def surface_speed(qvel: _Numbers, car: _Records) -> float:
    """Return the mean surface speed of the wheels [m/s]."""

def read_odometry(
    time: float, qpos: _Numbers, qvel: _Numbers, sensordata: _Numbers, car: _Records, odometry: _Records
) -> None:
    """Write what the car's own sensors say into `odometry`, an array (1,) of messages.ODOMETRY, and the true pose.

    Encoders, steering sensor, gyro and pose are of the present state; the accelerometer is that of `sensordata`.
    """

def body_velocity(qpos: _Numbers, qvel: _Numbers, car: _Records) -> tuple[float, float]:
    """Return the velocity of base_link over the ground, forward and to the left of its heading [m/s]."""

def point_motion(
    qpos: _Numbers, qvel: _Numbers, ahead: float, car: _Records
) -> tuple[float, float, float, float, float, float]:
    """Return the motion of a point `ahead` [m] of base_link: x, y [m], heading [rad], velocity, yaw rate [rad/s].

    Its velocity over the ground is that forward and to the left of the heading [m/s].
    """

def sideslip_angle(vx: float, vy: float, yaw_rate: float, car: _Records) -> float:
    """Return the angle from the heading to the velocity of the centre of gravity [rad], left positive, as in ISO 8855.

    It is pi where a car goes straight back, NaN below SIDESLIP_SPEED. `vx` and `vy` [m/s] are of `body_velocity`.
    """

def drive_car(steering_angle: float, speed: float, car: _Records, ctrl: _Numbers) -> None:
    """Write a command [rad, m/s] to the actuators, held within their limits."""

def look_at_floor(
    x: float, y: float, heading: float, wheels: _Numbers, patches: _Numbers, mu: _Numbers, under: _Numbers
) -> None:
    """Write what each tire has on the floor `under` it (4,) [-], of a car at x, y [m] and heading [rad] in the world.

    `wheels` (4, 2) are of `wheel_positions`, patches (n, 7) of `patch_table`, `mu` (4,) of the tires on the ground [-].
    """

def curve_force(law: int, numbers: _Numbers, slip: float) -> float:
    """Return the force over the load [-] of a law's tire at a slip without sign; `numbers` (NUMBERS,) are its row."""

def sampled_force(numbers: _Numbers, slip: float) -> float:
    """Return that of a table, of tires.sampled."""

def grip_of(tire: _Record, load: float, mu: float) -> float:
    """Return the load [N] times what scales the curves of a tire: its load sensitivity, and its lateral peak `mu`."""

def curve_peaks(tire: _Record, load: float, mu: float) -> tuple[float, float]:
    """Return the greatest force of a tire along its heading and across [N]; arguments as in `grip_of`."""

def deflect(
    tire: _Record, along: float, across: float, over_x: float, over_y: float, forward: float, grip: float,
    timestep: float,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """Return the deflections of a contact patch after a short step [m], and its force then [N].

    Args:
      along, across: deflection before, along the heading and to the left [m].
      over_x, over_y: velocity of the contact point over the ground, likewise [m/s].
      forward: that of the wheel, without sign [m/s].
      timestep: [s].

    Returns:
      Deflections, forces, size of the slip over that of the peak, and how fast it slides, ahead and to the left [m/s].
    """

def measure_slip(
    records: _Numbers, start: int, axles: int, mu: _Numbers, tires: _Records, states: _Numbers, place: int,
    slip: _Numbers,
) -> None:  # fmt: skip
    """Work out the slip of the tires in each of some steps.

    Args:
      records: (at least steps, m) sensor readings, one row a step.
      start, axles: where in a row the tires' and the axles' are; axles -1: nowhere.
      mu: (steps, 4), or (1, 4) where all steps have the same.
      tires: (4,) of TIRE; none for the model `contact`.
      states: (at least steps, k) user data, one row a step, from `place` on; of tires with a curve.
      slip: (QUANTITIES, steps, 4), written to, by quantity, step, tire.
    """

def step_on_tires(model: int, data: int, gears: _Records, tires: _Records, mu: _Numbers, advance: bool) -> None:
    """Do a physics step of a model whose cars have tires of ours; not `advance`: work out its forces and sensors.

    Args:
      model, data: addresses of a mujoco.MjModel and a mujoco.MjData.
      gears, tires: of its cars, (m,) of GEAR and (k,) of TIRE.
      mu: (m, 4) [-].
    """

def steps_on_tires(
    model: int, data: int, gears: _Records, tires: _Records, mu: _Numbers, records: _Numbers, states: _Numbers
) -> None:
    """Do a physics step for each row of `records` and `states`; write sensordata and userdata there."""

def surface_at(model: int, x: float, y: float) -> tuple[float, float, float, float]:
    """Return the height of the ground of a model, by its address, at a place [m], and its normal of length 1."""

def step_on_contacts(model: int, data: int, gears: _Records) -> None:
    """Do a physics step of a model whose cars all stand on MuJoCo's contacts."""

# --- envs ---

class StepArrays:
    """The arrays of a step of an environment, n cars that learn; `table` is the address of one of compiled_step.NAMES.

    `tables` and `firsts` are as in `read_all`, of worlds of one car.
    """

    def __init__(self, table: int) -> None: ...
    def act(self, actions: _Numbers) -> int:
        """Note whose episodes go on, and convert their actions (n, 2) to commands; return what `read_actions` does."""

    def note(self) -> None:
        """Note by what races the tick is rewarded, after they were judged."""

    def reward(self) -> None:
        """Reward the tick by what was noted, see `reward_ticks`."""

    def drive_worlds(self, tables: _Whole, firsts: _Whole) -> None:
        """Hold the commands for a tick, judge the races, and note by what they are rewarded."""

    def step(self, tables: _Whole, firsts: _Whole, actions: _Numbers) -> int:
        """Do a whole step; return what `read_actions` does, before anything is written."""

    def read(self, scan: _Single, values: _Single) -> None:
        """Write what the cars have sensed, see `read_sensors`."""

    def observe(self, tables: _Whole, firsts: _Whole, which: _Flags, scan: _Single, values: _Single) -> None:
        """Take the scans and odometry of the cars `which` (n,), and write what all have sensed."""

def read_actions(
    actions: _Numbers, taken: _Flags, limits: _Numbers, share: float, planned: _Numbers, slow: float,
    targets: _Numbers, held_before: _Numbers, commands: _Numbers, clipped: _Whole,
) -> int:  # fmt: skip
    """Convert actions (n, 2) to commands (n, 2) of a tick, and count the clipped ones (n,) of the cars `taken` (n,).

    Args:
      limits: (7, 2) least and greatest action; what is asked for at 0, and more at 1; the time for which it is
        integrated [s], 0: it is the command itself; least and greatest command.
      share: by which a command comes nearer to what is asked for in a tick; 1: all of it.
      planned: (n, 2) commands of planners that the actions correct; (0, 2): they correct none.
      slow: planned speed below which corrections are smaller in proportion [m/s]; 0: nowhere.
      targets: (2, n, 2) what is asked for, and the command; of the last tick, brought up to date.
      held_before: (n, 2) written to: the actions, within their bounds; it may be `actions`.

    Returns:
      Where the first part of an action that is NaN is, counted through the rows; -1: none is, and all is written.
    """

def reward_ticks(
    driven: _Flags, progress: _Numbers, before: _Numbers, crashed: _Flags, sliding: _Numbers, impacts: _Numbers,
    weights: _Numbers, share: float, alone: bool, rewards: _Numbers, terms: _Numbers,
) -> None:  # fmt: skip
    """Write the four default terms of a tick; and its rewards (n,), where there are no other terms.

    Args:
      driven: (n,) the worlds in which it was driven; the others' rows are left as they are.
      progress, before: (n,) [m] now, and at the start of the tick, brought up to date.
      crashed, sliding, impacts: (n,) whether it crashed, share of the tick in which a tire slid, speed of it [m/s].
      weights: (4,) of a metre, of a crash, of a tick in which a tire slides all the while, and of 1 m/s of an impact.
      share: of what a tick gains, the most that its running costs take; inf: they are not bounded.
      alone: whether there are no other terms; else `sum_terms` bounds and sums them.
      terms: (2, k, n) written to: of each term the tick's value, and the sum of the episode, which it is added to.
    """

def sum_terms(driven: _Flags, running: _Flags, share: float, rewards: _Numbers, terms: _Numbers) -> int:
    """Bound the costs of a tick that are `running` (k,), and write the rewards (n,); arguments as of `reward_ticks`.

    Of terms that `reward_ticks` has not written, the values of worlds that were not driven become 0. Returns where the
    first value that is not finite is, counted through the rows of the terms; -1: all is written.
    """

def read_sensors(
    stride: int, ranges: _Numbers, odometry: _Numbers, actions: _Numbers, planned: _Numbers, beams: _Whole,
    range_max: float, columns: _Whole, low: _Single, high: _Single, scan: _Single, values: _Single,
) -> None:  # fmt: skip
    """Write the parts of an observation that are read off sensors, within their bounds `low` and `high` (k,).

    `columns` (k,) are numbers of the odometry; from its number on, of the actions, and of planners, which are needed
    where a column is of them. In the `scan` (n, beams seen) [m] no return reads `range_max`, too close or failed 0.
    Ranges and odometry have `stride` rows a car.
    """

def shift(which: _Flags, fresh: _Flags, frame: _Single, delayed: _Single, delays: _Whole) -> None:
    """Put a tick's frames (n, width) into their rings (n, ticks, width), newest first, where `which` (n,) is set.

    Write to all frames what was `delays` (width,) ticks ago; a `fresh` (n,) ring has been as the frame all the while.
    """

def scale(which: _Flags, scales: _Single, saturates: _Flags, frame: _Single) -> None:
    """Scale the frames (n, width). Where `saturates` (width,) is set, x becomes x / (1 + x), without a scale."""

def remember(which: _Flags, fresh: _Flags, frame: _Single, columns: _Whole, ring: _Single, last: _Whole) -> None:
    """Write some columns of the frames (n, all) to the rings (n, places, width); the first one fills all places."""

def recall(ring: _Single, last: _Whole, every: int, found: _Single) -> None:
    """Write to `found` (n, length, width) what the rings (n, places, width) have, the oldest first."""

def take_contacts(
    tables: _Whole, firsts: _Whole, how: int, counts: _Whole, touched_at: _Numbers, began: _Flags
) -> None:  # fmt: skip
    """Count new touches of all cars (r,), stop them (`how`, by ON_CONTACT), let them race on; see Contacts."""

def note_judged(table: int, driven: _Flags, substeps: int) -> None:
    """Write what the race monitor says of the cars `driven` (r,) to the table at an address; see TickStates."""

def note_slips(table: int, driven: _Flags) -> None:
    """Write there how fast the axles of the cars slipped at the start of a tick, the mean of both."""

def heading_errors(poses: _Numbers, places: _Numbers, table: _Numbers, errors: _Numbers) -> None:
    """Write the angles from a course's direction at `places` (n,) to the headings of `poses` (n, 3); its `table`."""

# Add-ons: arena, gym2d and realcar.

DRIVABLE_MARGIN: float
DRIVABLE_STEP: float

def drivable_lap(walls: _Numbers, start: _Numbers, table: _Numbers, length: float) -> _Numbers:
    """Return the poses (n, 3) of a lap of a length [m] between walls (m, 4), from a start (3,); none: (0, 3)."""

def ray_cast(pose: tuple[float, float, float], scan: _Numbers, scan_angles: _Numbers, vertices: _Numbers) -> None:
    """Write what a scan (n,) [m] reads with a convex shape of corners (4, 2) [m] in it, from x, y, heading."""

def friction_curve(slip: _Numbers, tire: _Numbers) -> _Numbers:
    """Return F_y / F_z [-] at slip angles [rad]; `tire` is stiffness, C, D, E."""

def simulate_segments(drive: _Tuple, segments: _Whole, starts: _Numbers, out: _Numbers) -> None:
    """Simulate segments (m, 2) of a SimulatedDrive of addons/realcar/single_track.py, each from its start (m, 5).

    Written are into `out` (n, 6) the states and what the accelerometer reads across the car [m/s^2].
    """

def follow_targets(of: _Tuple, time: _Numbers, lag: float, rate: float, out: _Numbers) -> None:
    """Write the angle of the front wheels [rad] at each time [s]: it follows targets, of a slope each.

    `of` are the knots [s], the targets [rad] and the slopes [rad/s], (k,) each.
    """

# add-ons: drivers

LINE_ROOM: float
"""[m] See ROOM of line_profile.py."""
WALL_CELL: float
"""[m] See Walls of map_raceline.py."""
MPC_STEPS: int
MPC_TIME: float
"""Steps of the horizon of line_mpc.py, and [s] of each."""

def limit_speeds(table: _Numbers, bend: _Numbers, limiter: _Record, cornering_use: float, braking_use: float) -> None:
    """Lower the speeds of a line to what the tires hold; see line_profile.py."""

def lqr_feedback(aside: float, angle: float, length: float) -> float:
    """Return the curvature [1/m] to steer more than the line's; see line_trackers.py."""

def solve_program(program: _Tuple, inputs: _Numbers, states: _Numbers, most: int) -> int:
    """Write the solution of a program, and return after how many steps it converged; see ltv_program.py."""

def plan_steering(
    line: _Numbers, nearest: int, odometry: _Record, driver: _Record, period: float, mpc: _Record
) -> tuple[float, float, int]:
    """Return the steering angle [rad] and the greatest speed [m/s] of a plan, and what they are by; see line_mpc.py."""

def place_at_command(odometry: _Record, car: _Record, angle: float, mpc: _Record) -> tuple[float, float, float, float]:
    """Return where the car is once a command reaches its servos, see line_mpc.py."""

def kinematic(ahead: _Numbers, car: _Record, a: _Numbers, b: _Numbers, c: _Numbers) -> None:
    """Write the system of a plan for the kinematic car, see line_mpc.py."""

def single_track(ahead: _Numbers, driver: _Record, a: _Numbers, b: _Numbers, c: _Numbers) -> None:
    """Write the system of a plan for the single-track car, see line_mpc.py."""

def goal_on_line(
    line: _Numbers, settings: _Record, driver: _Record, x: float, y: float, speed: float
) -> tuple[float, float]:
    """Return the place on a line that pure pursuit would steer to, seen for the first time: x and y [m]."""

def find_room(
    line: _Numbers, normals: _Numbers, walls: _Tuple, outline: tuple[float, float, float], most: float, low: _Numbers,
    high: _Numbers,
) -> None:  # fmt: skip
    """Write how far each point (n, 2) of a line may move along its normal, from `low` to `high` (n,), within `most`.

    `walls` are the arrays of Walls, see map_raceline.py, `outline` half of the width, the tail and the nose with the
    margin [m]: the room is between the wall points beside the car's rectangle, from its tail to its nose.
    """

# addons/drivers: drivers among other cars

def ground_points(geometry: _Record, ranges: _Numbers, points: _Numbers) -> int:
    """Write where beams end, ahead and left of the LiDAR, and points between, (k, 2) [m]; return how many."""

def room_beside(points: _Numbers, count: int, x: float, y: float, heading: float) -> tuple[float, float]:
    """Return how far it is from a place [m] to what stands to the left and to the right of a heading [rad]."""

def walk(points: _Numbers, count: int, x: float, y: float, heading: float, path: _Numbers) -> int:
    """Write a walk from a place [m] in the direction of a heading [rad] to `path` (k, 5); return its places."""

def find_boxes(geometry: _Record, ranges: _Numbers, noise: float, found: _Numbers) -> int:
    """Write where the middles of what may be boxes are, ahead and left of the LiDAR (k, 2) [m]; return how many."""

def watch_cars(memory: _Record, geometry: _Record, ranges: _Numbers, odometry: _Record, lidar_offset: float) -> bool:
    """Follow what is in a scan (n,) [m], and say whether there is a car; `memory`, OTHER_CARS, is written to."""

def follow_told(
    memory: _Record, told: _Record, geometry: _Record, ranges: _Numbers, odometry: _Record, car: _Record
) -> bool:
    """Have the cars that were told of as those that are followed, and say whether there is one."""

def hide_cars(memory: _Record, geometry: _Record, ranges: _Numbers) -> None:
    """Take cars out of a scan (n,) [m]; `memory` is of type RACING."""

def choose(memory: _Record, geometry: _Record, without: _Numbers, car: _Record, settings: _Record) -> float:
    """Decide for each car in sight whether to follow or to pass it; return the greatest speed [m/s], inf: any."""

def predict_cars(memory: _Record, car: _Record, braking: float, predictions: _Record) -> None:
    """Add the cars ahead or beside, braking by [m/s^2], to the predictions: three discs each, along the course."""

def take_lane(memory: _Record, own_speed: float, driver: _Record, settings: _Record, reference: _Record) -> None:
    """Write the reference beside the nearest car that is passed, if there is one: a motion, its steering, its speed."""

def sin(x: _Numbers, out: _Numbers) -> None:
    """Write the sine of each angle [rad]; this and the next are those of fg_mujoco/portable.py, of rows."""

def cos(x: _Numbers, out: _Numbers) -> None: ...
def tan(x: _Numbers, out: _Numbers) -> None: ...
def arcsin(x: _Numbers, out: _Numbers) -> None: ...
def arccos(x: _Numbers, out: _Numbers) -> None: ...
def exp(x: _Numbers, out: _Numbers) -> None: ...
def arctan2(one: _Numbers, other: _Numbers, out: _Numbers) -> None: ...
def hypot(one: _Numbers, other: _Numbers, out: _Numbers) -> None: ...
