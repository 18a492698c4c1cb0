"""The mission: laps at the friction limit, no crash, no sliding, on every circuit, with the same settings.

The lap times and the greatest slide of each circuit are in docs/figures.json; `make figures` drives them again.
"""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.vehicle.car import WHEELS
from fg_mujoco.vehicle.tire_slip import SLIDING_SPEED, slides_above
from vehicle_worlds import open_file

DATA = Path(__file__).parents[3] / "shared" / "data"
REAL = {
    **{name: DATA / "maps" / f"{name}_centerline.csv" for name in ("aut", "esp", "gbr", "mco")},
    **{name: DATA / "circuits" / f"{name}_centerline.csv" for name in ("Monza", "Spielberg", "Zandvoort")},
}
PUBLISHED = {"aut": 19.10, "esp": 45.78, "gbr": 39.34, "mco": 34.99}
"""[s] Lap of the published follow-the-gap: standing start, LiDAR only, same car, 8 m/s (../shared/data/README.md)."""


def drive(circuit, controller="gap_finder", laps=5, **settings):
    """Race once for all tests that ask for the same race, whether they name the planner and the laps or not."""
    return drive_once(circuit, controller, laps=laps, **settings)


@cache
def drive_once(circuit, controller, **settings):
    path = REAL.get(circuit)
    if path is not None and not path.is_file():
        pytest.skip(f"the real circuits are not here: no folder {path.parent}")
    return fg.race(circuit if path is None else str(path), controller, **settings)


def assert_no_sliding(result):
    """Fail if any tire of the race slid at any time, or if the slip meter did not see the tires at work."""
    slides = np.stack([result.car.column(f"slide_{wheel}_m_s") for wheel in WHEELS])
    uses = np.stack([result.car.column(f"friction_utilisation_{wheel}") for wheel in WHEELS])
    assert result.car.max_slide_m_s == np.nanmax(slides) <= slides_above(result.car.tires_model), "a tire slid"
    assert result.car.slide_time_fraction == 0.0 and not result.car.column("sliding_steps").any(), "a tire slid"
    assert np.isfinite(slides[:, 1:]).all(), "a tire was off the ground for a whole tick"
    assert np.fmax.reduce(uses, axis=0).max() > 0.5, "the tires had nothing to do"


def assert_all_laps(result, laps):
    assert (result.car.end_reason, result.car.finished, result.car.laps_completed) == ("finished", True, laps)
    assert len(result.car.lap_times_s) == laps
    assert result.car.collisions_wall == 0


BUNDLED = ("chicanes", "fast", "hairpins", "l_corridor", "oval", "tight")
"""The bundled circuits that are wide enough for every planner; tests of tight ones are in test_tight_tracks.py."""

CIRCUITS = (
    *BUNDLED,
    *(pytest.param(f"random:{seed}", marks=pytest.mark.slow) for seed in range(8)),
    *(pytest.param(name, marks=pytest.mark.slow) for name in REAL),
)


def laps_of(circuit):
    """Of a circuit that is not bundled two, the first from rest; `make figures` drives five of all."""
    return 5 if circuit in BUNDLED else 2


@pytest.mark.parametrize("circuit", CIRCUITS)
def test_gap_finder_drives_all_laps_without_a_crash_and_without_sliding(circuit):
    result = drive(circuit, laps=laps_of(circuit))
    assert_all_laps(result, laps_of(circuit))
    assert_no_sliding(result)


FIGURES = Path(__file__).parents[2] / "docs" / "figures.json"


@pytest.mark.parametrize("circuit", CIRCUITS)
def test_laps_are_those_that_the_documentation_shows(circuit):
    """To .05 s: runs differ from one processor to the next only in the last bits."""
    if not FIGURES.exists():
        pytest.skip("not a checkout of the repository")
    shown = json.loads(FIGURES.read_text("utf-8"))["circuits"][circuit]
    result = drive(circuit, laps=laps_of(circuit))
    assert result.car.lap_times_s[0] == pytest.approx(shown["first_lap_s"], abs=0.05)
    if laps_of(circuit) == 5:  # as many as are shown
        assert min(result.car.lap_times_s) == pytest.approx(shown["best_lap_s"], abs=0.05)
        assert result.car.max_slide_m_s == pytest.approx(shown["max_slide_m_s"], abs=0.002)


QUICK = ("oval", "l_corridor")


@pytest.mark.parametrize(
    "circuit", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in BUNDLED]
)
@pytest.mark.parametrize("controller", fg.controller_names())
def test_every_planner_drives_without_a_crash_and_without_sliding(controller, circuit):
    """A lap from rest and one that begins at speed, as all later ones do; `gap_finder` drives its line, too."""
    # greatest slides .033 (pure_pursuit on l_corridor) to .047 m/s (weighted_gap on fast)
    laps = 5 if controller == "gap_finder" else 2
    result = drive(circuit, controller=controller, laps=laps)
    assert_all_laps(result, laps)
    assert_no_sliding(result)


@pytest.mark.slow
@pytest.mark.parametrize("circuit", PUBLISHED)
def test_gap_finder_is_faster_than_the_published_follow_the_gap(circuit):
    """On the ideal tires: those of the published times cannot slide, and need hardly any slip angle."""
    result = drive(circuit, laps=1, tires="coulomb")
    assert result.car.telemetry[0, fg.TELEMETRY.index("speed_m_s")] == 0.0  # a standing start
    assert result.car.speed_limit_m_s == 8.0
    assert result.car.max_speed_m_s <= 8.0 + 1e-3  # tires are springs: what they roll on is .049 m at rest
    assert result.car.mu == result.car.planner_mu == 1.0489
    assert result.car.lap_times_s[0] < PUBLISHED[circuit]


@each("circuit", ("oval", "hairpins", "chicanes", "tight"))
def test_the_test_of_sliding_trips_without_the_law_and_on_less_grip_than_believed_and_not_with_the_law(circuit):
    """Measured tires understeer before they slide on half as much grip again as there is: ideal ones slide."""
    assert_no_sliding(drive(circuit, laps=1, time_limit=10.0))
    ideal = {"tires": "coulomb", "vehicle": open_file()}
    for believed, slides, share, car in ((np.inf, 10.0, 0.05, {}), (1.5 * 1.0489, 2.0, 0.01, ideal)):
        result = drive(circuit, laps=1, planner_mu=believed, time_limit=10.0, **car)
        with pytest.raises(AssertionError, match="a tire slid"):
            assert_no_sliding(result)
        assert result.car.max_slide_m_s > slides * SLIDING_SPEED and result.car.slide_time_fraction > share


def test_five_laps_are_replayed_bit_for_bit(tmp_path):
    result = drive("oval")
    report = fg.replay(fg.write_run(result, tmp_path / "run", picture=False))
    assert report.identical and report.ticks == len(result.ctrl) > 5 * 8 / 0.025
    assert report.trajectory_sha256 == result.trajectory_sha256


def test_slippery_tires_do_not_slide_when_the_planner_knows_them():
    result = drive("oval", laps=1, mu=0.6, planner_mu=0.6)
    assert result.car.finished and result.car.lap_times_s[0] > drive("oval").car.lap_times_s[0] + 0.5
    assert_no_sliding(result)


@pytest.mark.slow
def test_rangefinder_gives_the_same_laps_as_raycast():
    rangefinder = drive("oval", laps=1, lidar="rangefinder")
    assert_no_sliding(rangefinder)
    assert [race.world.lidar_backend for race in (rangefinder, drive("oval"))] == ["rangefinder", "raycast"]
    assert rangefinder.car.lap_times_s == pytest.approx(drive("oval").car.lap_times_s[:1], rel=0.01)
