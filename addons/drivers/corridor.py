"""The ground along which a course leads from a place that the LiDAR sees, and how much room is to both sides.

A walk goes on from a place in the direction of a heading by steps of `STEP`, and keeps its share of the width: a car
in the middle stays in the middle, one that is near to a wall stays near to it. It says where a car will go that follows
the course, which its turn rate does not say before a bend, and how wide the course is there. It ends where nothing is
seen.

What is hidden counts as wall: the jump from one beam to the next is filled with points.

The work is done in native/addons/drivers/corridor.cpp.
"""

from __future__ import annotations

from fg_mujoco.native import core

STEP = 0.25  # [m] of a walk, as in corridor.hpp
X, Y, HEADING, LEFT, RIGHT = range(5)  # columns of a walk: place, heading, and the room to both sides

ground_points, room_beside, walk = core.ground_points, core.room_beside, core.walk
