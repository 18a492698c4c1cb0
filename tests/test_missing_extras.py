"""A missing extra is reported with what needs it and the command that installs it, which pyproject.toml has."""

import importlib.util
import re
from pathlib import Path

import pytest

import fg_mujoco as fg
from fg_mujoco.course.maps.map_server import require_maps_extra
from fg_mujoco.ros.bag_messages import require_ros_extra
from fg_mujoco.studies.identification.fit import require_scipy
from fg_mujoco.studies.rollout.ray_cluster import require_ray
from fg_mujoco.viz.live.browser import require_viser
from fg_mujoco.viz.plots import require_matplotlib
from fg_mujoco.viz.rendering.telemetry_strip import require_pillow
from fg_mujoco.viz.rendering.video import require_encoder
from fg_mujoco.viz.report.plot_style import require_bokeh

PYPROJECT = Path(__file__).parent.parent / "pyproject.toml"


@pytest.fixture(autouse=True)
def bare(monkeypatch):
    """As where no extra is installed."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, package=None: None)


@pytest.mark.parametrize(
    ("require", "extra", "what"),
    [
        (require_matplotlib, "plot", "pictures need matplotlib"),
        (require_pillow, "render", "3D pictures and videos need Pillow and ffmpeg"),
        (require_encoder, "render", "videos need ffmpeg"),
        (require_bokeh, "report", "report pages need Bokeh"),
        (require_viser, "live", "the live view in a browser needs viser"),
        (require_maps_extra, "maps", "ROS maps need Pillow, PyYAML and SciPy"),
        (require_ros_extra, "ros", "ROS bags need mcap, rosbags and SciPy"),
        (require_scipy, "ros", "identification needs SciPy"),
        (require_ray, "cluster", "rollouts on a cluster need Ray"),
    ],
)
def test_a_missing_extra_is_named_with_what_needs_it(require, extra, what):
    with pytest.raises(fg.MissingExtraError) as missing:
        require()
    assert str(missing.value) == f"{what}: pip install 'fg-mujoco[{extra}]'"
    if PYPROJECT.exists():
        assert re.search(rf"^{extra} = \[", PYPROJECT.read_text(), re.MULTILINE)
