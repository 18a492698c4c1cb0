"""Runs Python nodes of ROS as planners, unedited and with no ROS installed: `ros:path/node.py:ClassName`.

`ros_planner` is what the engine sees. `graph` has topics, simulated time and the threads of nodes; `imports` decides
what a node's import statements find. `rclpy_modules`, `transform_modules` and `other_modules` are stubs of the
modules of ROS, `message_classes` has those of its message packages. `sensing` makes messages of what the car senses.
"""
