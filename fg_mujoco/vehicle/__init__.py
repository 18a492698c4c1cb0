"""Vehicles: read off their MJCF, changes of them, tires, and the slip of each tire.

`vehicle` has Vehicle, one MJCF file with its LiDAR and its look; `contract` is what such a file must name and keep, and
`drive_line` is how its wheels are driven and tied. `steering_servo` says who moves the steering, and how it answers.
`changes` has small differences from the file, for one world or for each of a batch. `car` reads and drives a car in a
compiled model, by `motion`. `tires` has the tire laws and sets, `tire_forces` steps a car on them, by `tire_rows` and
`tire_patch`. `tire_slip` measures what the tires do. `bodywork` is how the body meets walls, cars and the ground, and
`friction_patches` are places of the floor with another friction.
"""
