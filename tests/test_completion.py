"""Tab completion, asked as a shell asks: the line so far in a variable, the answer on file descriptor 8."""

import os
import subprocess
import sys

import pytest

import fg_mujoco as fg

pytest.importorskip("argcomplete", reason="no argcomplete here: pip install -e '.[completion]'")


def completions(line, folder):
    """Return what the last word of a line may become."""
    environment = os.environ | {
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": line, "COMP_POINT": str(len(line)),
        "_ARGCOMPLETE_STDOUT_FILENAME": str(folder / "answer"), "_ARGCOMPLETE_SUPPRESS_SPACE": "1",
        "_ARGCOMPLETE_COMP_WORDBREAKS": " \t\n\"'><=;|&(:",
    }  # fmt: skip
    program = [sys.executable, "-c", "import sys; from fg_mujoco.cli.main import main; sys.exit(main())"]
    done = subprocess.run(program, env=environment, capture_output=True, text=True, timeout=120, cwd=folder)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    return {word.strip() for word in (folder / "answer").read_text().split("\n")} - {""}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("fg-mujoco rep", {"replay", "report", "replay-scans"}),
        ("fg-mujoco track s", {"show", "scenes"}),
        ("fg-mujoco race --lidar-n", {"--lidar-noise"}),
        ("fg-mujoco race --vehicle ", set(fg.vehicle_names())),
        ("fg-mujoco race --track ova", {"oval"}),
        ("fg-mujoco race --controller gap", {"gap_finder"}),
        ("fg-mujoco rollout --executor r", {"ray"}),
        ("fg-mujoco render run --camera o", {"onboard", "orbit"}),
        ("fg-mujoco friction sk", {"skidpad"}),
    ],
)
def test_a_word_is_completed(line, offered, tmp_path):
    assert completions(line, tmp_path) == offered
