"""Controllers that are quick to drive, for comparisons: in a file, as a user has them."""

PLANNERS = """
import os
import signal
import time
from dataclasses import dataclass
from fg_mujoco.messages import DriveCommand


@dataclass(frozen=True, kw_only=True)
class GentleSettings:
    speed: float = 1.0
    steering: float = 0.0


class Gentle:
    Settings = GentleSettings

    def __init__(self, settings):
        self.settings = settings

    def reset(self):
        print("ready")

    def __call__(self, scan, odometry):
        return DriveCommand(steering_angle=self.settings.steering, speed=self.settings.speed)


class Broken:
    def reset(self):
        pass

    def __call__(self, scan, odometry):
        if scan.stamp > 0.2:
            raise ValueError("no\\n more")
        return DriveCommand(steering_angle=0.0, speed=1.0)


class Deadly(Broken):
    def __call__(self, scan, odometry):
        os.kill(os.getpid(), signal.SIGKILL)


class Slow(Broken):
    def __call__(self, scan, odometry):
        time.sleep(0.005)
        return DriveCommand(steering_angle=0.0, speed=0.1)
"""


def files(folder):
    """Return what the files of a folder hold, by their names."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
