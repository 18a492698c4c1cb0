"""Racelines: the fastest line of a circuit for a car on its tires, with the speed at each point."""
