"""A run whose decisions are looked at: a window of them, as objects or as a page."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from fg_mujoco.arguments import explain_class
from fg_mujoco.course.files import kept_folder
from fg_mujoco.errors import FgMujocoError, RunFolderError, SettingsError
from fg_mujoco.messages import Controller, FloatArray, LaserScan, Odometry
from fg_mujoco.pictures.rendering.recorded_drive import Drive, read_drive
from fg_mujoco.racing.resimulation import load_world, recorded_planner, resimulate
from fg_mujoco.racing.result import RaceResult
from fg_mujoco.racing.run_folder import Run, read_failed_scan, read_run
from fg_mujoco.racing.summary import FAILED_SCAN
from fg_mujoco.simulation.world import World

from ..report.recorded import RecordedRun, map_shapes, read_recorded
from .debug_page import debug_page
from .decisions import Witness
from .window import Window

WINDOW = 3.0  # [s]
LONGEST_WINDOW = 30.0  # [s] of a page, which then has some 20 MB


@explain_class
class DebuggedRun(Window):
    """A window of a run's decisions, which can be written as a page."""

    def write_page(self, path: str | Path) -> Path:
        """Write the page to step through the decisions, and return its path; or RunFolderError."""
        return debug_page(self, Path(path))


@kept_folder()
def debug(
    source: RaceResult | Run | str | Path,
    *,
    at: float | None = None,
    window: float = WINDOW,
    controller: str | None = None,
) -> DebuggedRun:
    """Return the decisions of a run folder, a Run or a RaceResult round a time, each with its scan and what held it.

    The run is driven again and a planner is called along with it: of a race that was driven in this process its own, of
    a run folder the `controller` that is named, whose settings without brackets are those recorded. Without one there
    are scans and commands alone. `at` [s] is the middle of the window [s]; None: the window is at the end. Raises
    RunFolderError: a folder that is none of `race --out`, lacks a file, or is of another version; SettingsError: a time
    that is not in the run, or a window that is not above 0 or above 30 s.
    """
    if not 0.0 < window <= LONGEST_WINDOW:
        raise SettingsError(f"window is {window:g}; accepted: seconds above 0, at most {LONGEST_WINDOW:g}")
    run: RaceResult | Run = source if isinstance(source, (RaceResult, Run)) else read_run(source)
    recorded, drive = read_recorded(run), read_drive(run)
    world = load_world(run) if isinstance(run, Run) else World.from_xml(drive.xml, lidar=run.setup.lidar)
    failed = _failed_scan(run)
    first, end, chosen = _window(drive, at, window, failed is not None)
    notes: list[str] = []
    witness = Witness(_planner(drive, recorded, controller, notes), recorded.car)
    decisions = []
    for tick, again in enumerate(resimulate(drive, world)):
        if tick >= end:
            break
        scan, odometry = again.sensed.scan, again.sensed.odometry
        witness.look_round(again.surroundings(world))
        answer = witness.decide(scan, odometry, again.command)
        if tick >= first:
            look = witness.look(tick, scan, odometry, again.command, answer)
            decisions.append(replace(look, pose=np.array(again.sensed.pose)))  # and not as it is told
    if failed is not None and end > len(drive.ctrl):
        told = recorded.planner_failure or {}
        text = "\n".join(str(told.get(name)) for name in ("error", "traceback") if told.get(name))
        witness.decide(*failed, None)
        decisions.append(witness.look(len(drive.ctrl), *failed, None, None, text or "the planner failed"))
    if not decisions:
        raise RunFolderError(f"{recorded.source}: there is no decision in it; accepted: a run of a tick or more")
    if witness.differing:
        notes.append(
            f"In {witness.differing} of {witness.asked} decisions up to here the planner answers now another command "
            "than the recorded one, so its intermediate scans and reasons may be others, too."
        )
    notes += [f"{remark[:1].upper()}{remark[1:]}." for remark in witness.remarks]
    poses = np.array([decision.pose for decision in decisions])
    shapes = map_shapes(recorded.model, recorded.end)
    near = _near([*shapes.walls, *shapes.obstacles], poses, decisions[0].scan.range_max)
    return DebuggedRun(
        run=recorded, decisions=tuple(decisions), at=chosen - first, notes=tuple(notes), walls=near,
        moving=[[each.corners(decision.time) for each in world.moving] for decision in decisions],
    )  # fmt: skip


def _window(drive: Drive, at: float | None, window: float, failed: bool) -> tuple[int, int, int]:
    """Return the first tick of the window, the one behind its last, and the one that was asked for."""
    last = len(drive.ctrl) - (0 if failed else 1)  # the failed decision has no tick of its own
    chosen = last if at is None or (failed and at >= drive.end - 1e-9) else drive.tick_at(at)
    period = float(drive.time[1] - drive.time[0]) if len(drive.ctrl) else 1.0
    count = max(math.ceil(window / period - 1e-9), 1)
    first = chosen - count // 2 if at is not None else last - count + 1
    first = max(min(first, last - count + 1), 0)
    return first, min(first + count, last + 1), chosen


def _planner(drive: Drive, recorded: RecordedRun, controller: str | None, notes: list[str]) -> Controller | None:
    """Return the planner that is asked again, or None and a note why there is none."""
    try:
        return recorded_planner(
            recorded.summary, recorded.model, controller=controller, where=recorded.source, raced_here=drive.raced_here
        )
    except (FgMujocoError, KeyError, OSError, TypeError, ValueError) as error:
        why = " ".join(str(error).split())
        notes.append(f"The page has scans and commands, without the planner's work: {why}.")
        return None


def _failed_scan(run: RaceResult | Run) -> tuple[LaserScan, Odometry] | None:
    """Return what the planner was told when it failed; None: it did not."""
    if isinstance(run, RaceResult):
        failure = run.car.planner_failure
        return None if failure is None else (failure.scan, failure.odometry)
    return read_failed_scan(run.folder) if (run.folder / FAILED_SCAN).exists() else None


def _near(outlines: list[FloatArray], poses: FloatArray, reach: float) -> list[FloatArray]:
    """Return the outlines that come within reach [m] of some poses (n, 3); x and y of the outlines to 1 mm."""
    low, high = np.fmin.reduce(poses[:, :2]) - reach, np.fmax.reduce(poses[:, :2]) + reach
    return [
        np.round(outline, 3)
        for outline in outlines
        if (outline.max(axis=0) >= low).all() and (outline.min(axis=0) <= high).all()
    ]
