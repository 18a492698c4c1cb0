"""What benchmarks/same_bits.py calls a difference."""

import math
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from cases import each

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "same_bits.py"
if not SCRIPT.exists():
    pytest.skip("not a checkout of the repository", allow_module_level=True)
spec = spec_from_file_location("same_bits", SCRIPT)
same_bits = module_from_spec(spec)
spec.loader.exec_module(same_bits)

FACTS = {"sha": "ab", "laps": [9.2, math.nan], "telemetry": {"x_m": "cd"}}


@each(
    ("after", "said"),
    [
        (FACTS, []),
        (FACTS | {"sha": "ac"}, ['sha "ab" -> "ac"']),
        (FACTS | {"laps": [9.2]}, ["laps.length 2 -> 1", "laps[1] NaN -> missing"]),
        (FACTS | {"laps": [9.2, 0.0, 1.0]}, ["laps.length 2 -> 3", "laps[1] NaN -> 0.0"]),
        (FACTS | {"laps": None}, ["laps.length 2 -> missing", "laps[0] 9.2 -> missing"]),
        (FACTS | {"telemetry": {}}, ['telemetry.x_m "cd" -> missing']),
    ],
)
def test_each_entry_that_is_not_the_same_is_named_and_the_first_of_a_list(after, said):
    assert same_bits.compare(FACTS, after)[0] == said


def test_a_case_that_fails_in_both_or_is_not_in_before_differs():
    failed = {"error": "TypeError: no"}
    assert same_bits.compare(failed, failed)[0] == ["failed before: TypeError: no", "failed after: TypeError: no"]
    assert same_bits.compare(None, FACTS)[0] == ["is not in BEFORE"]


def test_report_counts_by_group_and_names_what_differs(capsys):
    before = {"made_with": {"numpy": "2.4"}, "cases": {"a/1": FACTS, "a/2": FACTS, "b/1": FACTS, "c/1": FACTS}}
    after = {"made_with": {"numpy": "2.5"}, "cases": {"a/1": FACTS, "a/2": FACTS | {"sha": "ac"}, "b/1": FACTS}}
    assert same_bits.report(before, after) == 1
    said = capsys.readouterr().out
    assert "note: numpy is '2.4' before and '2.5' after" in said and "1 cases of BEFORE were not asked" in said
    lines = [line.split() for line in said.splitlines()]
    assert ["a", "1", "equal", "1", "different"] in lines and ["b", "1", "equal", "0", "different"] in lines
    assert 'a/2: sha "ab" -> "ac"' in said
