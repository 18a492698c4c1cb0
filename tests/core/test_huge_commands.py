"""A huge finite command is held by the car as any other, counted as clamped, and recorded for whatever reads runs."""

import csv
import json
import warnings

import numpy as np
import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.cli.main import main
from fg_mujoco.racing.run_folder import read_run
from fg_mujoco.simulation.telemetry import COMMAND, GREATEST_COMMAND

HUGE = """
from fg_mujoco.messages import DriveCommand
ASKED = {5: (1e300, -1e300), 8: (-1.7e308, 1.7e308), 9: (14.4, 2.0)}
class Huge:
    def reset(self):
        self.count = -1
    def __call__(self, scan, odometry):
        self.count += 1
        steering_angle, speed = ASKED.get(self.count, (0.0, 1.0))
        return DriveCommand(steering_angle=steering_angle, speed=speed)
"""
CAR = fg.Vehicle.load("f1tenth").parameters
LOCK = CAR.max_steering_angle


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder with the run `one` of a planner with huge commands, and the run `two` in which it is an opponent."""
    here = tmp_path_factory.mktemp("huge")
    (here / "huge.py").write_text(HUGE)
    planner = f"{here / 'huge.py'}:Huge"
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        assert main(["race", "--controller", planner, "--time-limit", "0.3", "--out", str(here / "one")]) == 1
        assert main(["race", "--opponents", planner, "--time-limit", "0.3", "--out", str(here / "two")]) == 1
    return here


@pytest.mark.slow
@each(("folder", "car"), [("one", 0), ("two", 1)])
def test_it_is_held_recorded_and_counted(runs, folder, car):
    run = read_run(runs / folder)
    telemetry = (run.telemetry, *run.others)[car]
    commands, held = telemetry[:, COMMAND : COMMAND + 2], run.ctrl[:, 2 * car : 2 * car + 2]
    most = GREATEST_COMMAND
    assert commands[[5, 8, 9]].tolist() == [[most, -most], [-most, most], [14.4, 2.0]]
    assert held[[5, 8, 9], 0].tolist() == [LOCK, -LOCK, LOCK]
    assert held[5, 1] >= CAR.min_speed and held[8, 1] <= CAR.max_speed
    assert run.summary["cars"][car].get("clamped_commands", run.summary["clamped_commands"]) == 3
    assert np.isfinite(run.states).all() and np.abs(run.states).max() < 1e6


@each("folder", ["one", "two"])
@pytest.mark.slow
def test_the_folder_has_numbers_only_and_replays(runs, folder, capsys):
    for path in (runs / folder).iterdir():
        if path.suffix == ".csv":
            with path.open() as file:
                rows = [[float(value) for value in row if value] for row in list(csv.reader(file))[1:]]
            assert not any(abs(value) > 1e6 for row in rows for value in row)  # NaN is what there is no figure of
    json.loads((runs / folder / "summary.json").read_text(), parse_constant=lambda name: pytest.fail(name))
    assert (runs / folder / "trace.png").stat().st_size > 10_000
    assert main(["replay", str(runs / folder)]) == 0
    assert "bit-identical" in capsys.readouterr().out
