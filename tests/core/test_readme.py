"""What the README and the page Start show works: commands run in an empty folder, and tables say what there is."""

import importlib.util
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

import fg_mujoco as fg
from fg_mujoco.cli.main import _parser, main
from fg_mujoco.pictures.rendering.gl import open_context

README = Path(__file__).parents[2] / "README.md"
DOCS = README.parent / "docs"
TEXT = README.read_text() if README.exists() else ""

pytestmark = pytest.mark.skipif(not TEXT, reason="not a checkout of the repository")


SHORTER = {
    "render": "--to 0.2 --size 160x120 --quality draft",
    "compare": "--controller gap_finder,wall_follow --laps 1 --time-limit 0.6 --workers 1",
    "rollout": "--n 4 --workers 1",
    "view": "--port {port}",
}
"""Command -> what its lines get besides, when they are run here: less to do, or a free port. All else is as shown."""
NEEDS = {"render": ("PIL", "imageio_ffmpeg"), "view": ("viser",)}
"""Command -> modules without which it is left out."""
CODES = {"--planner-mu off": 1}
"""What is in a line that does not end with 0 -> how it ends: a car that slides out, and Ctrl-C."""


def commands(*pages):
    """Return the lines of all `sh` blocks of pages as words, without their folder and what is behind `#`."""
    code = "".join(code for page in pages for code in re.findall(r"^```sh\n(.*?)^```", page, re.MULTILINE | re.DOTALL))
    lines = [shlex.split(line, comments=True) for line in code.splitlines()]
    return [[words[0].rpartition("/")[2], *words[1:]] for words in lines if words]


def run_and_stop(words, folder):
    """Run a command that serves until it says how it is stopped, stop it so, and return its code and output."""
    process = subprocess.Popen(
        [sys.executable, "-m", "fg_mujoco", *words], cwd=folder, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    first = ""
    while "Ctrl-C" not in first and process.poll() is None:
        first += process.stdout.readline()
    process.send_signal(signal.SIGINT)
    out = first + process.communicate(timeout=300)[0]
    return process.returncode, out


@pytest.mark.slow
def test_commands_run_from_top_to_bottom_in_an_empty_folder(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    makefile = (README.parent / "Makefile").read_text()
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    run = []
    for program, *words in commands(TEXT, (DOCS / "start.md").read_text()):
        if program == "make":  # in a clone, which an empty folder is not
            assert re.search(rf"^{words[0]}:", makefile, re.MULTILINE), words
        if program != "fg-mujoco":
            continue
        missing = [module for module in NEEDS.get(words[0], ()) if importlib.util.find_spec(module) is None]
        if missing or (words[0] == "render" and not has_gl()):
            continue
        words += SHORTER.get(words[0], "").format(port=port).split()
        if words[0] == "view":
            code, out = run_and_stop(words, tmp_path)
        else:
            code, out = main(words), "".join(capfd.readouterr())
        expected = next((code for part, code in CODES.items() if part in " ".join(words)), 0)
        assert code == expected, f"{words}\n{out}"
        run.append(words[0])
    assert {"race", "debug", "controllers", "compare", "rollout"} <= set(run)
    files = re.findall(r"^\| `([\w.]+)` \|", (DOCS / "commands.md").read_text(), re.MULTILINE)
    made = {path.name for path in (tmp_path / "runs/first").iterdir()}
    assert made <= set(files)
    assert set(files) - made <= {"controller.py", "failed_scan.npz", "trace.png", "report.html"}
    assert "wall_follow" in (tmp_path / "runs/tracks/table.md").read_text()


def has_gl():
    try:
        open_context(16, 16).free()
    except fg.MissingExtraError:
        return False
    return True


def test_options_shown_are_those_of_the_command():
    race = _parser()._subparsers._group_actions[0].choices["race"]
    race.fill()
    known = {option for action in race._actions for option in action.option_strings} - {"-h", "--help"}
    shown = set(re.findall(r"`(--[a-z-]+)", (DOCS / "commands.md").read_text()))
    assert known <= shown, known - shown


def test_the_table_of_circuits_says_what_they_measure():
    rows = re.findall(
        r"^\| `(\w+)` \| [^|]+ \| ([\d.]+) \| ([\d.]+(?: to [\d.]+)?) \| ([\d.]+) \|$",
        (DOCS / "circuits.md").read_text(),
        re.MULTILINE,
    )
    shown = {
        name: f"{length} m long, {width} m wide, tightest radius {radius} m" for name, length, width, radius in rows
    }
    assert shown == {name: fg.load_track(name).description for name in fg.track_names()}


def test_controllers_are_named():
    text = (DOCS / "planners.md").read_text()
    assert [name for name in fg.controller_names() if f"| `{name}` |" not in text] == []
