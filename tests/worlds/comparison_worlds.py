"""Controllers that are quick to drive, for comparisons: in a file, as a user has them."""

import os

from fg_mujoco.addons.arena.runs.recorded_commands import _drive

PLANNERS = """
import os, signal, time
from dataclasses import dataclass
from fg_mujoco.messages import DriveCommand

@dataclass(frozen=True, kw_only=True)
class GentleSettings:
    speed: float = 1.0  # [m/s]
    steering: float = 0.0  # [rad]
    brakes_at: float = 99.0  # [s]
    slows: float = 99.0  # [m/s^2] from then on

class Gentle:
    Settings, speed = GentleSettings, None
    def __init__(self, settings): self.settings = settings
    def reset(self): print("ready")
    def now(self, time): pass
    def __call__(self, scan, odometry):
        self.now(scan.stamp)
        own = self.settings
        speed = own.speed if self.speed is None else self.speed
        speed = speed if scan.stamp <= own.brakes_at else max(speed - own.slows * (scan.stamp - own.brakes_at), 0.0)
        return DriveCommand(steering_angle=own.steering, speed=speed)

@dataclass(frozen=True, kw_only=True)
class SteadySettings(GentleSettings):
    speed: float = 2.0

class Steady(Gentle): Settings = SteadySettings
class Stands(Gentle): speed = 0.0
class Goes(Gentle): speed = 5.0

class Broken(Gentle):
    def now(self, time):
        if time > 0.2: raise ValueError("no\\n more")

class Deadly(Gentle):
    def now(self, time): os.kill(os.getpid(), signal.SIGKILL)

class Slow(Gentle):
    speed = 0.1
    def reset(self): pass
    def now(self, at): time.sleep(0.005)
"""
FAILS_AT = PLANNERS[: PLANNERS.index("raise ValueError")].count("\n") + 1


def recorded_here(planner, setup):
    """Do as `record` of recorded_commands does, in this process, for who doesn't look at the planner's own."""
    with open(os.devnull, "wb") as beats:
        return _drive(planner, setup, beats.fileno())


def files(folder):
    """Return what the files of a folder hold, by their names."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

SUITE = """
name = "small"
version = 2
assists = ["none", "full"]
laps = 1
max_speed = 3.0

[[groups]]
name = "circuits"
track = ["oval", "hairpins"]

[[groups]]
name = "boxes"
track = "oval"
obstacles = 2
obstacle_seed = [5, 6]
max_speed = 4.0
"""
"""Of two groups; tests change a line of it."""
