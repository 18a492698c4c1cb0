#!/usr/bin/env python3
import numpy as np
import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node

# TODO: include needed ROS msg type headers and libraries
from sensor_msgs.msg import LaserScan


class SafetyNode(Node):
    """
    The class that handles emergency braking.
    """
    def __init__(self):
        super().__init__('safety_node')
        self.declare_parameters(namespace='', parameters=[('ttc_threshold', 0.8), ('cruise_speed', 2.0)])
        self.ttc_threshold = self.get_parameter('ttc_threshold').get_parameter_value().double_value
        self.cruise = self.get_parameter('cruise_speed').value
        self.speed = 0.
        self.braking = False
        self.publisher_ = self.create_publisher(AckermannDriveStamped, 'drive', 10)
        self.subscription_scan = self.create_subscription(LaserScan, 'scan', self.scan_callback, 10)
        self.subscription_odom = self.create_subscription(
            Odometry,
            'ego_racecar/odom',
            self.odom_callback,
            10)
        self.subscription_odom  # prevent unused variable warning
        self.timer = self.create_timer(0.05, self.timer_callback)

    def odom_callback(self, odom_msg):
        self.speed = odom_msg.twist.twist.linear.x

    def timer_callback(self):
        if not self.braking:
            msg = AckermannDriveStamped()
            msg.header.stamp = self.get_clock().now().to_msg()
            msg.drive.speed = self.cruise
            self.publisher_.publish(msg)

    def scan_callback(self, scan_msg):
        ranges = np.array(scan_msg.ranges)
        angles = scan_msg.angle_min + np.arange(len(ranges)) * scan_msg.angle_increment
        range_rate = self.speed * np.cos(angles)
        ittc = np.full(len(ranges), np.inf)
        closing = range_rate > 0
        ittc[closing] = ranges[closing] / range_rate[closing]
        if np.min(ittc) < self.ttc_threshold and not self.braking:
            self.get_logger().info(f'emergency brake engaged at {self.speed:.2f} m/s')
            self.braking = True
        if self.braking:
            drive_msg = AckermannDriveStamped()
            drive_msg.drive.speed = 0.0
            self.publisher_.publish(drive_msg)


def main(args=None):
    rclpy.init(args=args)
    safety_node = SafetyNode()
    rclpy.spin(safety_node)

    # Destroy the node explicitly
    safety_node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
