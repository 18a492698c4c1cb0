"""Servers that a race answers: `ros2`, `foxglove_server`, and `autodrive` for DevKits of AutoDRIVE."""
