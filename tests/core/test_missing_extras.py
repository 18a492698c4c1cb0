"""A missing extra is reported with what needs it and the command that installs it, which pyproject.toml has."""

import importlib.util
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.course.maps.export import require_trimesh
from fg_mujoco.course.maps.map_server import require_maps_extra
from fg_mujoco.errors import install_command
from fg_mujoco.pictures.pages.bokeh_plots import require_bokeh
from fg_mujoco.pictures.pages.figure_kit import require_matplotlib
from fg_mujoco.pictures.rendering.telemetry_strip import require_pillow
from fg_mujoco.pictures.rendering.video import require_encoder

ROOT = Path(__file__).parents[2]
PYPROJECT = ROOT / "pyproject.toml"


@pytest.fixture(autouse=True)
def bare(monkeypatch):
    """As where no extra is installed."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, package=None: None)


@each(
    ("require", "extra", "what"),
    [
        (require_matplotlib, "plot", "pictures need matplotlib"),
        (require_pillow, "render", "3D pictures and videos need Pillow and ffmpeg"),
        (require_encoder, "render", "videos need ffmpeg"),
        (require_bokeh, "report", "report pages need Bokeh"),
        (require_maps_extra, "maps", "ROS maps need Pillow, PyYAML, SciPy and scikit-image"),
        (require_trimesh, "meshes", "meshes of walls need trimesh"),
    ],
)
def test_a_missing_extra_is_named_with_what_needs_it(require, extra, what):
    with pytest.raises(fg.MissingExtraError) as missing:
        require()
    assert str(missing.value) == f"{what}: {install_command(extra)}"
    if PYPROJECT.exists():
        assert re.search(rf"^{extra} = \[", PYPROJECT.read_text(), re.MULTILINE)


@pytest.mark.slow
@pytest.mark.skipif(not PYPROJECT.exists(), reason="not a clone of the repository")
def test_the_command_installs_from_the_clone_for_the_python_that_runs_and_works_from_any_folder(tmp_path):
    words = shlex.split(install_command("plot"))
    assert words == [sys.executable, "-m", "pip", "install", "-e", f"{ROOT}[plot]"]
    dry = [*words[:4], "--dry-run", "--no-deps", "--no-build-isolation", "--no-index", "--quiet", *words[4:]]
    done = subprocess.run(dry, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, "does not provide the extra" in done.stderr) == (0, False), done.stderr


@each(
    ("text", "said"),
    [
        ("raise ImportError('core bindings are\\nmissing')", "ImportError: core bindings are missing; "),
        ("raise OSError('libmujoco.so.3.17.0: no such file')", "OSError: libmujoco.so.3.17.0: no such file"),
        ("__version__ = '4.0.0'; mj_versionString = lambda: '3.17.0'", "its Python is 4.0.0, its library 3.17.0"),
        ("__version__ = '3.3.2'; mj_versionString = lambda: '3.3.2'", "ImportError: it is 3.3.2"),
        ("from mujoco._structs import *", "No module named 'mujoco._structs'"),
    ],
)
def test_a_mujoco_that_is_half_upgraded_is_told_in_a_line_with_what_installs_it_anew(text, said, tmp_path):
    (tmp_path / "mujoco").mkdir()
    (tmp_path / "mujoco" / "__init__.py").write_text(text)
    env = os.environ | {"PYTHONPATH": str(tmp_path)}
    run = subprocess.run([sys.executable, "-m", "fg_mujoco", "race"], capture_output=True, text=True, env=env)
    (line,) = run.stderr.splitlines()
    assert run.returncode == 2 and line.startswith("fg-mujoco: MuJoCo cannot be used: ") and said in line
    accepted = re.search(r'"(mujoco>=[^"]*)"', PYPROJECT.read_text("utf-8"))[1]
    assert line.endswith(f"-m pip install '{accepted}'")


def test_without_dm_control_everything_but_its_interface_is_there():
    code = """
import sys
sys.modules["dm_control"] = sys.modules["dm_env"] = sys.modules["labmaze"] = None
import fg_mujoco as fg
print(fg.race("oval", laps=1, time_limit=0.1).car.end_reason, fg.parallel_env(1, beam_step=90).agents)
from fg_mujoco.envs.dm_environment import load
"""
    pytest.importorskip("pettingzoo")
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout == "time_limit []\n", run.stderr
    assert "MissingExtraError: dm_env environments need dm-control" in run.stderr.splitlines()[-1]
    assert "Python 3.10 to 3.12" in run.stderr and run.stderr.endswith(f"{install_command('dm-control')}\n")
