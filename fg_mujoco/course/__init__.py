"""Courses: what a race is driven on, from its line, walls and obstacles to the files that it is read from.

    course       the members that every course has, and the rules of a race on it
    track        a closed course: centreline and widths; track_walls, track_mesh: its walls in 2D and 3D
    projection   the progress and the offset of a point, also on the inside of tight bends
    scene        an open course, from a start to a goal; scenes/: those that have a name
    maps/        courses from ROS maps, and tracks exported as maps and meshes
    formats      a course from its name; centreline_csv, generator: circuits from files and seeds
    obstacles    solids that stand, moving_obstacles those that move, random_obstacles those at random places
    documents    TOML and JSON that others may have written; files, writing: bounded reading, and writing in one step
    definitions  the numbers that make a course what it is, and their hash
    lap_timer    progress and laps; clearance: the distance to walls and obstacles; standing: where a car can stand
    polyline     plane geometry

A course knows nothing of the vehicle. Where the size of the car matters, it is given as `CarParameters`.
"""
