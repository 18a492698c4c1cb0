"""Races a planner on maps of real courses, on tight ones of our own and on bundled tracks, and prints one table.

    python benchmarks/race_maps.py [--data ../shared/data] [--laps 5] [--speeds 4,8] [--controller gap_finder]
        [--maps f,icra2022] [--halls 0:20] [--tight 0:20] [--track oval,tight]
        [--noise 0.01 --dropout 0.01 --odometry-drift 0.05] [--reference] [--workers 2] [--json FILE]

All other settings are the defaults of a race. The maps are those of race_maps/ in `--data`, which are not part of the
repository; `--maps none` leaves them out. `--halls 0:20` adds twenty that are drawn (halls). `--tight 0:20` adds
random:0:tight to random:19:tight, two laps each at 8 m/s. `--reference` also drives one lap of pure_pursuit with the
map, undisturbed, at the same greatest speed: the last column is the best flying lap as a multiple of that lap. Ctrl-C
prints what is finished.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from common import parser, report, table
from halls import draw

import fg_mujoco as fg
from fg_mujoco.cli.progress import ProgressLine
from fg_mujoco.errors import ControllerError, FgMujocoError
from fg_mujoco.rollouts.workers import work_off
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED

SETTINGS = {"levine_slam": "[close=1.5]"}  # what a map needs that cannot be driven as it is
TIGHT_LAPS, TIGHT_SPEED = 2, 8.0  # [m/s]
REFERENCE = "pure_pursuit"
HEADER = (
    "course", "speed [m/s]", "laps", "end reason", "first lap [s]", "best flying lap [s]", "greatest sliding [m/s]",
    "collisions", f"of {REFERENCE}",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Job:
    """A race to be driven. It travels to a worker process."""

    name: str  # in the table
    course: str  # as `load_track` takes it
    speed: float  # [m/s] fastest that the planner may command
    laps: int
    controller: str
    noise: float  # [m]
    dropout: float
    odometry_drift: float
    reference: bool

    def __str__(self) -> str:
        return f"{self.name} at {self.speed:g} m/s"


@dataclass(frozen=True, kw_only=True)
class Row:
    """How a race went; names as in its summary. None: there is no such figure."""

    course: str
    speed_limit_m_s: float
    laps_requested: int
    laps_completed: int = 0
    end_reason: str = ""  # empty: it was not driven to an end
    message: str = ""  # why not
    first_lap_s: float | None = None
    best_flying_lap_s: float | None = None
    max_slide_m_s: float | None = None
    collisions: int = 0
    wrong_way: str | None = None  # where the car turned
    reference_lap_s: float | None = None

    @property
    def ratio(self) -> float | None:
        """The best flying lap as a multiple of the reference's lap."""
        if self.best_flying_lap_s is None or self.reference_lap_s is None:
            return None
        return self.best_flying_lap_s / self.reference_lap_s

    def cells(self) -> tuple[str, ...]:
        """Return what the table shows, in the order of HEADER."""
        end = self.end_reason.replace("_", " ") or self.message.replace("|", "\\|")
        return (
            self.course, f"{self.speed_limit_m_s:g}", f"{self.laps_completed}/{self.laps_requested}", end,
            _text(self.first_lap_s, ".2f"), _text(self.best_flying_lap_s, ".2f"), _text(self.max_slide_m_s, ".3f"),
            str(self.collisions), _text(self.ratio, ".2f"),
        )  # fmt: skip


def drive(job: Job) -> Row:
    """Drive a race.

    Raises:
      KeyboardInterrupt: Ctrl-C.
    """
    row = Row(course=job.name, speed_limit_m_s=job.speed, laps_requested=job.laps)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of keys in a map's file that are not map_server's
            course = fg.load_track(job.course)
        effects = fg.LidarEffects(range_noise_std=job.noise, dropout_probability=job.dropout)
        result = fg.race(
            course, job.controller, laps=job.laps, max_speed=job.speed, effects=effects,
            odometry_drift=job.odometry_drift,
        )  # fmt: skip
    except Exception as error:  # one race that fails is a row, and the others are driven
        refused = isinstance(error, FgMujocoError) and not isinstance(error, ControllerError)
        said = str(error) if isinstance(error, FgMujocoError) else f"{type(error).__name__}: {error}"
        said = " ".join(said.split()).replace(f"{Path(job.course).parent}/", "")
        return replace(row, message=f"{'refused' if refused else 'failed'}: {said}")
    if result.car.end_reason == "interrupted":
        raise KeyboardInterrupt
    laps, failure = result.car.lap_times_s, result.car.planner_failure
    return replace(
        row,
        laps_completed=len(laps),
        end_reason="" if failure is not None else result.car.end_reason,
        message="" if failure is None else f"failed: {failure}",
        first_lap_s=laps[0] if laps else None,
        best_flying_lap_s=min(laps[1:], default=None),
        max_slide_m_s=result.car.max_slide_m_s,
        collisions=result.car.collisions_wall,
        wrong_way=str(result.car.wrong_way) if result.car.wrong_way is not None else None,
        reference_lap_s=reference_lap(course, job.speed) if job.reference else None,
    )


def reference_lap(course: fg.Course, speed: float) -> float | None:
    """Return the time of a lap of the reference [s]; None: it does not finish.

    Raises:
      KeyboardInterrupt: Ctrl-C.
    """
    try:
        result = fg.race(course, REFERENCE, laps=1, max_speed=speed)
    except FgMujocoError:
        return None
    if result.car.end_reason == "interrupted":
        raise KeyboardInterrupt
    return result.car.lap_times_s[0] if result.car.finished else None


def summary(rows: Sequence[Row]) -> str:
    """Return the line below the table."""
    counts = [
        f"{sum(row.end_reason == 'finished' for row in rows)} of {len(rows)} finished",
        f"{sum(row.collisions > 0 for row in rows)} crashed",
        f"{sum((row.max_slide_m_s or 0.0) > SLIDING_SPEED for row in rows)} slid above {SLIDING_SPEED} m/s",
        f"{sum(row.end_reason == 'wrong_way' for row in rows)} went the wrong way",
        f"{sum(row.message.startswith('refused') for row in rows)} refused",
    ]
    speeds = sorted({row.speed_limit_m_s for row in rows})
    if len(speeds) > 1:
        slow, fast = speeds[0], speeds[-1]
        names = slower_at(rows, slow, fast)
        listed = f" ({', '.join(names)})" if names else ""
        counts.append(f"{len(names)} slower at {fast:g} than at {slow:g} m/s{listed}")
    return "; ".join(counts) + "."


def slower_at(rows: Sequence[Row], slow: float, fast: float) -> list[str]:
    """Return the courses whose best flying lap takes longer at the greater of two speed limits [m/s]."""
    best = {(row.course, row.speed_limit_m_s): row.best_flying_lap_s for row in rows}
    found = []
    for name in dict.fromkeys(row.course for row in rows):
        at_slow, at_fast = best.get((name, slow)), best.get((name, fast))
        if at_slow is not None and at_fast is not None and at_fast > at_slow:
            found.append(name)
    return found


def make_jobs(options: argparse.Namespace, folder: Path) -> list[Job]:
    """Return the races that are asked for, in the order of the table; halls are drawn into a folder."""
    names = ("controller", "noise", "dropout", "odometry_drift", "reference")
    shared = {name: getattr(options, name) for name in names}
    courses = [(path.stem, f"{path}{SETTINGS.get(path.stem, '')}") for path in find_maps(options.data, options.maps)]
    courses += [(path.stem, str(path)) for path in (draw(seed, folder) for seed in options.halls)]
    courses += [(name, name) for name in options.track]
    jobs = [
        Job(name=name, course=course, speed=speed, laps=options.laps, **shared)
        for name, course in courses
        for speed in options.speeds
    ]
    tight = [f"random:{seed}:tight" for seed in options.tight]
    return jobs + [Job(name=name, course=name, speed=TIGHT_SPEED, laps=TIGHT_LAPS, **shared) for name in tight]


def find_maps(data: Path, names: Sequence[str] | None) -> list[Path]:
    """Return the files of the maps of these names, in their order; None: of all."""
    if names == ["none"]:
        return []
    found = {path.stem: path for path in sorted((data / "race_maps").glob("*.yaml"))}
    if not found:
        raise SystemExit(f"--data is {data}; accepted: a folder with race_maps/, of map files *.yaml")
    unknown = [name for name in names or () if name not in found]
    if unknown:
        raise SystemExit(f"--maps has {', '.join(unknown)}; accepted: none, or any of {', '.join(found)}")
    return [found[name] for name in (names if names is not None else found)]


def drive_all(jobs: Sequence[Job], workers: int) -> list[Row]:
    """Drive the races, and return their rows in the order of the jobs; after Ctrl-C, of those that are finished."""
    rows: dict[Job, Row] = {}
    with ProgressLine("preparing races") as line:

        def pulse() -> None:
            if line.due:
                line.write(f"{len(rows)}/{len(jobs)} races")

        driven = work_off(drive, jobs, workers=workers, pulse=pulse)
        try:
            for job, row in driven:
                rows[job] = row
        except KeyboardInterrupt:
            driven.close()
    return [rows[job] for job in jobs if job in rows]


def _text(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _names(text: str) -> list[str]:
    return [name for name in text.split(",") if name]


def _speeds(text: str) -> list[float]:
    return [float(speed) for speed in text.split(",")]


def _seeds(text: str) -> range:
    first, end = text.split(":")
    return range(int(first), int(end))


def main() -> None:
    command = parser(__doc__)
    add = command.add_argument
    add("--data", type=Path, default=Path(__file__).parents[1] / "../shared/data", help="folder that has race_maps/")
    add("--maps", type=_names, metavar="NAME,...", help="default: all; none: without maps")
    add("--halls", type=_seeds, default=range(0), metavar="FIRST:END", help="seeds of halls")
    add("--track", type=_names, default=[], metavar="NAME,...", help="other courses, as `race --track` takes them")
    add("--tight", type=_seeds, default=range(0), metavar="FIRST:END", help="seeds of random:SEED:tight")
    add("--controller", default="gap_finder", help="as `race --controller` takes it")
    add("--laps", type=int, default=5, metavar="N", help="on maps and tracks; default: 5")
    add("--speeds", type=_speeds, default=[4.0, 8.0], metavar="V,...", help="greatest speeds [m/s]; default: 4,8")
    add("--noise", type=float, default=0.0, metavar="M", help="standard deviation of each range [m]")
    add("--dropout", type=float, default=0.0, metavar="P", help="probability that a beam fails")
    add("--odometry-drift", type=float, default=0.0, metavar="D", help="relative error of measured speed and yaw rate")
    add("--reference", action="store_true", help=f"drive a lap of {REFERENCE} with the map, too")
    add("--workers", type=int, default=2, metavar="N", help="processes; default: 2")
    options = command.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        jobs = make_jobs(options, Path(folder))
        rows = drive_all(jobs, options.workers)
    left_out = ("data", "json", "workers", "tight", "halls")
    asked = {name: value for name, value in vars(options).items() if name not in left_out}
    figures = {
        "options": asked | {"tight": list(options.tight), "halls": list(options.halls)},
        "races": [asdict(row) | {"ratio": row.ratio} for row in rows],
    }
    left = f"\n\n{len(jobs) - len(rows)} of {len(jobs)} races were not driven." * (len(rows) < len(jobs))
    report(figures, f"{table(HEADER, [row.cells() for row in rows])}\n\n{summary(rows)}{left}", options.json)


if __name__ == "__main__":
    main()
