"""Finds whether a car's odometry is negative where the car drives forward, or never turns, and mends it.

On a stock F1TENTH car one of two topics is: the driver of f1tenth/vesc, branch main, sends -1 times the motor's turns
on /sensors/core (vesc_driver/src/vesc_packet.cpp), and its odometry turns the sign back (vesc_to_odom.cpp: `-speed`).
Branch ros2 has the second alone, so that /odom is negative, and by f1tenth_system's vesc.yaml its yaw rate is always 0.
Two witnesses say how the car moved: the drive commands, and the scans, by the range flow of still surroundings

    dr/dt = -v (cos b + r' sin b / r) + w r'      r' = dr/db, b the bearing

which is solved for the speed v and the yaw rate w by least squares without outliers. Source: Gonzalez and Gutierrez,
Direct motion estimation from a range scan sequence, Journal of Robotic Systems 16(2), 1999.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fg_mujoco.messages import FloatArray, LaserScan

from .bag_messages import ODOMETRY, heading_of
from .composed_topics import SPEED_TO_ERPM

_MOVING, _TURNING = 0.5, 0.3  # [m/s], [rad/s] of a car whose direction counts
_LATEST = 0.3  # [s] that a command or a scan may be old
_FEWEST, _CLEAR = 20, 0.8  # votes, and the share of one side, that decide
_ENOUGH, _MOST = 400, 4000  # votes after which no more are asked for: with turns, and without
_CERTAIN = 3.0  # standard errors of a rate that votes
_REACH = 0.02  # [rad] to each side, over which the slope of a scan is taken
_STEEP = 4.0  # slope over range [1/rad], from which on beams pass an edge
_ROBUST = 2.5 * 1.4826  # times the median of the residuals, beyond which a beam is left out


@dataclass(frozen=True, kw_only=True)
class Signs:
    """What a topic's numbers are to be multiplied by, 1 or -1."""

    speed: int = 1
    yaw_rate: float = 1.0  # NaN: it says none
    in_pose: bool = False  # whether its poses have the same signs


class _Votes:
    """Votes for and against a sign."""

    def __init__(self) -> None:
        self.count = self.against = 0

    def add(self, product: float) -> None:
        self.count += 1
        self.against += product < 0.0

    @property
    def said(self) -> int:
        """1 or -1; 0: they do not say."""
        clear = _CLEAR * self.count
        if self.count < _FEWEST:
            return 0
        return -1 if self.against >= clear else int(self.count - self.against >= clear)


class SignFinder:
    """Compares a topic of odometry or of a motor with the commands and the scans."""

    def __init__(self) -> None:
        self._by_scans, self._by_commands = _Votes(), _Votes()
        self._turn_by_scans, self._turn_by_steering = _Votes(), _Votes()
        self._in_pose, self._forward, self._turns = _Votes(), _Votes(), _Votes()
        self._rates: tuple[float, float, float] | None = None  # time [s], speed, yaw rate
        self._command: tuple[float, float, float] | None = None  # time [s], speed, steering angle
        self._scan: tuple[float, LaserScan] | None = None
        self._pose: FloatArray | None = None

    @property
    def knows(self) -> bool:
        """Whether no further messages are needed."""
        votes = self._by_scans.count + self._by_commands.count
        return votes >= (_ENOUGH if self._turns.said else _MOST)

    def hear_odometry(self, time: float, message: Any) -> None:
        """Take a message of the topic, at a time [s]."""
        speed, yaw_rate = _rates(message)
        self._rates = (time, speed, yaw_rate)
        if abs(speed) > _MOVING:
            self._forward.add(speed)
            if self._command is not None and time - self._command[0] < _LATEST and abs(self._command[1]) > _MOVING:
                self._by_commands.add(speed * self._command[1])
                if abs(yaw_rate) > _TURNING:
                    self._turn_by_steering.add(yaw_rate * self._command[1] * self._command[2])
        if message.__msgtype__ == ODOMETRY:
            place = message.pose.pose.position
            pose = np.array((place.x, place.y, heading_of(message.pose.pose.orientation)))
            if self._pose is not None and abs(speed) > _MOVING:
                step = pose[:2] - self._pose[:2]
                ahead = step[0] * math.cos(pose[2]) + step[1] * math.sin(pose[2])
                if abs(ahead) > 1e-4:
                    self._in_pose.add(ahead * speed)
            self._pose = pose

    def hear_command(self, time: float, message: Any) -> None:
        """Take an AckermannDriveStamped."""
        self._command = time, float(message.drive.speed), float(message.drive.steering_angle)

    def hear_scan(self, time: float, scan: LaserScan) -> None:
        """Take a scan, turned as it is mounted on the car."""
        before, self._scan = self._scan, (time, scan)
        if before is None or self._rates is None or time - self._rates[0] > _LATEST or abs(self._rates[1]) < _MOVING:
            return
        if not 0.0 < time - before[0] < _LATEST:
            return
        found = range_flow(before[1], scan, time - before[0])
        if found is None:
            return
        (v, w), (v_error, w_error) = found
        if abs(v) > max(_CERTAIN * v_error, 0.5 * _MOVING):
            self._by_scans.add(v * self._rates[1])
        if abs(w) > max(_CERTAIN * w_error, _TURNING):
            self._turns.add(1.0 if self._rates[2] else -1.0)
        if abs(w) > max(_CERTAIN * w_error, 0.5 * _TURNING) and abs(self._rates[2]) > _TURNING:
            self._turn_by_scans.add(w * self._rates[2])

    def signs(self, *, turns: bool) -> tuple[Signs, str]:
        """Return the signs, and what is to be said of them, if anything; `turns`: the topic has a yaw rate at all."""
        scans, commands = self._by_scans.said, self._by_commands.said
        never = turns and self._turns.said < 0
        told = ["its yaw rate is always 0, also where the scans turn, and is not read"] if never else []
        found = Signs()
        if scans < 0 < commands or commands < 0 < scans:
            ours, theirs = ("scans", "commands") if scans < 0 else ("commands", "scans")
            told.append(f"the {ours} say that it is negative forward, the {theirs} do not; its sign stays")
        # of a LiDAR that looks backwards the scans say so, too: without commands, the car must have driven backwards
        elif commands < 0 or (scans < 0 and (commands or self._forward.said < 0)):
            by = " and the ".join(name for name, said in (("commands", commands), ("scans", scans)) if said < 0)
            told.append(f"it is negative where the car drives forward, by the {by}; its sign is turned round")
            turn = float(self._turn_by_scans.said or self._turn_by_steering.said or -1)
            found = Signs(speed=-1, yaw_rate=turn, in_pose=self._in_pose.said > 0)
        return (replace(found, yaw_rate=math.nan) if never else found), "; ".join(told)


def range_flow(before: LaserScan, scan: LaserScan, seconds: float) -> tuple[FloatArray, FloatArray] | None:
    """Return speed [m/s] and yaw rate [rad/s] between two scans, and their standard errors; None: too few beams."""
    count, step = len(scan.ranges), scan.angle_increment
    reach = max(round(_REACH / step), 1) if step > 0.0 else count
    if len(before.ranges) != count or count <= 2 * reach:
        return None
    with np.errstate(invalid="ignore", divide="ignore"):
        ranges, change = 0.5 * (before.ranges + scan.ranges), (scan.ranges - before.ranges) / seconds
        slope = np.full(count, math.nan)
        slope[reach:-reach] = (ranges[2 * reach :] - ranges[: -2 * reach]) / (2 * reach * step)
        bearing = scan.angle_min + step * np.arange(count)
        along = -np.cos(bearing) - slope * np.sin(bearing) / ranges
        kept = np.isfinite(along + change) & (np.abs(slope) < _STEEP * ranges)
    if np.count_nonzero(kept) < _FEWEST:
        return None
    design, values = np.column_stack((along, slope))[kept], change[kept]
    inside = np.ones(len(values), np.bool_)
    for _ in range(4):
        found = np.linalg.lstsq(design[inside], values[inside], rcond=None)[0]
        residuals = np.abs(values - design @ found)
        inside = residuals <= max(_ROBUST * float(np.median(residuals)), 1e-9)
    power = np.linalg.pinv(design[inside].T @ design[inside])
    return found, np.sqrt(np.diag(power) * float(np.mean(residuals[inside] ** 2)))


def turn_round(message: Any, signs: Signs) -> Any:
    """Give the numbers of an Odometry or of a motor their signs, in place, and return the message."""
    if message.__msgtype__ != ODOMETRY:
        message.state.speed *= signs.speed
        return message
    twist, pose = message.twist.twist, message.pose.pose
    twist.linear.x *= signs.speed
    twist.angular.z *= signs.yaw_rate
    if signs.in_pose:  # the sum of such steps, from where it began
        turn = 1.0 if math.isnan(signs.yaw_rate) else signs.yaw_rate
        pose.position.x *= signs.speed
        pose.position.y *= signs.speed * turn
        pose.orientation.z *= turn
    return message


def _rates(message: Any) -> tuple[float, float]:
    """Return the speed [m/s] and the yaw rate [rad/s] that an Odometry or a motor says."""
    if message.__msgtype__ == ODOMETRY:
        return float(message.twist.twist.linear.x), float(message.twist.twist.angular.z)
    return float(message.state.speed) / SPEED_TO_ERPM, 0.0
