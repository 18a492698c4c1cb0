"""Runs Python nodes of ROS as planners, unedited and with no ROS installed: `ros:path/node.py:ClassName`."""
