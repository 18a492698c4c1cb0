"""The friction lab's frame: cells in worker processes, a folder that resumes, and a report that needs no other file."""

import csv
import json
import re
from collections import defaultdict

import pytest

import fg_mujoco as fg
from cases import each
from comparison_worlds import files
from fg_mujoco.lab import lab
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.lab import EXPERIMENTS, load_experiment, run_lab
from lab_experiments import BAD, COUNT, DIES, FAILS

REAL = tuple(EXPERIMENTS)


@pytest.fixture(autouse=True)
def experiments(monkeypatch):
    """The two that measure nothing, in place of the real ones."""
    monkeypatch.setattr(lab, "EXPERIMENTS", {"squares": "lab_experiments", "cubes": "lab_cubes"})


def rows(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_what_is_written_is_the_same_whatever_the_workers(tmp_path):
    one = run_lab(["squares"], out=tmp_path / "one", workers=1)
    two = run_lab(["squares"], out=tmp_path / "two", workers=2)
    assert files(tmp_path / "one") == files(tmp_path / "two")
    assert set(files(tmp_path / "one")) == {
        "lab.json", "cells/squares.jsonl", "report.html", "squares_areas.csv", "squares_roots.csv",
        "squares_areas.svg", "squares_again.svg", "squares_much.svg",
    }  # fmt: skip
    assert (one.cells, one.cells_measured) == (two.cells, two.cells_measured) == (COUNT, COUNT)
    assert one.text() == two.text() == run_lab(["squares"], workers=1).text()


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


def test_a_folder_of_other_settings_or_sources_is_refused(tmp_path, monkeypatch):
    out = tmp_path / "out"
    run_lab(["squares"], out=out, workers=1, pictures=False)
    before = files(out)
    with pytest.raises(fg.RunFolderError, match=r"quick is false there and true here; accepted"):
        run_lab(["squares"], out=out, settings=LabSettings(quick=True))
    with pytest.raises(fg.RunFolderError, match=r"mus is null there and .*0.5.* here"):
        run_lab(["squares"], out=out, settings=LabSettings(mus=(0.5,)))
    made = lab.lab_versions()
    monkeypatch.setattr(lab, "lab_versions", lambda: {**made, "lab_sha256": "other"})
    with pytest.raises(fg.RunFolderError, match=r'lab_sha256 is .* there and "other" here; accepted'):
        run_lab(["squares"], out=out)
    assert files(out) == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.tex").write_text("")
    with pytest.raises(fg.RunFolderError, match="is not empty; accepted: a new or empty folder"):
        run_lab(["squares"], out=tmp_path / "mine")


def test_redraw_takes_rows_of_other_sources_and_says_so(tmp_path, monkeypatch):
    run_lab(["squares"], out=tmp_path, workers=1, pictures=False)
    made, before = lab.lab_versions(), (tmp_path / "cells/squares.jsonl").read_bytes()
    monkeypatch.setattr(lab, "lab_versions", lambda: {**made, "lab_sha256": "other"})
    result = run_lab(["squares"], out=tmp_path, redraw=True, pictures=False)
    assert result.cells_measured == 0
    report = (tmp_path / "report.html").read_text()
    assert made["lab_sha256"] in report and "redrawn by lab sha256" in report
    assert (tmp_path / "cells/squares.jsonl").read_bytes() == before
    with pytest.raises(fg.SettingsError, match=r"cubes, cell .* is missing; accepted"):
        run_lab(["squares", "cubes"], out=tmp_path, redraw=True)
    with pytest.raises(fg.SettingsError, match="accepted: the folder of an earlier run"):
        run_lab(["squares"], redraw=True)


@each("workers", [1, 2])
def test_a_cell_that_fails_is_named_and_finished_ones_are_kept(tmp_path, workers):
    failing = LabSettings(seed=FAILS)
    with pytest.raises(fg.EngineError, match=rf'squares, cell .*"number": {BAD}.* ValueError: no such square .*line'):
        run_lab(["squares"], out=tmp_path, workers=workers, settings=failing)
    kept = [json.loads(line)["cell"]["number"] for line in (tmp_path / "cells/squares.jsonl").read_text().splitlines()]
    assert len(kept) >= 2 and BAD not in kept
    assert not (tmp_path / "report.html").exists()


def test_a_worker_that_dies_is_named_and_finished_cells_are_kept(tmp_path):
    with pytest.raises(fg.EngineError, match=rf'"number": {BAD}.*ended with exit code 3'):
        run_lab(["squares"], out=tmp_path, workers=2, settings=LabSettings(seed=DIES))
    assert (tmp_path / "cells/squares.jsonl").read_bytes().count(b"\n") >= 2


def test_the_report_is_of_all_experiments_that_are_complete_in_the_folder(tmp_path):
    run_lab(["cubes"], out=tmp_path, workers=1, pictures=False)
    assert sections(tmp_path) == ["cubes"]
    result = run_lab(["squares"], out=tmp_path, workers=1, pictures=False)
    assert sections(tmp_path) == ["squares", "cubes"]  # in the lab's order
    assert [chapter.name for chapter in result.chapters] == ["squares"]
    assert (tmp_path / "cubes_volumes.csv").exists()
    cells = tmp_path / "cells/cubes.jsonl"
    cells.write_bytes(cells.read_bytes().splitlines(keepends=True)[0])  # one is lost
    run_lab(["squares"], out=tmp_path, workers=1, pictures=False)
    assert sections(tmp_path) == ["squares"]
    assert not (tmp_path / "cubes_volumes.csv").exists()


def sections(folder):
    return re.findall(r'<section id="(\w+)">', (folder / "report.html").read_text())


def test_the_report_needs_no_other_file_and_its_ids_are_unique(tmp_path):
    run_lab(["squares", "cubes"], out=tmp_path, workers=1)
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "http" not in report.replace("http-equiv", "") and "url(http" not in report and "@import" not in report
    ids, links = re.findall(r'\bid="([^"]+)"', report), re.findall(r'(?:href|src)="([^"]+)"', report)
    assert len(set(ids)) == len(ids)
    targets = {link[1:] for link in links if link.startswith("#")} | set(re.findall(r"url\(#([^)]+)\)", report))
    assert targets and targets <= set(ids)
    others = [link for link in links if not link.startswith("#")]
    assert [link.partition(",")[0] for link in others] == ["data:image/png;base64"]  # the figure of many points
    assert report.count("<svg") == 2 and len(report) < 1e6


@each("name", REAL)
def test_each_experiment_says_its_whole_work_in_json_the_same_each_time(name, monkeypatch):
    monkeypatch.setattr(lab, "EXPERIMENTS", EXPERIMENTS)
    experiment = load_experiment(name)
    cells = experiment.cells(LabSettings())
    assert experiment.name == name and experiment.title
    assert json.loads(json.dumps(cells)) == cells == experiment.cells(LabSettings())
    assert len({lab.cell_key(cell) for cell in cells}) == len(cells)
    assert 0 < len(experiment.cells(LabSettings(quick=True))) <= len(cells)


ODD = slice(1, None, 2)
SOME = {"braking": ODD, "transient": slice(1, None, 4), "skidpad": slice(7, None, 8)}
"""Cells of a quick experiment whose rows are all kinds that its report needs, where it has many."""


@each("name", REAL)
def test_each_experiment_has_a_report_of_its_quick_cells(name, monkeypatch):
    monkeypatch.setattr(lab, "EXPERIMENTS", EXPERIMENTS)
    experiment, tables = load_experiment(name), defaultdict(list)
    cells = json.loads(json.dumps(experiment.cells(LabSettings(quick=True))))
    for cell in cells[SOME.get(name, slice(None))]:
        for table, found in experiment.measure(cell).items():
            tables[table] += found
    section = experiment.section(tables)
    assert section.sentences and not any("nan" in sentence.split() for sentence in section.sentences)
    for table, names in section.columns.items():
        assert not tables[table] or set(names) <= set(tables[table][0])
    assert all(len(figure.render()) > 1000 for figure in section.figures)
