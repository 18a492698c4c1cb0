"""Maps from scans: those of a bag, and those of a drive here.

sweeps         scans in their order, each with where the LiDAR was
bag_sweeps     those of a bag
scan_matching  corrects poses that drift: each scan is laid on the walls that were seen before
pose_graph     poses and the steps between them, by least squares; loop closure
ray_model      scans into free and occupied cells
recorded_map   the map of scans, and its files, which `--track` loads
driven_map     drives a planner on a course, and makes the map of what it saw, scored against the true walls
"""
