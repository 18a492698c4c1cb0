#!/usr/bin/env python3
import os
import time

import numpy as np
import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
from ament_index_python.packages import get_package_share_directory
from geometry_msgs.msg import Point, PoseStamped
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from tf2_ros import Buffer, TransformException, TransformListener
from tf_transformations import euler_from_quaternion
from visualization_msgs.msg import Marker, MarkerArray

from pure_pursuit.utils import load_waypoints


class PurePursuit(Node):
    """
    Implement Pure Pursuit on the car
    """
    def __init__(self):
        super().__init__('pure_pursuit_node')
        self.declare_parameter('waypoints', 'config/oval.csv')
        self.declare_parameter('lookahead', 1.2)
        self.declare_parameter('speed', 3.0)
        self.lookahead = self.get_parameter('lookahead').value
        self.speed = self.get_parameter('speed').value

        share = get_package_share_directory('pure_pursuit')
        self.waypoints = load_waypoints(os.path.join(share, self.get_parameter('waypoints').value))
        self.get_logger().info(f'{len(self.waypoints)} waypoints')

        self.tf_buffer = Buffer()
        self.tf_listener = TransformListener(self.tf_buffer, self)
        latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        self.viz_pub = self.create_publisher(MarkerArray, '/waypoints_viz', latched)
        self.drive_pub = self.create_publisher(AckermannDriveStamped, '/drive', 1)
        self.create_subscription(PoseStamped, '/pf/viz/inferred_pose', self.pose_callback, 1)
        self.publish_markers()

    def publish_markers(self):
        markers = MarkerArray()
        for i, (x, y) in enumerate(self.waypoints[::10]):
            marker = Marker()
            marker.header.frame_id = 'map'
            marker.id = i
            marker.type = Marker.SPHERE
            marker.action = Marker.ADD
            marker.pose.position = Point(x=x, y=y, z=0.0)
            marker.scale.x = marker.scale.y = marker.scale.z = 0.1
            marker.color.r = 1.0
            marker.color.a = 1.0
            markers.markers.append(marker)
        self.viz_pub.publish(markers)

    def pose_callback(self, pose_msg):
        start = time.time()
        q = pose_msg.pose.orientation
        _, _, yaw = euler_from_quaternion([q.x, q.y, q.z, q.w])
        try:
            t = self.tf_buffer.lookup_transform('map', 'base_link', rclpy.time.Time())
        except TransformException as ex:
            self.get_logger().warn(f'no transform: {ex}')
            return
        position = np.array([t.transform.translation.x, t.transform.translation.y])

        distances = np.linalg.norm(self.waypoints - position, axis=1)
        i = int(np.argmin(distances))
        while distances[i] < self.lookahead:
            i = (i + 1) % len(self.waypoints)
        dx, dy = self.waypoints[i] - position
        y = -np.sin(yaw) * dx + np.cos(yaw) * dy
        curvature = 2 * y / (dx ** 2 + dy ** 2)

        drive_msg = AckermannDriveStamped()
        drive_msg.header.stamp = self.get_clock().now().to_msg()
        drive_msg.drive.steering_angle = float(np.clip(np.arctan(0.33 * curvature), -0.41, 0.41))
        drive_msg.drive.speed = self.speed
        self.drive_pub.publish(drive_msg)
        hz = 1 / (time.time() - start)
        self.get_logger().debug(f'{hz:.0f} Hz')


def main(args=None):
    rclpy.init(args=args)
    node = PurePursuit()
    executor = MultiThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.shutdown()


if __name__ == '__main__':
    main()
