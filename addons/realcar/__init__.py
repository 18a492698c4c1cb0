"""Real cars: what they recorded, and what follows from it.

`drives` reads drives, `identification` finds tires and steering of a car, and `validation` says how well a vehicle
agrees with its drives. `single_track` is the car in two dimensions that identification and validation drive.
"""
