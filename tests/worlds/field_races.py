"""Races of several cars that the tests of what shows them share."""

import functools

import fg_mujoco as fg


class Listener:
    """Drives on, gently, and keeps what it was told."""

    def __init__(self, speed=0.5, steering_angle=0.05):
        self.speed, self.steering_angle, self.heard = speed, steering_angle, []

    def reset(self):
        pass

    def __call__(self, scan, odometry):
        self.heard.append((scan, odometry))
        return fg.DriveCommand(steering_angle=self.steering_angle, speed=self.speed)


@functools.cache
def three_cars():
    """Three seconds of three cars of two kinds, the last of which is the fastest."""
    entries = [fg.Entry(controller="gap_finder", max_speed=2.0),
               fg.Entry(controller="disparity_extender", max_speed=3.0, name="blue one"),
               fg.Entry(controller="gap_finder", vehicle="nuc2", max_speed=5.0)]  # fmt: skip
    return fg.race("oval", entries=entries, laps=1, time_limit=3.0)


@functools.cache
def shunt():
    """Two seconds in which a car drives into one that stands; the race and the planners."""
    planners = Listener(speed=0.0), Listener(speed=3.0, steering_angle=0.0)
    noise = fg.LidarEffects(range_noise_std=0.02, dropout_probability=0.01, latency=0.03)
    entries = [fg.Entry(controller=planners[0], start=fg.Start(s=1.5)),
               fg.Entry(controller=planners[1], start=fg.Start(s=0.0, offset=0.02), effects=noise, seed=7,
                        odometry_drift=0.01)]  # fmt: skip
    return fg.race("oval", entries=entries, laps=1, time_limit=2.0), planners
