"""What benchmarks/identification.py makes of a car in three dimensions, with the noise of real sensors."""

import importlib
import sys
from pathlib import Path

import pytest

pytest.importorskip("scipy")

SCRIPT = Path(__file__).parents[3] / "benchmarks" / "identification.py"
if not SCRIPT.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)


@pytest.fixture(scope="module")
def benchmark():
    sys.path.insert(0, str(SCRIPT.parent))
    try:
        yield importlib.import_module("identification")
    finally:
        sys.path.remove(str(SCRIPT.parent))


def test_the_tires_of_a_car_are_found_in_three_dimensions(benchmark, monkeypatch):
    """Of every other slalom; of the four hardest alone the rear's peak is 4.5 % off."""
    monkeypatch.setattr(benchmark, "MODELS", ("two_track",))
    monkeypatch.setattr(benchmark, "DRIVES", benchmark.DRIVES[1::2])
    case = next(case for case in benchmark.cases(0) if case.name == "nuc6")
    row = benchmark.row_of(case)
    errors = row["two_track"]
    for axle in ("front", "rear"):
        assert abs(errors[f"{axle}_stiffness"]) < benchmark.GOALS["stiffness"]
        assert abs(errors[f"{axle}_peak"]) < benchmark.GOALS["peak"]
    assert abs(errors["lag"]) < benchmark.GOALS["lag"]
    assert errors["lap"] < benchmark.GOALS["lap"]
    assert "| nuc6 | f1tenth |" in benchmark.tables([row])
