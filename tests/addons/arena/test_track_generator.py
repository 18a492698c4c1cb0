"""Random circuits keep their settings, whatever the seed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fg_mujoco.addons.arena.random_courses.generator import SPACING, GeneratorSettings, generate_track
from fg_mujoco.course.polyline import self_crossings, step_lengths, turns
from fg_mujoco.errors import SettingsError

DEFAULTS = GeneratorSettings()


def check(track, kept):
    line = track.centreline
    assert kept.min_length <= track.length <= kept.max_length
    np.testing.assert_allclose(step_lengths(line), SPACING, rtol=0.05)
    assert np.abs(track.curvature).max() <= 1.0 / kept.min_radius + 1e-9
    assert np.abs(np.diff(track.curvature)).max() < 0.4 / kept.min_radius  # steering has no jumps
    assert abs(abs(turns(line).sum()) - 2.0 * np.pi) < 1e-6  # once round
    assert len(self_crossings(line)[0]) == 0
    for width in (track.width_right, track.width_left):
        assert 0.5 * kept.min_width * 0.87 <= width.min() and width.max() <= 0.5 * kept.max_width * 1.13
    np.testing.assert_array_equal(track.corridor_right, track.width_right)
    np.testing.assert_array_equal(track.corridor_left, track.width_left)
    check_gap(track, kept)


def check_gap(track, kept):
    """All pairs: places far apart along the line have both widths and the gap between them."""
    line, width = track.centreline, np.maximum(track.width_right, track.width_left)
    apart = np.abs(track.arc_length[:, None] - track.arc_length)
    apart = np.minimum(apart, track.length - apart)
    distance = np.hypot(*(line[:, None] - line).transpose(2, 0, 1))
    stretch = apart > 1.5 * np.pi * np.maximum(kept.min_radius, kept.max_width)
    room = distance - width[:, None] - width
    assert room[stretch].min() >= kept.wall_gap - 0.1 * SPACING


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**63 - 1))
@pytest.mark.slow
def test_every_seed_keeps_the_default_settings(seed):
    check(generate_track(seed), DEFAULTS)


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 1000), width=st.floats(1.0, 3.0), radius=st.floats(1.0, 3.0), gap=st.floats(0.1, 1.0))
def test_other_settings_are_kept_as_well(seed, width, radius, gap):
    kept = GeneratorSettings(min_length=60.0, max_length=250.0, min_width=width, max_width=width, min_radius=radius,
                             wall_gap=gap)  # fmt: skip
    check(generate_track(seed, kept), kept)


def test_same_seed_same_bytes_and_other_seed_other_circuit():
    first, second, other = generate_track(7), generate_track(7), generate_track(8)
    assert first.centreline.tobytes() == second.centreline.tobytes()
    assert first.width_left.tobytes() == second.width_left.tobytes()
    assert first.centreline.shape != other.centreline.shape or not np.array_equal(first.centreline, other.centreline)
    drawn = generate_track(np.random.default_rng(7))
    assert drawn.centreline.tobytes() == first.centreline.tobytes()
    assert (first.name, drawn.name) == ("random:7", "random")


def test_settings_that_no_circuit_keeps_are_refused():
    with pytest.raises(SettingsError, match="no circuit found"):
        generate_track(0, GeneratorSettings(min_length=10.0, max_length=12.0, min_radius=3.0))
