"""Tab completion, asked as a shell asks: the line so far in a variable, the answer in a file that another names."""

import os
import subprocess
import sys

import pytest

import fg_mujoco as fg

pytest.importorskip("argcomplete", reason="no argcomplete here: pip install -e '.[completion]'")

OFFERED = {
    "fg-mujoco rep": {"replay", "report", "replay-scans"}, "fg-mujoco track s": {"show", "scenes"},
    "fg-mujoco race --lidar-n": {"--lidar-noise"}, "fg-mujoco race --vehicle ": set(fg.vehicle_names()),
    "fg-mujoco race --track ova": {"oval"}, "fg-mujoco race --controller gap": {"gap_finder"},
    "fg-mujoco rollout --executor r": {"ray"}, "fg-mujoco render run --camera o": {"onboard", "orbit"},
    "fg-mujoco friction sk": {"skidpad"},
}  # fmt: skip

ASKED = """
import os, sys
from fg_mujoco.cli.main import main
lines, sys.argv = sys.argv[1:], ["fg-mujoco"]
for number, line in enumerate(lines):
    if os.fork() == 0:
        named = {"COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_STDOUT_FILENAME": f"answer-{number}"}
        os.environ.update(named)
        sys.exit(main())
    os.wait()
"""
"""Imports the command once, and answers each line in a process of its own, which ends with the answer."""


@pytest.mark.slow
def test_words_are_completed(tmp_path):
    shells = {
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "_ARGCOMPLETE_SUPPRESS_SPACE": "1",
        "_ARGCOMPLETE_COMP_WORDBREAKS": " \t\n\"'><=;|&(:",
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", ASKED, *OFFERED], env=os.environ | shells, capture_output=True, text=True, timeout=120,
        cwd=tmp_path,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    answers = [(tmp_path / f"answer-{number}").read_text().split("\n") for number in range(len(OFFERED))]
    found = [{word.strip() for word in words} - {""} for words in answers]
    assert dict(zip(OFFERED, found, strict=True)) == OFFERED
