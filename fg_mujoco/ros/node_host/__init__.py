"""Runs Python nodes of ROS as planners, unedited and with no ROS installed: `ros:path/node.py:ClassName`.

`ros_planner` is what the engine sees. `graph` has topics, simulated time and the threads of nodes; `imports` decides
what a node's import statements find. `rclpy_modules`, `rospy_modules`, `transform_modules` and `other_modules` stand in
for the modules of ROS, `message_classes` for its message packages. `sensing` makes messages of what the car senses.
"""
