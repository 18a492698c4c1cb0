"""The command `friction`: what it prints, writes, refuses and answers."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cases import each
from comparison_worlds import files
from fg_mujoco.cli.main import _parser, main
from fg_mujoco.lab import lab
from fg_mujoco.lab.experiment import LabSettings
from fg_mujoco.lab.lab import run_lab
from lab_experiments import COUNT, DIES, FAILS, SLOW


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(lab.EXPERIMENTS, "squares", "lab_experiments:EXPERIMENT")  # measures nothing
    _parser.cache_clear()  # it lists the experiments
    yield tmp_path
    _parser.cache_clear()


def command(*arguments):
    """As the real command, with the experiment that measures nothing."""
    code = (
        "import sys; from fg_mujoco.lab import lab; lab.EXPERIMENTS['squares'] = 'lab_experiments:EXPERIMENT'\n"
        "from fg_mujoco.cli.main import main; sys.exit(main(['friction', *sys.argv[1:]]))"
    )
    return [sys.executable, "-c", code, *arguments]


ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1] / "worlds")}


def test_the_result_is_printed_and_in_a_folder_whose_finished_cells_are_not_measured_again(here, capsys):
    assert main(["friction", "squares", "--workers", "1"]) == 0
    said, err = capsys.readouterr()
    assert "6 squares, the greatest of 25 m²." in said and "| 5.000 |   25 |   no | 2.236 |" in said
    assert err == "" and not list(here.iterdir())
    assert main(["friction", "squares", "--workers", "1", "--mu", "0.6", "--out", "out"]) == 0
    assert capsys.readouterr().out == f"{said}\n6 cells; written to out\n"
    assert (here / "out/squares.csv").exists() and (here / "out/squares.svg").exists()
    assert (here / "out/squares.md").read_text().splitlines()[-1] == (
        "Made again by: fg-mujoco friction squares --mu 0.6 --out out --workers 1"
    )
    assert main(["friction", "squares", "--out", "out", "--mu", ".6"]) == 0
    assert "6 cells, 6 of them by an earlier call" in capsys.readouterr().out


def test_options_are_settings_and_all_is_every_experiment(monkeypatch):
    asked = []

    def stand_in(names, **options):
        asked.append((names, options))
        raise KeyboardInterrupt

    monkeypatch.setattr("fg_mujoco.cli.friction.run_lab", stand_in)
    arguments = ["--mu", "0.3, 0.5", "--steering", "0.1:0.4", "--workers", "2", "--vehicle", "nuc2"]
    assert main(["friction", "skidpad", *arguments]) == 130
    assert main(["friction", "all", "--mu", "0.7:.9:3", "--planner-mu", ".5", "--law", "field"]) == 130
    (first, options), (everything, others) = asked
    assert first == ["skidpad"] and options["workers"] == 2 and options["out"] is None
    assert options["settings"].mus == (0.3, 0.5) and options["settings"].steerings == (0.1, 0.2, 0.3, 0.4)
    assert options["settings"].entry.car.name == "nuc2"
    assert everything == list(lab.EXPERIMENTS)
    assert others["settings"] == LabSettings(mus=(0.7, 0.8, 0.9), planner_mus=(0.5,), law="field")


@each("fares", [FAILS, DIES])
def test_a_cell_that_fails_exits_1_and_says_which(capsys, fares):
    assert main(["friction", "squares", "--out", "out", "--workers", "2", "--mu", str(fares["mus"][0])]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    last = err.splitlines()[-1]
    assert last.startswith('fg-mujoco: squares, cell {"number"') and last.endswith("; finished cells are kept")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The files of a run that nobody interrupted."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(lab.EXPERIMENTS, "squares", "lab_experiments:EXPERIMENT")
        out = tmp_path_factory.mktemp("whole")
        settings = LabSettings(**SLOW)
        assert run_lab(["squares"], out=out, workers=1, settings=settings, pictures=False).cells_measured == COUNT
    return files(out)


@each(("workers", "how"), [(1, signal.SIGINT), (2, signal.SIGINT), (2, signal.SIGKILL)])
def test_a_run_that_was_interrupted_or_killed_goes_on_and_ends_as_one_that_was_not(here, whole, workers, how):
    arguments = ["squares", "--mu", str(SLOW["mus"][0]), "--workers", str(workers), "--out", "out"]
    process = subprocess.Popen(
        command(*arguments), env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    cells, until = here / "out/cells/squares.jsonl", time.monotonic() + 60
    while not (cells.exists() and cells.read_bytes().count(b"\n") >= 2) and time.monotonic() < until:
        time.sleep(0.01)
    os.killpg(process.pid, how)  # as a terminal does: the workers get it too
    out, err = process.communicate(timeout=60)
    if how == signal.SIGINT:
        said = "fg-mujoco: out: interrupted; the same command goes on\n"
        assert (process.returncode, out, err) == (130, "", said)
    found = cells.read_bytes().count(b"\n")
    assert 0 < found < COUNT
    with cells.open("ab") as file:
        file.write(b'{"cell": {"numb')  # a line that was torn
    again = run_lab(["squares"], out="out", workers=1, settings=LabSettings(**SLOW), pictures=False)
    assert again.cells_measured == COUNT - found
    assert files(here / "out") == whole
