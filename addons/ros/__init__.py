"""ROS without ROS: nodes as planners (`node_host`), and bags, written and read. Bags need the extra `ros`.

`bag_writer` writes a run folder as a ROS 2 bag; `bag_messages` has its messages and `occupancy_grid` its map.
`bag_reader` reads the bags of ROS 1 and ROS 2, `bag_scans` turns their scans into those that planners read, and
`bag_replay` runs a planner over them. `bag_signs` turns odometry round whose sign is wrong.
"""
