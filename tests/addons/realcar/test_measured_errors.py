"""Measured errors of a LiDAR by range and bearing: interpolation, statistics, both pipelines, files, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fg_mujoco as fg
from fg_mujoco.addons.realcar.measured_errors import MeasuredErrors
from fg_mujoco.lidar.beams import LidarModel
from fg_mujoco.lidar.effects import LidarEffects
from fg_mujoco.lidar.scan_pipeline import EffectsOfRows, ScanPipeline, error_at

ERRORS = MeasuredErrors(ranges=(1.0, 3.0), bearings=(-1.0, 1.0), noise=((0.01, 0.03), (0.02, 0.06)),
                        bias=((0.1, 0.2), (-0.1, -0.2)), dropout=((0.0, 0.2), (0.1, 0.4)), source="made up")


class Still:
    """A LiDAR that measures the same ranges for ever."""

    def __init__(self, ranges):
        self.beams, self._ranges = LidarModel.load().beams, ranges

    def ranges(self, data):
        return self._ranges.copy()


class At:
    time = 0.0


def test_the_tables_are_linear_between_the_knots_and_constant_beyond():
    values = ERRORS.at(np.array([-3.0, -1.0, 0.0, 1.0, 2.0]))
    assert values[:, :, 0] == pytest.approx(np.array([[1, 3], [1, 3], [1.5, 4.5], [2, 6], [2, 6]]) / 100.0)
    knots, beam = np.array([1.0, 3.0, math.inf]), np.array([[0.01, 0, 0], [0.03, 0, 0], [9.0, 0, 0]])
    for distance, expected in [(0.0, 0.01), (1.0, 0.01), (2.0, 0.02), (3.0, 0.03), (20.0, 0.03), (math.inf, 0.03)]:
        assert error_at(knots, beam, 0, distance) == pytest.approx(expected)


def test_noise_bias_and_dropouts_of_a_beam_are_those_of_its_range_and_bearing():
    """Oracle: the tables by hand at two bearings and 2 m, in the middle between the knots."""
    lidar = Still(np.full(1081, 2.0))
    pipeline = ScanPipeline(lidar, LidarEffects(measured=ERRORS), 0)
    readings = np.array([pipeline.scan(At).ranges for _ in range(800)])
    for bearing, noise, bias, dropout in [(-1.5, 0.02, 0.15, 0.1), (1.5, 0.04, -0.15, 0.25)]:
        some = readings[:, np.abs(lidar.beams.bearings - bearing) < 0.2].ravel()
        failed, n = np.isnan(some), len(some)
        errors = some[~failed] - 2.0
        assert abs(failed.mean() - dropout) < 4 * math.sqrt(dropout * (1 - dropout) / n)
        assert abs(errors.mean() - bias) < 5 * noise / math.sqrt(n)
        assert abs(errors.std() - noise) < 5 * noise / math.sqrt(2 * n)


def test_rows_of_a_batch_have_the_bits_of_a_pipeline_beside_rows_without():
    lidar = Still(np.linspace(0.0, 31.0, 1081))
    lidar._ranges[-20:], lidar._ranges[:3] = math.inf, -math.inf
    plain = LidarEffects(range_noise_std=0.01, dropout_probability=0.1)
    third = MeasuredErrors(ranges=(2.0,), bearings=(0.0,), noise=((0.5,),), bias=((0.0,),), dropout=((0.0,),))
    cases = [LidarEffects(measured=ERRORS, range_noise_std=0.01, latency=0.03), plain,
        LidarEffects(measured=third, dropout_probability=0.2, no_return="range_max"), LidarEffects(measured=ERRORS)]
    rows = EffectsOfRows(lidar.beams, len(cases))
    pipelines = []
    for row, effects in enumerate(cases):
        rows.begin(row, effects, seed=row)
        pipelines.append(ScanPipeline(lidar, effects, row))
    for _ in range(3):
        ranges = np.array([lidar.ranges(None) for _ in cases])
        rows.apply(np.ones(len(cases), bool), ranges)
        for row, pipeline in zip(ranges, pipelines, strict=True):
            assert row.tobytes() == pipeline.scan(At).ranges.tobytes()


def test_a_file_is_read_back_and_a_setup_keeps_it(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(ERRORS.toml)
    assert MeasuredErrors.load(str(file)) == ERRORS
    setup = fg.Setup.of("oval", lidar_effects=str(file), lidar_noise=0.01)
    assert setup.first.effects == LidarEffects(measured=ERRORS, range_noise_std=0.01)
    assert fg.Setup.read(setup.write(tmp_path / "race.toml")) == setup
    assert setup != fg.Setup.of("oval", lidar_noise=0.01)
