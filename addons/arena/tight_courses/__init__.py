"""Tight circuits as races are built, from a seed: `random:SEED:tight`. `tight` draws them, and `drivable` proves a lap.

`lanes` draws the outline of a patch of cells as a lane, and puts boxes on its straights.
"""
