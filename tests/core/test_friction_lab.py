"""The friction lab's frame: cells in worker processes, a folder that resumes, and what it writes."""

import csv
import json

import pytest

import fg_mujoco as fg
from cases import each
from comparison_worlds import files
from fg_mujoco.lab import lab
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.lab import EXPERIMENTS, load_experiment, run_lab
from fg_mujoco.vehicle.tires import Tires, tire_names
from lab_experiments import BAD, COUNT, DIES, FAILS

REAL = tuple(EXPERIMENTS)


@pytest.fixture(autouse=True)
def experiments(monkeypatch):
    """The two that measure nothing, in place of the real ones."""
    found = {"squares": "lab_experiments:EXPERIMENT", "cubes": "lab_cubes:EXPERIMENT"}
    monkeypatch.setattr(lab, "EXPERIMENTS", found)


def rows(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_what_is_written_is_the_same_whatever_the_workers(tmp_path):
    one = run_lab(["squares"], out=tmp_path / "one", workers=1, again="the command")
    two = run_lab(["squares"], out=tmp_path / "two", workers=2, again="the command")
    assert files(tmp_path / "one") == files(tmp_path / "two")
    assert set(files(tmp_path / "one")) == {
        "lab.json", "cells/squares.jsonl", "squares.csv", "squares.md", "squares.svg", "squares.pdf",
    }  # fmt: skip
    assert (one.cells, one.cells_measured) == (two.cells, two.cells_measured) == (COUNT, COUNT)
    assert one.text() == two.text() == run_lab(["squares"], workers=1).text()
    assert rows(tmp_path / "one/squares.csv")[0]["root"] == "" and "nan" not in one.text()
    assert (tmp_path / "one/squares.md").read_text() == f"{one.text()}\n\nMade again by: the command\n"


def swap(lines):
    lines[1], lines[4] = (
        lines[1].replace(b'"number": 1', b'"number": 4'),
        lines[4].replace(b'"number": 4', b'"number": 1'),
    )


DAMAGE = {
    "edited": ([6], lambda lines: lines.__setitem__(5, lines[5].replace(b'"area_m2": 25', b'"area_m2": 26'))),
    "swapped": ([2, 5], swap),
    "no row": ([1], lambda lines: lines.__setitem__(0, b'{"cell": 3}')),
    "no JSON": ([3], lambda lines: lines.__setitem__(2, b"\xff\x00")),
}


@each("damage", DAMAGE)
def test_a_damaged_line_is_named_and_its_cell_is_measured_again(tmp_path, damage):
    run_lab(["squares"], out=tmp_path, workers=1, pictures=False)
    before, path = files(tmp_path), tmp_path / "cells/squares.jsonl"
    lines = path.read_bytes().splitlines()
    named, spoil = DAMAGE[damage]
    spoil(lines)
    path.write_bytes(b"\n".join(lines) + b"\n")
    with pytest.warns(UserWarning, match="squares.jsonl, line") as warned:
        again = run_lab(["squares"], out=tmp_path, workers=1, pictures=False)
    assert [
        f"squares.jsonl, line {number}: is damaged" in str(each.message)
        for each, number in zip(warned, named, strict=True)
    ] == [True] * len(named)
    assert again.cells_measured == len(named)
    assert files(tmp_path) == before


def test_a_folder_of_other_settings_or_sources_is_refused_and_one_of_another_experiment_is_added_to(
    tmp_path, monkeypatch
):
    out, law = tmp_path / "out", tmp_path / "law.py"
    law.write_text("def law(steering_angle, odometry, car, mu):\n    return 1.0\n")
    mine = LabSettings(law=f"{law}:law")
    run_lab(["squares"], out=out, workers=1, pictures=False, settings=mine)
    run_lab(["cubes"], out=out, workers=1, pictures=False, settings=mine)
    before = files(out)
    assert {"squares.csv", "cubes.csv"} <= set(before)
    with pytest.raises(fg.RunFolderError, match=r"mus is null there and .*0.5.* here; accepted"):
        run_lab(["squares"], out=out, settings=LabSettings(law=mine.law, mus=(0.5,)))
    law.write_text(law.read_text() + "\n")
    with pytest.raises(fg.RunFolderError, match="the contents of the law file have changed since then; accepted"):
        run_lab(["squares"], out=out, settings=mine)
    made = lab.lab_versions()
    monkeypatch.setattr(lab, "lab_versions", lambda: {**made, "lab_sha256": "other"})
    with pytest.raises(fg.RunFolderError, match="the contents of the lab have changed since then; accepted"):
        run_lab(["squares"], out=out, settings=mine)
    assert files(out) == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.tex").write_text("")
    with pytest.raises(fg.RunFolderError, match="is not empty; accepted: a new or empty folder"):
        run_lab(["squares"], out=tmp_path / "mine")


@each("workers", [1, 2])
def test_a_cell_that_fails_is_named_and_finished_ones_are_kept(tmp_path, workers):
    with pytest.raises(fg.EngineError, match=rf'squares, cell .*"number": {BAD}.* ValueError: no such square .*line'):
        run_lab(["squares"], out=tmp_path, workers=workers, settings=LabSettings(**FAILS))
    kept = [json.loads(line)["cell"]["number"] for line in (tmp_path / "cells/squares.jsonl").read_text().splitlines()]
    assert len(kept) >= 2 and BAD not in kept
    assert not (tmp_path / "squares.md").exists()


def test_a_worker_that_dies_is_named_and_finished_cells_are_kept(tmp_path):
    with pytest.raises(fg.EngineError, match=rf'"number": {BAD}.*ended with exit code 3'):
        run_lab(["squares"], out=tmp_path, workers=2, settings=LabSettings(**DIES))
    assert (tmp_path / "cells/squares.jsonl").read_bytes().count(b"\n") >= 2


SHORT = LabSettings(mus=(0.8,), steerings=(0.3,), planner_mus=(0.5, 0.6), tracks=("oval",), laps=2)


@each("name", REAL)
def test_each_experiment_says_its_work_in_json_measures_it_and_draws_what_it_found(name, monkeypatch, tmp_path):
    monkeypatch.setattr(lab, "EXPERIMENTS", EXPERIMENTS)
    experiment = load_experiment(name)
    cells = experiment.cells(LabSettings())
    assert experiment.name == name and experiment.title
    assert json.loads(json.dumps(cells)) == cells == experiment.cells(LabSettings())
    assert len({lab.cell_key(cell) for cell in cells}) == len(cells)
    one_of_each_law = {Tires.load(tires).model: tires for tires in tire_names()}
    monkeypatch.setattr("fg_mujoco.lab.skidpad.tire_names", lambda: tuple(one_of_each_law.values()))
    some = (("bank", 10), ("crest", -8), ("roughness", "D"))
    monkeypatch.setattr("fg_mujoco.lab.ground_circles.GROUNDS", some)
    result = run_lab([name], out=tmp_path, workers=1, settings=SHORT)
    (chapter,) = result.chapters
    assert not any("nan" in sentence.split() for sentence in chapter.section.sentences)
    assert set(chapter.section.columns.values()) <= set(chapter.rows[0])
    assert len(result.text().splitlines()) < 40 and max(map(len, result.text().splitlines())) < 240
    assert (tmp_path / f"{name}.pdf").stat().st_size > 1000
