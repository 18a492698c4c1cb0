"""A planner of one's own on the shared pieces: its settings and its memory reach its kernel, alone and in a batch."""

from dataclasses import dataclass

import numpy as np
import pytest
from scan_worlds import CAR, MU, corridor, odometry_of

from fg_mujoco.controllers.control.compiled_planner import MEMORY, CompiledPlanner
from fg_mujoco.controllers.control.driving import DrivingSettings, drive
from fg_mujoco.controllers.control.records import record_type
from fg_mujoco.controllers.perception.scan_filters import valid_ranges
from fg_mujoco.errors import SettingsError
from fg_mujoco.kernels import kernel
from fg_mujoco.messages import ODOMETRY


@dataclass(frozen=True, kw_only=True)
class PatientSettings(DrivingSettings):
    """A number of each kind."""

    patience: int = 2  # ticks before it drives off
    speed: float = 3.0  # [m/s]
    backwards: bool = False


@kernel
def decide(memory, planner, ranges, scan, odometry, paths):
    settings = planner.settings
    speed = settings.speed if memory.ticks >= settings.patience else 0.0
    if settings.backwards:
        speed = -speed
    memory.ticks += 1
    return drive(
        scan, valid_ranges(ranges, scan.range_max), odometry, planner.driver, memory.driving, paths, 0.1, speed
    )


class Patient(CompiledPlanner):
    """Waits, then drives."""

    Settings = PatientSettings
    memory_type = np.dtype([*MEMORY.descr, ("ticks", np.int64)])
    decide = staticmethod(decide)


def speeds(planner, ticks):
    return [planner(corridor(2.0, 2.0), odometry_of(0.0)).speed for _ in range(ticks)]


def test_settings_and_memory_reach_the_kernel():
    for patience in (0, 1, 3):
        planner = Patient(CAR, MU, settings=PatientSettings(patience=patience))
        moving = [speed > 0.0 for speed in speeds(planner, 5)]
        assert moving == [tick >= patience for tick in range(5)]
        planner.reset()
        assert [speed > 0.0 for speed in speeds(planner, 5)] == moving
    assert speeds(Patient(CAR, MU, settings=PatientSettings(backwards=True)), 3)[2] < 0.0


def test_a_planner_that_believes_in_no_limit_gets_what_it_wishes_for():
    planner = Patient(CAR, np.inf, settings=PatientSettings(patience=0, speed=7.0))
    command = planner(corridor(1.0, 1.0, ahead=0.5), odometry_of(0.0))
    assert (command.steering_angle, command.speed) == (0.1, 7.0)


def test_each_world_of_a_batch_has_a_memory_of_its_own():
    planners = [Patient(CAR, MU, settings=PatientSettings(patience=patience)) for patience in (2, 0, 1)]
    batch, scan, rows = Patient.batch(planners), corridor(2.0, 2.0), np.zeros(3, ODOMETRY)
    commands = np.zeros((3, 2))
    for tick in range(4):
        running = np.array([True, True, tick != 0])  # the last one's patience begins when it does
        batch(scan, np.tile(scan.ranges, (3, 1)), rows, running, commands)
        assert (commands[:, 1] > 0.0).tolist() == [tick >= 2, True, tick >= 2]


def test_the_type_of_a_record_has_the_fields_of_the_dataclass():
    own = record_type(PatientSettings)[["patience", "speed", "backwards"]]
    assert [(name, own[name]) for name in own.names] == [("patience", int), ("speed", float), ("backwards", bool)]


def test_the_settings_of_another_planner_are_refused():
    with pytest.raises(SettingsError, match=r"Patient\.settings is 3; accepted: a PatientSettings"):
        Patient(CAR, MU, settings=3)
