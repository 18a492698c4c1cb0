"""Tasks for the models of `validate`: one window, with the same commands in each of its ticks."""

import numpy as np

from fg_mujoco.addons.realcar.validation.car_model import BEFORE, Task
from fg_mujoco.addons.realcar.validation.windows import PERIOD


def task(steering, drive, start, seconds, *, kind):
    count = round(seconds / PERIOD)
    row = np.full((1, BEFORE + count), 1.0)
    return Task(starts=np.array([start]), counts=np.array([count]), steering=steering * row, drive=drive * row,
                kinds=np.array([kind]))  # fmt: skip
