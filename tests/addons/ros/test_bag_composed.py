"""Bags of AutoDRIVE's bridge and of the VESC's driver: what topics of numbers make together."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

import fg_mujoco as fg
from bag_worlds import CAR, EPOCH, SECOND, header, make, robot_imu, robot_odometry, robot_scan, rotation, write_bag
from cases import each
from fg_mujoco.addons.realcar.bag_drive import read_drives
from fg_mujoco.addons.ros.bag_messages import DRIVE, MOTOR, ODOMETRY, USUAL, drive_message, type_store
from fg_mujoco.addons.ros.bag_reader import ScanBag
from fg_mujoco.addons.ros.bag_recording import Recording
from fg_mujoco.addons.ros.composed_topics import (
    SERVO_OFFSET,
    SPEED_TO_ERPM,
    STEERING,
    STEERING_TO_SERVO,
    THROTTLE,
    motor_message,
)
from fg_mujoco.addons.ros.node_host.sensing import TOPICS
from fg_mujoco.cli.main import main
from fg_mujoco.messages import DriveCommand
from scan_worlds import odometry_of

STEP = SECOND // 20
SPEED, YAW_RATE = 1.5, 0.4  # of the circle that is driven


def number(value):
    return make("std_msgs/msg/Float32", data=value)


def joint(name, time, angle):
    return make("sensor_msgs/msg/JointState", header=header(time, name), name=[name],
                position=np.array([angle]), velocity=np.empty(0), effort=np.empty(0))  # fmt: skip


def imu(time, heading):
    return robot_imu(time, (0.0, 0.0, YAW_RATE), (0.0, SPEED * YAW_RATE, 0.0), heading)


def entries(car, count=60, still=0):
    """The messages of a car that goes round, and stands in the first `still` ticks."""
    at = f"/autodrive/{car}"
    found = []
    for tick in range(count):
        time = EPOCH + tick * STEP
        t = max(0, tick - still) * STEP / SECOND
        heading, radius = YAW_RATE * t, SPEED / YAW_RATE
        x, y = radius * math.sin(heading), radius * (1.0 - math.cos(heading))
        angle = SPEED * t / CAR.wheel_radius
        found += [
            (f"{at}/throttle", time, number(0.05)), (f"{at}/steering", time, number(0.1)),
            (f"{at}/speed", time, number(SPEED)), (f"{at}/left_encoder", time, joint("left_encoder", time, angle)),
            (f"{at}/right_encoder", time, joint("right_encoder", time, 1.02 * angle)),
            (f"{at}/ips", time, make("geometry_msgs/msg/Point", x=x, y=y, z=0.0)),
            (f"{at}/imu", time, imu(time, heading)),
            (f"{at}/lidar", time, robot_scan(np.full(41, 5.0), time=time, frame="lidar")),
            (f"{at}/throttle_command", time, number(0.06)),
            (f"{at}/steering_command", time, number(0.2 + 0.001 * tick)),
        ]  # fmt: skip
    return found


@pytest.mark.slow
@each("car", ["f1tenth_1", "our_car"])
def test_commands_wheels_and_imu_count_for_identify_whatever_the_car_is_called(car, tmp_path):
    (drive,) = read_drives(write_bag(tmp_path / car, entries(car, 120)))
    assert drive.commanded
    assert drive.steering.values[:, 0] == pytest.approx((0.2 + 0.001 * np.arange(120)) * STEERING, rel=1e-6)
    assert drive.speed.values[5:, 0] == pytest.approx(1.01 * SPEED, rel=1e-6)  # the mean of both encoders
    assert drive.yaw_rate.values[:, 0] == pytest.approx(YAW_RATE)
    assert drive.acceleration.values[:, 1] == pytest.approx(SPEED * YAW_RATE)
    x, y, heading = drive.pose.values[-1]
    assert heading == pytest.approx(
        YAW_RATE * 118 * STEP / SECOND, rel=1e-6
    )  # the heading last heard: of one tick before
    assert math.hypot(x, y - SPEED / YAW_RATE) == pytest.approx(SPEED / YAW_RATE)


def test_a_planner_over_the_scans_gets_pose_speed_and_commands(tmp_path):
    with ScanBag(write_bag(tmp_path / "bag", entries("roboracer_1")), CAR) as bag:
        assert bag.topics[DRIVE] == "/autodrive/roboracer_1/command"
        assert bag.topics[ODOMETRY] == "/autodrive/roboracer_1/odometry"
        found = list(bag)
    last = found[-1].odometry
    assert len(found) == 60 and last.speed == SPEED
    assert last.steering_angle == pytest.approx((0.2 + 0.001 * 58) * STEERING, rel=1e-6)
    assert np.hypot(last.pose[0], last.pose[1] - SPEED / YAW_RATE) == pytest.approx(SPEED / YAW_RATE, rel=1e-3)


def test_a_command_has_the_throttle_last_heard_and_none_is_beyond_full(tmp_path):
    at = "/autodrive/c/"
    rows = [(EPOCH, "throttle_command", 0.5), (EPOCH + 1, "steering_command", -3.0),
            (EPOCH + 2, "steering_command", math.nan),
            (EPOCH + 3, "throttle_command", -2.0), (EPOCH + 4, "steering_command", 0.5)]  # fmt: skip
    with Recording(
        write_bag(tmp_path / "bag", [(at + name, time, number(value)) for time, name, value in rows])
    ) as bag:
        heard = list(bag.messages({(DRIVE, at + "command")}))
        assert (DRIVE, at + "command") in bag.counts and at + "command" not in bag.held()
        assert bag.table()[-1].split() == [at + "command", DRIVE, "composed", "of", "steering_command,",
                                           "throttle_command"]  # fmt: skip
    asked = [(each.message.drive.steering_angle, each.message.drive.speed) for each in heard]
    assert asked == [pytest.approx((-STEERING, 0.5 * THROTTLE)), pytest.approx((0.5 * STEERING, -THROTTLE))]
    assert [each.time for each in heard] == [EPOCH + 1, EPOCH + 4]


@each("driver, bits, storage", [("", 64, "SQLITE3"), ("/vesc", 32, "MCAP")])
def test_motor_and_servo_of_a_vesc_count_as_they_do_in_nodes(driver, bits, storage, tmp_path, capsys):
    bag = write_bag(tmp_path / "bag", vesc_entries(driver, f"std_msgs/msg/Float{bits}"), storage=storage)
    (drive,) = read_drives(bag)
    angles = 0.001 * np.arange(120)
    assert drive.commanded and drive.steering.values[:, 0] == pytest.approx(angles, abs=1e-6)
    assert drive.speed_command.values[:, 0] == pytest.approx(SPEED + angles, rel=1e-6)
    assert drive.speed.values[:, 0] == pytest.approx(SPEED) and drive.yaw_rate.values[:, 0] == pytest.approx(YAW_RATE)
    with ScanBag(bag, CAR) as scans:
        assert scans.topics[DRIVE] == f"{driver}/commands"
        last = list(scans)[-1].odometry
    assert last.speed == pytest.approx(SPEED, rel=0.01) and last.steering_angle == pytest.approx(0.118)
    assert main(["bag", str(bag)]) == 0
    assert f"{driver}/commands" in capsys.readouterr().out.splitlines()[-1]


def test_what_an_ackermann_topic_commands_goes_before_the_vescs(tmp_path):
    command, times = DriveCommand(steering_angle=0.3, speed=1.0), [EPOCH + i * STEP for i in range(120)]
    own = [("/mine", time, drive_message(command, time)) for time in times]
    bag = write_bag(tmp_path / "bag", sorted([*vesc_entries(""), *own], key=lambda entry: entry[1]))
    assert np.allclose(read_drives(bag)[0].steering.values, 0.3)
    assert np.allclose(read_drives(bag, drive_topic="/commands")[0].steering.values[:, 0], 0.001 * np.arange(120))


def test_of_several_topics_those_are_read_that_nodes_get(tmp_path):
    of_nodes = {name for name, (kind, _) in TOPICS.items() if kind in USUAL and "/autodrive/" not in name}
    assert of_nodes <= {name for kind in USUAL for name in USUAL[kind]}
    names = ("/pf/pose/odom", "/vesc/odom")
    entries = [(name, EPOCH + i, robot_odometry(EPOCH + i)) for i in range(9) for name in names]
    with Recording(write_bag(tmp_path / "bag", entries)) as bag, pytest.warns(UserWarning, match="/vesc/odom is read"):
        assert bag.choose((ODOMETRY,), option="--odom-topic") == (ODOMETRY, "/vesc/odom")


def vesc_entries(driver, number="std_msgs/msg/Float64", count=120):
    """The messages of a car of f1tenth_system that goes round, without an Odometry."""
    kind = type_store().types["vesc_msgs/msg/VescState"]
    found = []
    for tick in range(count):
        time = EPOCH + tick * STEP
        heading, radius = YAW_RATE * tick * STEP / SECOND, SPEED / YAW_RATE
        state = kind(**{each.name: 0.0 for each in fields(kind)} | {"speed": SPEED * SPEED_TO_ERPM, "fault_code": 0,
            "displacement": 0, "distance_traveled": 0, "controller_id": 0})  # fmt: skip
        x, y = radius * math.sin(heading), radius * (1.0 - math.cos(heading))
        place = make("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
        pose = make("geometry_msgs/msg/Pose", position=place, orientation=rotation(heading))
        stamped = make("geometry_msgs/msg/PoseStamped", header=header(time, "map"), pose=pose)
        angle = 0.001 * tick
        speed, servo = (SPEED + angle) * SPEED_TO_ERPM, SERVO_OFFSET + STEERING_TO_SERVO * angle
        found += [(f"{driver}/sensors/core", time, make(MOTOR, header=header(time, ""), state=state)),
                  ("/sensors/imu/raw", time, imu(time, heading)),
                  ("/pf/viz/inferred_pose", time, stamped),
                  ("/scan", time, robot_scan(np.full(41, 5.0), time=time)),
                  (f"{driver}/commands/motor/speed", time + 1, make(number, data=speed)),
                  (f"{driver}/commands/servo/position", time + 2, make(number, data=servo))]  # fmt: skip
    return found


def test_a_measurement_of_a_bag_that_failed_is_left_out_and_one_that_none_measures_is_refused(tmp_path):
    for name, value in (("failed", math.nan), ("absurd", 1e300), ("infinite", -math.inf)):
        entries = vesc_entries("")
        entries[60][2].state.speed = value * SPEED_TO_ERPM
        bag = write_bag(tmp_path / name, entries)
        if name == "failed":
            assert len(read_drives(bag)[0].speed.time) == 119
            continue
        with pytest.raises(fg.FgMujocoError, match=r"wheel speed: .*; accepted: "):
            read_drives(bag)


def test_a_motor_without_losses_has_the_power_of_the_force_that_moves_the_car():
    for speed, ahead in ((2.0, 5.0), (6.0, -3.0), (-1.5, -2.0)):
        odometry = replace(odometry_of(speed), linear_acceleration=np.array((ahead, 1.0, 9.81)))
        state = motor_message(odometry, 3.74).state
        power = 3.74 * ahead * speed
        assert state.voltage_input * state.current_input == pytest.approx(power)
        assert state.duty_cycle * state.voltage_input * state.current_motor == pytest.approx(power)
        turns = state.duty_cycle * state.voltage_input * 3500.0
        assert turns == pytest.approx(state.speed / 2) == speed * SPEED_TO_ERPM / 2
        assert state.__msgtype__ == "vesc_msgs/msg/VescState" and state.FAULT_CODE_OVER_VOLTAGE == 1
        assert state.voltage_input > 12.0 and state.fault_code == 0 and 20.0 <= state.temp_fet <= 30.0
    assert motor_message(odometry_of(20.0), 3.74).state.duty_cycle == 1.0
