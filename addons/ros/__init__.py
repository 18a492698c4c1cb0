"""ROS without ROS: nodes as planners (`node_host`), and bags, written and read. Bags need the extra `ros`."""
