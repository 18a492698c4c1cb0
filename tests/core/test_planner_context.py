"""What a planner is told: the same fields at every door, made in one place."""

import json
import math
from dataclasses import fields

import pytest

import fg_mujoco as fg
from cases import each
from fg_mujoco.addons.look.live.live_session import LiveSession
from fg_mujoco.errors import ControllerError, MessageError
from fg_mujoco.lidar.effects import LidarEffects
from fg_mujoco.messages import PlannerContext
from fg_mujoco.racing.setup import Setup
from fg_mujoco.vehicle.changes import CarChanges

PLANNER = """
import json
from pathlib import Path

import fg_mujoco as fg


class Told:
    def __init__(self, {names}):
        told = dict({numbers})
        with Path({file!r}).open("a") as kept:
            kept.write(json.dumps(told) + "\\n")

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        return fg.DriveCommand(steering_angle=0.0, speed=0.5)
"""
NUMBERS = ("mu", "max_speed", "period", "latency", "seed")
CAR = {"mu": 0.8, "max_speed": 3.0}
LATE = {"effects": LidarEffects(latency=0.03), "changes": CarChanges(command_delay=0.02), "seed": 7}


def written(folder, *more):
    """The name of a planner that writes down what it is told, and the file that it writes."""
    file, names = folder / "told.jsonl", (*NUMBERS, *more)
    wanted, numbers = ", ".join(("car", "map_line", *names)), ", ".join(f"{name}={name}" for name in names)
    (folder / "told.py").write_text(PLANNER.format(names=wanted, file=str(file), numbers=numbers))
    return f"{folder / 'told.py'}:Told", file


def race(planner, folder):
    fg.race("oval", planner, laps=1, time_limit=0.1, **CAR, **LATE)


def race_of_entries(planner, folder):
    fg.race("oval", entries=[fg.Entry(controller=planner, **CAR, **LATE), fg.Entry()], laps=1, time_limit=0.1)


def rollout(planner, folder):
    fg.rollout("oval", planner, n=1, seeds=[7], time_limit=0.1, **CAR, **{k: v for k, v in LATE.items() if k != "seed"})


def rollout_with_opponents(planner, folder):
    fg.rollout("oval", n=1, time_limit=0.1, workers=1, opponents=[fg.Entry(controller=planner, **CAR, **LATE)])


def compare(planner, folder):
    fg.compare([planner], track=["oval"], seed=[7], max_speed=[3.0], laps=1, mu=0.8, time_limit=0.1, workers=1,
               lidar_noise=0.01, changes=LATE["changes"], out=folder / "out", pictures=False)  # fmt: skip


def environment(planner, folder):
    gym_environment = pytest.importorskip("fg_mujoco.envs.gym_environment")
    env = gym_environment.F1TenthEnv(track="oval", opponents=[fg.Entry(controller=planner, **CAR, **LATE)])
    env.reset(seed=0)
    env.close()


def live_view(planner, folder):
    LiveSession(Setup.of(controller=planner, **CAR, **LATE))


def live_opponents(planner, folder):
    session = LiveSession(Setup.of(opponents=(fg.Entry(controller=planner, **CAR, **LATE),)))
    session.reset()


def debug(planner, folder):
    result = fg.race("oval", planner, laps=1, time_limit=0.1, **CAR, **LATE)
    (folder / "told.jsonl").unlink()
    from fg_mujoco.addons.look.debug.debugged_run import debug as debug_run

    debug_run(result, trust=True)


DOORS = (race, race_of_entries, rollout, rollout_with_opponents, compare, environment, live_view, live_opponents, debug)


@each("door", DOORS)
def test_every_door_tells_the_same(door, tmp_path):
    planner, file = written(tmp_path)
    door(planner, tmp_path)
    late = 0.02 if door is compare else 0.05 + 0.02  # two sweeps, and the commands' own; compare has no late scans
    lines = [json.loads(line) for line in file.read_text().splitlines()]
    seeds = [told.pop("seed") for told in lines]
    assert lines == [pytest.approx({**CAR, "period": 0.025, "latency": late})] * len(lines)
    assert 7 in seeds


def test_a_planner_names_what_it_wants_and_is_refused_what_there_is_not():
    context = fg.Entry().context(fg.Vehicle.load().parameters, None)
    assert context.mu == fg.Vehicle.load().nominal_mu and context.map_line is None
    assert callable(fg.make_controller("gap_finder", context))
    with pytest.raises(fg.SettingsError, match=r"max_speeed.*did you mean 'max_speed'"):
        fg.make_controller("gap_finder", car=context.car, mu=1.0, max_speeed=8.0)
    with pytest.raises(ControllerError, match="lacks mu, max_speed"):
        fg.make_controller("gap_finder", car=context.car)


@each(
    "wrong", [{"mu": 0.0}, {"mu": math.nan}, {"max_speed": math.inf}, {"period": 0.0}, {"latency": -0.1}]
)
def test_what_cannot_be_is_refused_by_name(wrong):
    right = {"car": fg.Vehicle.load().parameters, "mu": 1.0, "max_speed": 8.0}
    assert {each.name for each in fields(PlannerContext)} >= set(right)
    with pytest.raises(MessageError, match=next(iter(wrong))):
        PlannerContext(**(right | wrong))
