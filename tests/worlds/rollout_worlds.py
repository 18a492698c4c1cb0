"""A stand-in for the engine: what a world gives is worked out from its scenario alone, at once."""

import math

import numpy as np

from fg_mujoco.rollouts.drive_worlds import RESULT, WorldResults
from fg_mujoco.simulation.telemetry import TELEMETRY

STATE = 5


def stand_in(scenarios, controller, *, laps=None, time_limit=None, record="summary", watch=None, **others):
    """Has the interface of `drive_worlds`. Worlds of an even seed finish, the others crash; one in ten at once."""
    rows = np.zeros(len(scenarios), RESULT)
    lap_times = np.full((len(scenarios), laps or 1), math.nan)
    telemetry, states, ctrl = [], [], []
    for i, scenario in enumerate(scenarios):
        finished = scenario.seed % 2 == 0
        lap_times[i, : (laps or 1) if finished else 0] = scenario.track.length / scenario.max_speed
        ticks = scenario.seed % 10
        rows[i]["seed"] = scenario.seed
        rows[i]["end_reason"] = "finished" if finished else "crash"
        rows[i]["collisions"] = not finished
        rows[i]["sim_time_s"] = ticks
        rows[i]["first_lap_s"] = lap_times[i, 0]
        rows[i]["best_lap_s"] = lap_times[i].min()
        rows[i]["max_slide_m_s"] = scenario.changes.mu or 0.0
        random = np.random.default_rng(scenario.seed)
        telemetry.append(random.random((ticks, len(TELEMETRY))))
        states.append(random.random((ticks + 1, STATE + len(scenario.obstacles))))
        ctrl.append(random.random((ticks, 2)))
        if watch is not None:
            watch(float(ticks))
    return WorldResults(rows=rows, lap_times_s=lap_times, telemetry=tuple(telemetry) if record != "summary" else (),
        states=tuple(states) if record == "states" else (), ctrl=tuple(ctrl) if record == "states" else ())  # fmt: skip
