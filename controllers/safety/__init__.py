"""Keeps the car from hitting things and from sliding, in the same way for all planners.

The car is never faster than it can stop within what it sees (braking_trajectories). A reference after which it could
not stop is replaced (safety_filter). Where it stands without a frontier, it reverses and tries again (recovery). What
is then commanded stays within what the tires hold (friction_limiter).
"""
