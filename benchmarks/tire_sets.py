"""Races gap_finder with each set of tires on the bundled circuits and on the real ones, and prints one table.

    python benchmarks/tire_sets.py [--data ../shared/data] [--laps 5] [--tires forzaeth_nuc2,forzaeth_nuc6]
        [--track oval,l_corridor] [--controller gap_finder] [--use 1.0] [--workers 2] [--json FILE]

All settings are the defaults of a race, which tells the planner the least peak of the set; `--use 0.8` tells it that
share. The real circuits are those of maps/ and circuits/ in `--data`, which are not part of the repository; without the
folder they are left out. A cell is the best flying lap [s], or how the race ended and after how many laps. A star marks
a race in which a tire slid, past its peak, by more than a contact's creep. With `--json` the rows are written as they
come, and a race that the file already has is not driven again.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from common import table

import fg_mujoco as fg
from fg_mujoco.vehicle.tires import Tires, tire_names

FINISHED = "finished"
CREEP = 0.05  # [m/s] below which nothing slides


@dataclass(frozen=True, kw_only=True)
class Job:
    """A race to be driven. It travels to a worker process."""

    course: str  # as `load_track` takes it
    tires: str
    laps: int
    controller: str
    use: float  # share of the least peak that the planner is told

    def __str__(self) -> str:
        return f"{self.tires} on {name_of(self.course)}"


@dataclass(frozen=True, kw_only=True)
class Row:
    """How a race went; names as in its summary."""

    course: str
    tires: str
    end_reason: str
    laps_completed: int
    best_lap_s: float | None
    lap_times_s: list[float]
    max_slide_m_s: float
    duration_s: float
    where: list[float]  # x, y [m] at the end


def name_of(course: str) -> str:
    """Return the name of a circuit in the table."""
    return Path(course).stem.removesuffix("_centerline")


def drive(job: Job) -> Row:
    """Drive one race."""
    tires = None if job.tires == "contact" else job.tires
    peak = None if tires is None else Tires.load(tires).least_peak
    told = None if peak is None or job.use == 1.0 else job.use * peak
    track = fg.load_track(job.course)
    run = fg.race(track, controller=job.controller, laps=job.laps, tires=tires, planner_mu=told)
    car, flying = run.car, run.car.lap_times_s[1:]
    return Row(
        course=name_of(job.course), tires=job.tires, end_reason=car.end_reason, laps_completed=car.laps_completed,
        best_lap_s=round(min(flying), 3) if flying else None, lap_times_s=[round(lap, 4) for lap in car.lap_times_s],
        max_slide_m_s=round(float(car.max_slide_m_s), 4), duration_s=round(run.sim_time_s, 2),
        where=[round(float(car.column(name)[-1]), 2) for name in ("x_m", "y_m")],
    )  # fmt: skip


def real_circuits(data: Path) -> list[str]:
    """Return the centreline CSVs of the real circuits in a folder; none where there is no such folder."""
    return [str(path) for kind in ("maps", "circuits") for path in sorted((data / kind).glob("*_centerline.csv"))]


def shown(row: Row | None) -> str:
    """Return the cell of a race."""
    if row is None:
        return ""
    text = f"{row.best_lap_s:.2f}" if row.end_reason == FINISHED else f"{row.end_reason} after {row.laps_completed}"
    return text + ("*" if row.max_slide_m_s > CREEP else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[1] / "../shared/data")
    parser.add_argument("--laps", type=int, default=5)
    parser.add_argument("--tires", default=",".join(tire_names()), help="sets, by commas; default: all")
    parser.add_argument("--track", help="circuits, by commas; default: all that are bundled, and those of --data")
    parser.add_argument("--controller", default="gap_finder")
    parser.add_argument("--use", type=float, default=1.0, help="share of the least peak that the planner is told")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows here, one a line, and go on with it")
    options = parser.parse_args()
    sets = options.tires.split(",")
    tracks = options.track.split(",") if options.track else [*fg.track_names(), *real_circuits(options.data)]
    found: dict[tuple[str, str], Row] = {}
    if options.json is not None and options.json.exists():
        for line in options.json.read_text("utf-8").splitlines():
            row = Row(**json.loads(line))
            found[row.course, row.tires] = row
    same = {"laps": options.laps, "controller": options.controller, "use": options.use}
    jobs = [Job(course=track, tires=tires, **same) for track in tracks for tires in sets]
    for row in map(drive, [job for job in jobs if (name_of(job.course), job.tires) not in found]):
        found[row.course, row.tires] = row
        if options.json is not None:
            with options.json.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(row)) + "\n")
    names = [name_of(track) for track in tracks]
    print(table(["circuit", *sets], [[name, *(shown(found.get((name, tires))) for tires in sets)] for name in names]))
    races = [found[name, tires] for name in names for tires in sets if (name, tires) in found]
    finished = [row for row in races if row.end_reason == FINISHED]
    slid = [row for row in races if row.max_slide_m_s > CREEP]
    print(f"\n{len(finished)} of {len(races)} races are finished; in {len(slid)} a tire slid.")


if __name__ == "__main__":
    main()
