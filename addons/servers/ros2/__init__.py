"""A live race as a node of ROS 2: a participant on DDS, without ROS."""
