"""Racelines: the fastest line of a circuit for a car on its tires, with the speed at each point.

grip              what a car on its tires can do: greatest accelerations ahead and back, by lateral acceleration
raceline          the line of a circuit, with speeds and lap time, and the file of it
raceline_picture  the line coloured by speed, and the use of the grip
"""
