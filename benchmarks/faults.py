"""Whether the tests find faults: each of a list is made in a copy of the package, and the tests of its room run there.

    python benchmarks/faults.py [--only WORD,WORD] [--checkout FOLDER] [--whole] [--json FILE]

A fault is one of those that people make: a sign, an off-by-one, a swapped argument, a dropped clamp, a wrong unit. It
is found if a test fails which passes without it; the first one is named. The exit code is 1 if a fault was not found.
Most faults are of the native core, which is built again for each.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from common import parser, report, table

ROOT = Path(__file__).parent.parent
INSIDE = ("addons", "controllers", "models", "tracks")
"""Folders of the repository that are installed inside fg_mujoco."""
LINKED = ("benchmarks", "docs", "examples", "tools", "README.md", "CHANGELOG.md", "CONTRIBUTING.md",
          "Makefile", "mkdocs.yml", "pyproject.toml", "constraints.txt")  # fmt: skip
"""What tests read besides the package."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A change of one place in a file, and the tests that should find it."""

    file: str
    old: str  # once in the file
    new: str
    tests: str  # names of files below tests/, between blanks

    @property
    def room(self) -> str:
        """The folder in the package, the add-on, or the folder in the repository."""
        parts = Path(self.file).parts
        return parts[1] if parts[0] in ("fg_mujoco", "addons", "native") and len(parts) > 2 else parts[0]


FAULTS = {
    # the lap that is remembered, and the line through it
    "the error of the dead reckoning that is added again when a lap closes": Fault(
        file="native/controllers/perception/lap_map.cpp",
        old="const double shift_x = pose.x - here_x, shift_y = pose.y - here_y;",
        new="const double shift_x = here_x - pose.x, shift_y = here_y - pose.y;",
        tests="test_lap_map.py",
    ),
    "scans that are matched in the wrong direction": Fault(
        file="native/controllers/perception/lap_map.cpp",
        old="right[i] -= slope[i] * error;",
        new="right[i] += slope[i] * error;",
        tests="test_lap_map.py",
    ),
    "a line that braking follows as if the car drove straight ahead": Fault(
        file="native/controllers/safety/line_following.cpp",
        old="const double used = square * demand / grip;",
        new="const double used = 0.0 * demand / grip;",
        tests="test_lap_map.py",
    ),
    # floors, and the LiDAR of real cars
    "tires on another floor with the ratio of the floors turned over": Fault(
        file="addons/realcar/floors.py",
        old="own * self.mu / Floor.load(tires.floor).mu",
        new="own * Floor.load(tires.floor).mu / self.mu",
        tests="test_floors.py",
    ),
    "the friction of a floor that reaches the planner and not the car": Fault(
        file="fg_mujoco/simulation/settings.py",
        old="course, self.car, mu=self.set_mu,",
        new="course, self.car, mu=self.mu,",
        tests="test_floors.py",
    ),
    "a LiDAR's bias with the wrong sign": Fault(
        file="native/lidar/scan_effects.cpp",
        old="distance += error_at(knots, values, 1, distance) + deviation * effects.noise[beam];",
        new="distance += deviation * effects.noise[beam] - error_at(knots, values, 1, distance);",
        tests="test_measured_errors.py",
    ),
    # vehicle
    "a tire's slip angle without its arctangent's sign": Fault(
        file="native/vehicle/tire_patch.hpp",
        old="angle = fg::atan(across * per_length_) *",
        new="angle = -fg::atan(across * per_length_) *",
        tests="test_tire_forces.py test_tires.py",
    ),
    "the load sensitivity with the wrong sign": Fault(
        file="native/vehicle/tire_patch.hpp",
        old="fg::pow(load / tire.nominal_load, -tire.load_sensitivity)",
        new="fg::pow(load / tire.nominal_load, tire.load_sensitivity)",
        tests="test_tire_forces.py test_tires.py",
    ),
    "Coulomb friction without its limit": Fault(
        file="native/vehicle/tires.hpp",
        old="return numbers[0] * min(numbers[1] * slip, 1.0);",
        new="return numbers[0] * numbers[1] * slip;",
        tests="test_tire_forces.py test_tires.py test_slides.py",
    ),
    "the sideslip angle at the centre of gravity the wrong way": Fault(
        file="native/vehicle/motion.cpp",
        old="left = vy + yaw_rate * car[0].rear_axle_distance",
        new="left = vy - yaw_rate * car[0].rear_axle_distance",
        tests="test_race.py test_car_motion.py test_car.py test_car_dynamics.py",
    ),
    "no limit of the steering command": Fault(
        file="native/vehicle/motion.cpp",
        old="ctrl[limits.steering_ctrl] = min(max(steering_angle, -most), most)",
        new="ctrl[limits.steering_ctrl] = steering_angle",
        tests="test_car.py test_car_dynamics.py test_huge_commands.py",
    ),
    "a steering that does not end where its joint does": Fault(
        file="native/vehicle/tire_solve.cpp",
        old="if (angle < gear.steering_range[0] || angle > gear.steering_range[1])",
        new="if (angle > 1e9)",
        tests="test_car.py",
    ),
    "a delay of the speed's commands that goes the wrong way": Fault(
        file="addons/realcar/identification/speed_response.py",
        old="held(motion.time - delay)",
        new="held(motion.time + delay)",
        tests="test_identification.py",
    ),
    "a shaft that turns its axles against each other": Fault(
        file="fg_mujoco/vehicle/drive_line.py",
        old='2.0 if wheel.startswith("front") else -2.0',
        new="2.0",
        tests="test_drive_line.py",
    ),
    "tires scaled to another friction across and not along": Fault(
        file="fg_mujoco/vehicle/tires/sets.py",
        old="longitudinal=axle.longitudinal.scaled(share)",
        new="longitudinal=axle.longitudinal",
        tests="test_tires.py",
    ),
    # sensors
    "a pose that drifts in proportion to time": Fault(
        file="fg_mujoco/vehicle/sensors/bundled.py",
        old="self.drift * math.sqrt(passed)",
        new="self.drift * passed",
        tests="test_pose.py",
    ),
    "a VESC's heading by the motion of the car and not by the command": Fault(
        file="fg_mujoco/vehicle/sensors/vesc.py",
        old="steering = float(car.ctrl[motor.steering])",
        new='steering = float(car.odometry["steering_angle"])',
        tests="test_vesc.py",
    ),
    "readings that are delivered a step late": Fault(
        file="fg_mujoco/simulation/sensing.py",
        old="while self._held and self._held[0][0] <= time - self.sensor.delay + _SAME_TIME:",
        new="while self._held and self._held[0][0] < time - self.sensor.delay - _SAME_TIME:",
        tests="test_sensors.py",
    ),
    "readings that drop out as often as they should not": Fault(
        file="fg_mujoco/simulation/sensing.py",
        old="self._rng.random() < sensor.dropout_probability:",
        new="self._rng.random() > sensor.dropout_probability:",
        tests="test_sensors.py",
    ),
    "a sensor's rate rounded down": Fault(
        file="fg_mujoco/vehicle/sensors/sensor.py",
        old="whole = max(round(steps), 1)",
        new="whole = max(int(steps), 1)",
        tests="test_sensors.py",
    ),
    "drift of the odometry without the yaw rate": Fault(
        file="fg_mujoco/vehicle/motion.py",
        old="""    rows["angular_velocity"][:, 2] *= factors""",
        new="""    rows["angular_velocity"][:, 1] *= factors""",
        tests="test_odometry_drift.py test_sensors.py",
    ),
    # lidar
    "the tail of the normal density without its sign": Fault(
        file="native/lidar/random_numbers.cpp",
        old="return size & 256 ? -beyond : beyond;",
        new="return beyond;",
        tests="test_random_numbers.py",
    ),
    "noise below zero": Fault(
        file="native/lidar/scan_effects.cpp",
        old="noise[beam] = min(max(ranges[beam] + deviation * noise[beam], 0.0), range_max);",
        new="noise[beam] = min(ranges[beam] + deviation * noise[beam], range_max);",
        tests="test_lidar_effects.py",
    ),
    "a wall that misses the beam at its right end": Fault(
        file="native/lidar/scanline.cpp",
        old="for (int beam = first; beam < behind; ++beam) {\n        const double inverse",
        new="for (int beam = first + 1; beam < behind; ++beam) {\n        const double inverse",
        tests="test_scanline.py test_lidar.py",
    ),
    "a reading of nothing below the least range": Fault(
        file="fg_mujoco/lidar/beams.py",
        old="readings[distances < self.range_min] = -math.inf",
        new="readings[distances < self.range_min] = math.inf",
        tests="test_lidar.py test_lidar_effects.py",
    ),
    # course
    "a lap's time from the wrong end of the tick": Fault(
        file="native/course/lap_timer.cpp",
        old="crossed = timer.time + (time - timer.time) * (line - before) / distance",
        new="crossed = time + (time - timer.time) * (line - before) / distance",
        tests="test_lap_timer.py",
    ),
    "an obstacle that does not turn back": Fault(
        file="native/course/moving_obstacles.cpp",
        old="gone = back_and_forth ? way - std::abs(modulo(driven, 2.0 * way) - way) : min(driven, way);",
        new="gone = back_and_forth ? min(driven, way) : min(driven, way);",
        tests="test_moving_obstacles.py",
    ),
    "progress across the line modulo half a lap": Fault(
        file="native/course/lap_timer.cpp",
        old="modulo(place - timer.place + 0.5 * modulus, modulus)",
        new="modulo(place - timer.place + modulus, modulus)",
        tests="test_lap_timer.py test_race.py",
    ),
    # controllers
    "the friction speed without the wheelbase": Fault(
        file="native/controllers/control/speed.hpp",
        old="std::sqrt(gravity * mu * wheelbase / slope)",
        new="std::sqrt(gravity * mu / slope)",
        tests="test_speed_laws.py test_friction_limiter.py",
    ),
    "a goal seen from the LiDAR taken as seen from the axle": Fault(
        file="native/controllers/control/steering.hpp",
        old="return arc_through(lidar_offset + distance * fg::cos(bearing),",
        new="return arc_through(distance * fg::cos(bearing),",
        tests="test_speed_laws.py test_driving.py test_pure_pursuit.py test_gap_finder.py",
    ),
    "the longest gap a beam short": Fault(
        file="native/controllers/perception/gaps.cpp",
        old="best_first = first, best_end = beam + 1;",
        new="best_first = first, best_end = beam;",
        tests="test_gaps.py test_goals.py",
    ),
    "a limiter that may take more than the tires hold": Fault(
        file="native/controllers/safety/friction_limiter.cpp",
        old="max(limiter.lateral - std::copysign(cornering, turn * cornering), 0.0)",
        new="max(limiter.lateral + std::copysign(cornering, turn * cornering), 0.0)",
        tests="test_friction_limiter.py test_mission.py",
    ),
    "braking with a shaft as if the axles' slip were not one": Fault(
        file="controllers/control/slip.py",
        old="    ratio = min(ratios)",
        new="    ratio = max(ratios)",
        tests="test_friction_limiter.py",
    ),
    "an evading car that turns in as if braking moved no load": Fault(
        file="controllers/safety/friction_limiter.py",
        old="return in_cornering * (1.0 - settings.braking_use * height / (height + 0.5 / mu))",
        new="return in_cornering",
        tests="test_friction_limiter.py",
    ),
    "late scans compared with the odometry of now": Fault(
        file="native/controllers/safety/predictions.cpp",
        old="then = max(memory.tick - late, std::int64_t{0}) % most_late;",
        new="then = memory.tick % most_late;",
        tests="test_predictions.py",
    ),
    "what moves measured in a frame that turns half a tick late": Fault(
        file="native/controllers/perception/targets.cpp",
        old="0.5 * period * (memory.yaw_rate + yaw_rate)",
        new="period * yaw_rate",
        tests="test_targets.py",
    ),
    "the edge of a shadow taken for the end of what moves": Fault(
        file="native/controllers/perception/targets.cpp",
        old="if (compared && target.own[end] && cluster.own[end]) {\n            dx +=",
        new="if (compared) {\n            dx +=",
        tests="test_targets.py",
    ),
    "what comes to a wall predicted to stay there, and not to turn back": Fault(
        file="native/controllers/safety/predictions.cpp",
        old="time;\n    if (far > target.to_wall) {\n        near = min(near, 2.0 * target.to_wall - far);",
        new="time;\n    if (far > target.to_wall) {\n        near = min(near, target.to_wall);",
        tests="test_predictions.py",
    ),
    "a simulated stop compared with where targets are now": Fault(
        file="native/controllers/safety/rollout.cpp",
        old="apart, time + wait_time * wait))",
        new="apart, wait_time * wait))",
        tests="test_predictions.py",
    ),
    "a judge that takes its last proposal, not the one that meets something slowest": Fault(
        file="native/controllers/safety/judge.cpp",
        old="if (met.speed < best.contact) {",
        new="if (met.speed < inf) {",
        tests="test_judge.py",
    ),
    "a braking distance in the speed, not in its square": Fault(
        file="native/controllers/safety/guidance.cpp",
        old="return std::sqrt(2.0 * settings.profile_braking * limiter.braking * room);",
        new="return 2.0 * settings.profile_braking * limiter.braking * room;",
        tests="test_guidance.py test_mission.py test_random_courses.py controller_contract",
    ),
    "the raceline's heading error not wrapped": Fault(
        file="native/controllers/control/tracking.cpp",
        old="within_turn(heading - (point[motion_heading] - point[motion_curvature] * ahead))",
        new="heading - (point[motion_heading] - point[motion_curvature] * ahead)",
        tests="test_tracking.py test_pure_pursuit.py",
    ),
    "a bubble a beam narrower on its left": Fault(
        file="native/controllers/perception/scan_filters.cpp",
        old="other < end; ++other) result[other] = min(",
        new="other < end - 1; ++other) result[other] = min(",
        tests="test_scan_filters.py",
    ),
    "a recovery that counts what it drove forward": Fault(
        file="native/controllers/safety/recovery.cpp",
        old="memory.back -= max(-speed * period, 0.0);",
        new="memory.back -= max(speed * period, 0.0);",
        tests="test_recovery.py",
    ),
    # simulation
    "cars alone of another world's mass": Fault(
        file="fg_mujoco/simulation/cars_alone.py",
        old="values = getattr(physics.model, name) if own is None else own",
        new="values = getattr(physics.model, name)",
        tests="test_cars_alone.py",
    ),
    "cars alone that are stepped through walls": Fault(
        file="native/simulation/compiled_tick.cpp",
        old="if (alone && !clear)",
        new="if (alone && !clear && step == 0)",
        tests="test_cars_alone.py",
    ),
    "no race that goes the wrong way": Fault(
        file="native/simulation/termination.cpp",
        old="if (back >= wrong_way_limit)",
        new="if (-back >= wrong_way_limit)",
        tests="test_wrong_way.py test_race.py",
    ),
    "one lap too many": Fault(
        file="native/simulation/termination.cpp",
        old="if (laps_completed >= laps)",
        new="if (laps_completed > laps)",
        tests="test_race.py",
    ),
    # studies
    "an overtake that counts as soon as a car is level": Fault(
        file="addons/arena/runs/duels.py",
        old="self._duel, self._since, self._half = duel, math.nan, 0.5 * duel",
        new="self._duel, self._since, self._half = duel, math.nan, 0.0 * duel",
        tests="test_duels.py",
    ),
    "time lost against a planner that started elsewhere": Fault(
        file="addons/arena/runs/duels.py",
        old="first = replace(setup.first, start=Start(s=start))",
        new="first = replace(setup.first, start=Start())",
        tests="test_duels.py",
    ),
    "a crash at the end of the way that is a whole way": Fault(
        file="addons/arena/runs/run.py",
        old="completion=1.0 if success else min(max(share, 0.0), 1.0)",
        new="completion=1.0",
        tests="test_study.py",
    ),
    "a score in which a slow car is as good as a quick one": Fault(
        file="addons/arena/runs/run.py",
        old="self.completion * min(self.bound_s / own, 1.0)",
        new="self.completion",
        tests="test_study.py",
    ),
    "lap times whose median mixes tracks": Fault(
        file="addons/arena/study/tables.py",
        old='won = [run for run in runs if run["success"] and not several]',
        new='won = [run for run in runs if run["success"]]',
        tests="test_study.py",
    ),
    "a comparison that drives planners with all stages": Fault(
        file="addons/arena/study/functions.py",
        old="(ASSIST if base.first.assist == _OF_A_RACE else base.first.assist)",
        new="base.first.assist",
        tests="test_study.py",
    ),
    "a wrong way that is told of a car that stands": Fault(
        file="addons/arena/runs/run.py",
        old="np.diff(progress) < -WRONG_WAY_SPEED * ticks",
        new="np.diff(progress) <= 0.0",
        tests="test_study.py",
    ),
    "obstacles of a study that no seed draws": Fault(
        file="addons/arena/study/suite.py",
        old="setup, track=track, obstacle_seed=seed,",
        new="setup, track=track,",
        tests="test_study.py",
    ),
    "a run whose key does not know the planner's code": Fault(
        file="addons/arena/runs/run.py",
        old="self.course_sha256, [asdict(each) for each in self.origins])",
        new="self.course_sha256)",
        tests="test_labs.py test_study.py",
    ),
    "a planner whose process failed and that has its points": Fault(
        file="addons/arena/runs/graded_drive.py",
        old="            if recorded.failed is not None:\n",
        new="            if False:\n",
        tests="test_labs.py",
    ),
    # racing
    "the fault of the car that was moved into": Fault(
        file="addons/arena/race_control/fault.py",
        old="moved[car] = sign * float(side[began] - side[met])",
        new="moved[1 - car] = sign * float(side[began] - side[met])",
        tests="test_fault.py",
    ),
    "a car beside another that is left room only where it is wholly beside": Fault(
        file="addons/arena/race_control/fault.py",
        old="BESIDE * min(car.length for car in self.cars)",
        new="2.0 * BESIDE * min(car.length for car in self.cars)",
        tests="test_fault.py",
    ),
    "the heading of a car on the map taken for that from the course": Fault(
        file="addons/arena/race_control/recent_motion.py",
        old="turned = poses[:, 2] - self._directions(along)",
        new="turned = poses[:, 2]",
        tests="test_fault.py",
    ),
    "a car that was pushed and is at fault": Fault(
        file="addons/arena/race_control/race_control.py",
        old="by_others = tuple(any(own == car and by != pair for own, by in pushed) for car in pair)",
        new="by_others = (False, False)",
        tests="test_fault.py",
    ),
    "a contact for each push of a car that pushes again and again": Fault(
        file="addons/arena/race_control/race_control.py",
        old="if (settled and self._is_crash(contact)) or time - contact.last >= CONTACT_ENDS:",
        new="if settled or time - contact.last >= CONTACT_ENDS:",
        tests="test_fault.py",
    ),
    "a car put back without the cars' lengths": Fault(
        file="addons/arena/race_control/race_control.py",
        old="back = behind + 0.5 * (self._lengths[car] + self._lengths[other])",
        new="back = behind",
        tests="test_race_control.py test_several_cars.py",
    ),
    "gaps to the leader in the other order": Fault(
        file="addons/arena/race_control/race_control.py",
        old="gaps[:, led] = time[led] - np.interp(progress",
        new="gaps[:, led] = -time[led] + np.interp(progress",
        tests="test_report.py test_several_cars.py test_rendering_cars.py",
    ),
    "a setup that is written without its laps": Fault(
        file="fg_mujoco/racing/setup.py",
        old='if name in ("track", "entries") or value ==',
        new='if name in ("track", "entries", "laps") or value ==',
        tests="test_setup.py",
    ),
    "a setting that a door cannot use is not refused": Fault(
        file="fg_mujoco/racing/setup.py",
        old="""if value != usual and (name != "start" or value != Start()):""",
        new="""if value != usual and name == "start" and value != Start():""",
        tests="test_setup.py test_doors.py",
    ),
    "an opponent that is as slow as it wants": Fault(
        file="fg_mujoco/racing/entries.py",
        old="fastest = self.max_speed if max_speed is None else max_speed",
        new="fastest = self.max_speed",
        tests="test_setup.py test_opponents.py test_race_control.py test_duels.py",
    ),
    # studies
    "Wilson's interval of too small a sample": Fault(
        file="fg_mujoco/rollouts/shares.py",
        old="middle = (share + 0.5 * square / count) / (1.0 + square / count)",
        new="middle = (share + square / count) / (1.0 + square / count)",
        tests="test_shares.py test_duels.py",
    ),
    "worlds in which a tire slid that are safe": Fault(
        file="fg_mujoco/rollouts/shares.py",
        old='self.counts.get("slid", np.zeros(len(fine))) == 0',
        new='self.counts.get("slid", np.zeros(len(fine))) >= 0',
        tests="test_shares.py",
    ),
    "worlds of one track in the order of all": Fault(
        file="fg_mujoco/rollouts/job.py",
        old="by_track = [np.arange(first, len(self.seeds), every) for first in range(every)]",
        new="by_track = [np.arange(first, len(self.seeds) - 1, every) for first in range(every)]",
        tests="test_rollouts.py test_rollout_store.py",
    ),
    "a drawn value with its ends swapped": Fault(
        file="fg_mujoco/racing/randomization.py",
        old="return min(self.low + share * (self.high - self.low), self.high)",
        new="return max(self.low + share * (self.high - self.low), self.high)",
        tests="test_randomization.py test_rollouts.py",
    ),
    "a gyro whose delay goes the wrong way": Fault(
        file="addons/realcar/drives/drive_csv.py",
        old='yaw_rate = channel("yaw_rate", late=columns.yaw_rate.late + gyro_late, scale=gyro)',
        new='yaw_rate = channel("yaw_rate", late=columns.yaw_rate.late - gyro_late, scale=gyro)',
        tests="test_recorded_drives.py",
    ),
    "a clock's scale that is turned over": Fault(
        file="addons/realcar/drives/drive_csv.py",
        old="time=first + clock * (found.time - first), values=found.values)",
        new="time=first + (found.time - first) / clock, values=found.values)",
        tests="test_recorded_drives.py",
    ),
    "a commanded angle is the wheels' angle without the car's map": Fault(
        file="fg_mujoco/vehicle/command_response.py",
        old="return np.asarray(self.steering_gain * command + self.steering_offset)",
        new="return np.asarray(self.steering_gain * command)",
        tests="test_car.py",
    ),
    "a car that coasts brakes": Fault(
        file="fg_mujoco/vehicle/command_response.py",
        old="np.where(command < 0.0, self.braking_gain, self.acceleration_gain)",
        new="self.acceleration_gain",
        tests="test_validation.py",
    ),
    "an acceleration is given as if the motor's set point were not old": Fault(
        file="addons/realcar/validation/car_model.py",
        old="wheel_speeds + goes_on + tau * wanted",
        new="wheel_speeds + 0.8 * tau * wanted",
        tests="test_validation.py",
    ),
    "windows go through collisions": Fault(
        file="addons/realcar/validation/windows.py",
        old="_HIT = 12.0",
        new="_HIT = 1e3",
        tests="test_validation.py",
    ),
    "a window that starts with its lateral speed to the other side": Fault(
        file="addons/realcar/validation/car_model.py",
        old="forward * cos - lateral * sin, forward * sin + lateral * cos",
        new="forward * cos + lateral * sin, forward * sin - lateral * cos",
        tests="test_validation.py",
    ),
    # envs
    "a crash that is rewarded": Fault(
        file="native/envs/rewards.cpp",
        old="now[1][i] = -weights[1], now[3][i]",
        new="now[1][i] = weights[1], now[3][i]",
        tests="test_environment.py test_gym_environment.py test_gym_vector.py",
    ),
    "a running cost that takes more than a tick gains": Fault(
        file="native/envs/rewards.cpp",
        old="slid = min(slid, share * max(made, 0.0))",
        new="slid = min(slid, 2.0 * share * max(made, 0.0))",
        tests="test_gym_environment.py",
    ),
    "a history with the newest step first": Fault(
        file="native/envs/observer.cpp",
        old="(last[i] + 1 + step * every) % ring.rows",
        new="(last[i] + ring.rows * every - step * every) % ring.rows",
        tests="test_policy_interface.py",
    ),
    "actions that are not held within their bounds": Fault(
        file="native/envs/rewards.cpp",
        old="held = min(max(given, limits[0][part]), limits[1][part])",
        new="held = max(given, limits[0][part])",
        tests="test_environment.py test_gym_environment.py test_gym_vector.py",
    ),
    "an end condition of the heading at the wrong angle": Fault(
        file="fg_mujoco/envs/end_conditions.py",
        old="return np.abs(state.heading_error) > 0.5 * math.pi",
        new="return state.heading_error > 0.5 * math.pi",
        tests="test_environment_terms.py",
    ),
    "a change of the command in the car's whole ranges": Fault(
        file="fg_mujoco/envs/rewards.py",
        old="change: FloatArray = 2.0 * (state.command - state.before.command) / ranges",
        new="change: FloatArray = (state.command - state.before.command) / ranges",
        tests="test_environment_terms.py",
    ),
    "positions gained counted as lost": Fault(
        file="fg_mujoco/envs/rewards.py",
        old="return (state.before.position - state.position).astype(np.float64)",
        new="return (state.position - state.before.position).astype(np.float64)",
        tests="test_environment_terms.py test_parallel_env.py",
    ),
    # ros
    "a scan's stamp of its last beam": Fault(
        file="addons/ros/bag_messages.py",
        old="first = scan.stamp - scan.time_increment * (len(scan.ranges) - 1)",
        new="first = scan.stamp",
        tests="test_bag_writer.py test_bag_scans.py",
    ),
    "a LiDAR mounted the other way round": Fault(
        file="addons/ros/bag_scans.py",
        old="    first += mount.yaw",
        new="    first -= mount.yaw",
        tests="test_bag_scans.py test_bag_replay.py",
    ),
    "a node's reckoned pose that turns twice as fast": Fault(
        file="addons/ros/node_host/sensing.py",
        old="turned = self._odometry.yaw_rate * passed",
        new="turned = 2.0 * self._odometry.yaw_rate * passed",
        tests="test_ros_nodes.py test_ros_surroundings.py test_ros_tolerance.py",
    ),
    # add-ons: ros
    "a transform that is looked up the other way round": Fault(
        file="addons/ros/node_host/transform_modules.py",
        old="np.linalg.inv(to_root[0][1]) @ to_root[1][1]",
        new="np.linalg.inv(to_root[1][1]) @ to_root[0][1]",
        tests="test_ros_nodes.py test_ros_surroundings.py test_ros_tolerance.py",
    ),
    "rotations that are multiplied in the other order": Fault(
        file="addons/ros/node_host/transform_modules.py",
        old="x0, y0, z0, w0 = other\n    x1, y1, z1, w1 = one",
        new="x0, y0, z0, w0 = one\n    x1, y1, z1, w1 = other",
        tests="test_ros_nodes.py test_ros_surroundings.py test_ros_tolerance.py",
    ),
    "a map for nodes that lies three cells off": Fault(
        file="addons/ros/occupancy_grid.py",
        old="Grid(cells=cells, resolution=resolution, origin=origin)",
        new="Grid(cells=cells, resolution=resolution, origin=origin + 3.0 * resolution)",
        tests="test_ros_nodes.py test_ros_surroundings.py test_bag_writer.py",
    ),
    "a LiDAR upside down whose beams are not turned round": Fault(
        file="addons/ros/bag_scans.py",
        old="first, step = -first, -step",
        new="first, step = -first, step",
        tests="test_bag_scans.py test_bag_replay.py",
    ),
    "a servo's trim with the wrong sign": Fault(
        file="addons/ros/composed_topics.py",
        old="return (position - SERVO_OFFSET) / STEERING_TO_SERVO",
        new="return (position + SERVO_OFFSET) / STEERING_TO_SERVO",
        tests="test_bag_composed.py test_ros_nodes.py",
    ),
    # add-ons: servers
    "a DevKit that steers to the other side": Fault(
        file="addons/servers/autodrive/packets.py",
        old="steering_angle=self.steering * STEERING",
        new="steering_angle=-self.steering * STEERING",
        tests="test_autodrive_bridge.py",
    ),
    "a DevKit's lap time that goes on after a lap": Fault(
        file="addons/servers/autodrive/devkit.py",
        old="time=odometry.stamp - sum(times)",
        new="time=odometry.stamp",
        tests="test_autodrive_bridge.py",
    ),
    "a node of ROS 2 that comes while time stands still and gets no scan": Fault(
        file="addons/servers/ros2/server.py",
        old="self._asked |= self._fresh",
        new="self._asked.clear()",
        tests="test_ros2.py",
    ),
    "topics that late nodes of ROS 2 do not get": Fault(
        file="addons/servers/ros2/participant.py",
        old="reliable=True, transient=True, depth=1",
        new="reliable=True, transient=False, depth=1",
        tests="test_ros2.py",
    ),
    "a publisher of ROS 2 that goes": Fault(
        file="addons/servers/ros2/dds_types.py",
        old="made.deserialize = made.deserialize_key =",
        new="made.deserialize =",
        tests="test_ros2.py",
    ),
    "an opponent that nodes cannot drive": Fault(
        file="addons/servers/live_race.py",
        old="self.session.hold(command_of(kind, message, wheelbase), opponent=True)",
        new="self.session.hold(None, opponent=True)",
        tests="test_ros2.py",
    ),
    "a car that drives on when its driver in Foxglove has gone": Fault(
        file="addons/servers/foxglove_server.py",
        old="if late and not self._step_on_drive and self.session.held_from_outside:",
        new="if late and self._step_on_drive and self.session.held_from_outside:",
        tests="test_foxglove_server.py",
    ),
    "a lateral velocity with the wrong sign in Foxglove": Fault(
        file="addons/servers/foxglove_server.py",
        old="float(vy * math.cos(heading) - vx * math.sin(heading))",
        new="float(vx * math.sin(heading) - vy * math.cos(heading))",
        tests="test_foxglove_server.py",
    ),
    # add-ons: gym2d
    "a car put at its rear axle with the speed of its centre": Fault(
        file="addons/gym2d/gym_world.py",
        old="left = speed * math.tan(slip) - self.ahead[agent] * yaw_rate",
        new="left = speed * math.tan(slip)",
        tests="test_f110.py test_f110_interfaces.py test_f110_scripts.py test_f110_lap_times.py",
    ),
    "laps that are not counted across the line": Fault(
        file="addons/gym2d/gym_world.py",
        old="math.remainder(place - self._place, track.length)",
        new="(place - self._place)",
        tests="test_f110.py test_f110_interfaces.py",
    ),
    "the gym's gains of a car that goes forward and back swapped": Fault(
        file="addons/gym2d/speed_controller.py",
        old="(_FORWARD if speed > 0.0 else _BACK)",
        new="(_FORWARD if speed < 0.0 else _BACK)",
        tests="test_f110.py test_f110_lap_times.py test_f110_interfaces.py",
    ),
    "one noise for the scans of all cars": Fault(
        file="addons/gym2d/gym_world.py",
        old="np.random.default_rng([self._seed, agent] if agent else self._seed)",
        new="np.random.default_rng(self._seed)",
        tests="test_f110.py",
    ),
    "a kinematic car as long as its front half": Fault(
        file="addons/gym2d/gym_functions.py",
        old="turning = speed / (lf + lr) * math.tan(steering)",
        new="turning = speed / lf * math.tan(steering)",
        tests="test_f110_interfaces.py test_f110.py",
    ),
    # add-ons: learn
    "a base planner that remembers the last episode": Fault(
        file="addons/learn/residual.py",
        old="            self._together.reset(which)\n",
        new="",
        tests="test_residual.py",
    ),
    "an episode that is terminated where its time was up": Fault(
        file="addons/learn/dataset.py",
        old="terminations=ended & final,",
        new="terminations=ended,",
        tests="test_dataset.py",
    ),
    "episodes in the order in which they ended": Fault(
        file="addons/learn/dataset.py",
        old='order = np.argsort(worlds["world"])',
        new='order = np.argsort(-worlds["world"])',
        tests="test_dataset.py",
    ),
    # add-ons: realcar
    "a slip angle at the wrong end of the car": Fault(
        file="addons/realcar/validation/agreement.py",
        old="across = simulated[..., 4] + rear_axle_distance * yaw_rate",
        new="across = simulated[..., 4] - rear_axle_distance * yaw_rate",
        tests="test_validation.py",
    ),
    "poses of the rear axle taken for the centre of gravity's": Fault(
        file="addons/realcar/identification/smoothed_motion.py",
        old="shift = ahead * np.interp(drive.pose.time, time, turn)",
        new="shift = 0.0 * np.interp(drive.pose.time, time, turn)",
        tests="test_identification.py",
    ),
    "an accelerometer whose axes turn the other way": Fault(
        file="addons/realcar/identification/smoothed_motion.py",
        old="enumerate(((cos, sin), (-sin, cos)))",
        new="enumerate(((cos, -sin), (sin, cos)))",
        tests="test_identification.py",
    ),
    # add-ons: look
    "a key that steers to the other side": Fault(
        file="addons/look/live/hand_driver.py",
        old='(1.0 if name == "left" else -1.0)',
        new='(-1.0 if name == "left" else 1.0)',
        tests="test_live_view.py",
    ),
    "points of the LiDAR drawn at the rear axle": Fault(
        file="addons/look/intermediate_values.py",
        old="of_axle = points + mount if frame == LASER",
        new="of_axle = points if frame == LASER",
        tests="test_intermediate_values.py test_shown_values.py",
    ),
    "an acceleration to the wrong side in a report": Fault(
        file="addons/look/report/recorded.py",
        old="return np.append(ahead, ahead[-1]), speed * yaw_rate",
        new="return np.append(ahead, ahead[-1]), -speed * yaw_rate",
        tests="test_report.py test_report_pages.py",
    ),
    # add-ons: drivers
    "a line whose braking takes all that cornering does": Fault(
        file="native/addons/drivers/line_profile.cpp",
        old="most * share * step",
        new="most * step",
        tests="test_line_profile.py",
    ),
    "a car that is passed where there is less room": Fault(
        file="native/addons/drivers/passing.cpp",
        old="(across > 0.0 ? 0.1 : 0.0) >= rooms[1]",
        new="(across > 0.0 ? 0.1 : 0.0) < rooms[1]",
        tests="test_passing.py test_duels.py test_other_cars.py",
    ),
    "a plan that begins where the car was when it was commanded": Fault(
        file="native/addons/drivers/line_mpc.cpp",
        old="if (delay == 0.0 || !mpc.planned)",
        new="if (true)",
        tests="test_line_mpc.py test_pure_pursuit.py",
    ),
    # viz
    "pictures upside down": Fault(
        file="fg_mujoco/pictures/rendering/cameras.py",
        old="0.5 * width + scale * x, 0.5 * height - scale * y",
        new="0.5 * width + scale * x, 0.5 * height + scale * y",
        tests="test_rendering.py test_rendering_cars.py",
    ),
    "a film a frame short": Fault(
        file="fg_mujoco/pictures/rendering/film.py",
        old="math.floor((last - start) * fps + 1e-6) + 1",
        new="math.floor((last - start) * fps + 1e-6)",
        tests="test_rendering.py test_rendering_drive.py test_rendering_files.py",
    ),
    "a clip that begins with the last lap": Fault(
        file="addons/look/report/clip.py",
        old="return min(sum(lap_times[:best]), latest)",
        new="return min(sum(lap_times[: best + 1]), latest)",
        tests="test_report.py",
    ),
    "sectors a line early": Fault(
        file="addons/look/report/laps_and_slides.py",
        old="reached = _first_time(time, progress, (number - 1 + sector / SECTORS) * length)",
        new="reached = _first_time(time, progress, (number - 1 + (sector - 1) / SECTORS) * length)",
        tests="test_report.py",
    ),
    "a clip that follows the car that was hit least": Fault(
        file="addons/look/report/clip.py",
        old="hardest = max(contacts, key",
        new="hardest = min(contacts, key",
        tests="test_report.py",
    ),
    # cli
    "a torn TOML that ends in a traceback": Fault(
        file="fg_mujoco/course/documents.py",
        old="except (ValueError, RecursionError) as error:  # a number of",
        new="except RecursionError as error:  # a number of",
        tests="test_formats.py",
    ),
    "friction that is off is none at all": Fault(
        file="fg_mujoco/cli/options.py",
        old='return math.inf if text == "off" else number(text)',
        new='return 0.0 if text == "off" else number(text)',
        tests="test_cli.py test_planner_context.py test_doors.py",
    ),
    "opponents with the same seed": Fault(
        file="fg_mujoco/cli/options.py",
        old="seed=(first.seed + index) % 2**63",
        new="seed=first.seed",
        tests="test_race_control.py test_cli.py",
    ),
    "a run that replaces a run without being told to": Fault(
        file="fg_mujoco/cli/out.py",
        old="    elif options.force:",
        new="    elif options.force or kind == RUN:",
        tests="test_out_folder.py",
    ),
}


def copy_of(checkout: Path, folder: Path) -> None:
    """Lay the package out as it is installed, its tests beside it, and link the rest of the repository."""
    leave = shutil.ignore_patterns("__pycache__")
    shutil.copytree(checkout / "fg_mujoco", folder / "fg_mujoco", ignore=leave)
    for name in INSIDE:
        shutil.copytree(checkout / name, folder / "fg_mujoco" / name, ignore=leave)
        (folder / name).symlink_to(folder / "fg_mujoco" / name)
    shutil.copytree(checkout / "tests", folder / "tests", ignore=leave)
    shutil.copytree(checkout / "native", folder / "native", ignore=leave)
    for name in LINKED:
        (folder / name).symlink_to(checkout / name)
    shared = checkout.parent / "shared"
    if shared.exists() and not (folder.parent / "shared").exists():
        (folder.parent / "shared").symlink_to(shared)


def make(fault: Fault, folder: Path) -> str:
    """Put a fault into a copy, and return the text that was there."""
    path = folder / fault.file
    text = path.read_text("utf-8")
    if text.count(fault.old) != 1:
        raise SystemExit(f"faults: {fault.file} has {text.count(fault.old)} times {fault.old!r}; accepted: once")
    write(path, text.replace(fault.old, fault.new), folder)
    return text


def write(path: Path, text: str, folder: Path) -> None:
    """Write a file of a copy, and build the native core again if it is one of its sources.

    Bytecode is forgotten: within a second a text of the same length would be taken for the old.
    """
    path.write_text(text, "utf-8")
    if path.suffix in (".cpp", ".hpp"):
        made = folder / "build"
        options = ["-DCMAKE_BUILD_TYPE=Release", f"-DPython_EXECUTABLE={sys.executable}"]
        for command in (["-S", str(folder / "native"), "-B", str(made), *options], ["--build", str(made)]):
            subprocess.run(["cmake", *command], check=True, stdout=subprocess.DEVNULL)
        for library in made.glob("_native.*"):
            shutil.copy(library, folder / "fg_mujoco")
    for stale in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        stale.unlink()


def first_failure(tests: list[str], folder: Path, without: list[str] | None = None) -> str | None:
    """Run tests in the copy, but for those `without` which they are run, and return the first that fails."""
    environment = os.environ | {"PYTHONPATH": str(folder), "XDG_CACHE_HOME": str(folder.parent / "cache")}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-rfE", *tests]
    command += [f"--deselect={name}" for name in without or ()]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode not in (0, 1, 2):
        raise SystemExit(f"faults: pytest ended with {done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    found = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", done.stdout, re.MULTILINE)
    return found.group(1) if found else None


def main() -> int:
    """Make each fault, and tell which were found."""
    arguments = parser(__doc__)
    arguments.add_argument("--only", default="", help="faults of these rooms, or with one of these words in their name")
    arguments.add_argument("--checkout", type=Path, default=ROOT, help="whose package and tests (default: this one)")
    arguments.add_argument("--whole", action="store_true", help="run all tests for each fault, not those of its room")
    options = arguments.parse_args()
    words = [word for word in options.only.split(",") if word]
    chosen = {
        name: fault for name, fault in FAULTS.items() if not words or {fault.room, *name.split()} & {*words}
    }
    rows, figures = [], {}
    with tempfile.TemporaryDirectory(prefix="faults-") as place:
        folder = Path(place) / "copy"
        copy_of(options.checkout.resolve(), folder)
        for name, fault in chosen.items():
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            tests = [] if options.whole else [str(next((folder / "tests").rglob(name))) for name in fault.tests.split()]
            failing: list[str] = []  # without a fault, too
            while True:
                text = make(fault, folder)
                by = first_failure(tests, folder, failing)
                write(folder / fault.file, text, folder)
                if by is None or first_failure([by], folder) is None:
                    break
                if by in failing:
                    raise SystemExit(f"faults: {by} fails without a fault, too")
                failing.append(by)
            seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
            figures[name] = {"room": fault.room, "found_by": by, "cpu_s": round(seconds, 1)}
            rows.append((fault.room, name, by or "not found", f"{seconds:.0f} s"))
            print(*rows[-1], sep="  ", file=sys.stderr, flush=True)
    missed = [name for name, found in figures.items() if found["found_by"] is None]
    found = f"{len(figures) - len(missed)} of {len(figures)} found"
    report(figures, f"{table(('room', 'fault', 'found by', 'CPU'), rows)}\n\n{found}", options.json)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
