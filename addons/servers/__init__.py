"""Servers that a race answers: `ros2`, `foxglove_server`, `rosbridge`, and `autodrive` for DevKits of AutoDRIVE."""
