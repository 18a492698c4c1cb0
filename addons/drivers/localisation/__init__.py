"""Where the car is on a map, from its scans and its odometry: in place of the true pose, for any planner.

    fg.race("tracks.yaml", "pure_pursuit[pose=particle_filter]")

distance_field    the signed distance to the walls of a map, on a grid
field_matching    least squares: the ends of a scan's beams on the walls
odometry          the motion between scans, its error, and the constant errors of its sensors
map_matching      a Kalman filter on it, which finds the errors of odometry, too
particle_filter   Monte Carlo localisation; it also finds a car that may be anywhere
localiser         late scans, moving LiDARs, and the pose of now; the settings
localised         planners that drive by the localiser's pose
"""
