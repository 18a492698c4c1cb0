#!/usr/bin/env python3
# F1TENTH lab 3: follow the left wall with PID
import math
import sys

import numpy as np
import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

# PID CONTROL PARAMS
kp = 1.0
kd = 0.05
ki = 0.0
servo_offset = 0.0
prev_error = 0.0
error = 0.0
integral = 0.0
prev_time = 0.0

# WALL FOLLOW PARAMS
ANGLE_RANGE = 270  # Hokuyo 10LX has 270 degrees scan
DESIRED_DISTANCE_LEFT = 0.9  # meters
VELOCITY = 2.00  # meters per second


class WallFollow(Node):
    """ Implement Wall Following on the car
    """
    def __init__(self):
        super().__init__('WallFollow_node')
        lidarscan_topic = '/scan'
        drive_topic = '/nav'

        self.lidar_sub = self.create_subscription(LaserScan, lidarscan_topic, self.lidar_callback, 1)
        self.drive_pub = self.create_publisher(AckermannDriveStamped, drive_topic, 10)

    def getRange(self, data, angle):
        # angle in degrees from straight ahead, left positive
        index = int((math.radians(angle) - data.angle_min) / data.angle_increment)
        r = data.ranges[index]
        if math.isinf(r) or math.isnan(r):
            return data.range_max
        return r

    def pid_control(self, error, velocity):
        global integral
        global prev_error
        global prev_time
        now = self.get_clock().now().nanoseconds / 1e9
        dt = now - prev_time
        derivative = (error - prev_error) / dt
        integral += error * dt
        angle = kp * error + kd * derivative + ki * integral
        prev_error = error
        prev_time = now
        angle = float(np.clip(angle, -0.41, 0.41))

        drive_msg = AckermannDriveStamped()
        drive_msg.header.stamp = self.get_clock().now().to_msg()
        drive_msg.header.frame_id = "laser"
        drive_msg.drive.steering_angle = angle
        drive_msg.drive.speed = velocity
        self.drive_pub.publish(drive_msg)

    def followLeft(self, data, leftDist):
        a = self.getRange(data, 45)
        b = self.getRange(data, 90)
        theta = math.radians(45)
        alpha = math.atan2(a * math.cos(theta) - b, a * math.sin(theta))
        D = b * math.cos(alpha)
        D_t = D + 0.8 * math.sin(-alpha) * -1
        return D_t - leftDist

    def lidar_callback(self, data):
        error = self.followLeft(data, DESIRED_DISTANCE_LEFT)
        self.get_logger().info("error %f" % error, throttle_duration_sec=1.0)
        self.pid_control(error, VELOCITY)


def main(args):
    rclpy.init(args=args)
    rclpy.spin(WallFollow())


if __name__ == '__main__':
    main(sys.argv)
