#!/usr/bin/env python
import os

import numpy as np
import rospy
from ackermann_msgs.msg import AckermannDriveStamped
from nav_msgs.msg import Odometry
from tf.transformations import euler_from_quaternion

rospy.init_node('pure_pursuit', anonymous=False)
path = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'pure_pursuit/config/oval.csv')
waypoints = np.loadtxt(path, delimiter=',')
LOOKAHEAD = rospy.get_param('~lookahead', 1.2)
pose = None


def odom_callback(msg):
    global pose
    q = msg.pose.pose.orientation
    yaw = euler_from_quaternion((q.x, q.y, q.z, q.w))[2]
    pose = (msg.pose.pose.position.x, msg.pose.pose.position.y, yaw)


rospy.Subscriber('/odom', Odometry, odom_callback)
pub = rospy.Publisher('/vesc/ackermann_cmd_mux/input/navigation', AckermannDriveStamped, queue_size=1)
rospy.wait_for_message('/odom', Odometry)
rate = rospy.Rate(50)
while not rospy.is_shutdown():
    x, y, yaw = pose
    d = np.hypot(waypoints[:, 0] - x, waypoints[:, 1] - y)
    i = np.argmin(d)
    while d[i] < LOOKAHEAD:
        i = (i + 1) % len(waypoints)
    dx, dy = waypoints[i] - (x, y)
    lateral = -np.sin(yaw) * dx + np.cos(yaw) * dy
    msg = AckermannDriveStamped()
    msg.header.stamp = rospy.Time.now()
    msg.drive.steering_angle = np.arctan(0.33 * 2 * lateral / d[i] ** 2)
    msg.drive.speed = 2.5
    pub.publish(msg)
    rate.sleep()
