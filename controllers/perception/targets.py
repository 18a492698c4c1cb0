"""Moving targets in the scan: which things move, where they are and how fast, from the LiDAR and odometry alone.

1. A scan is cut into clusters where neighbouring ranges differ by more than 15 cm and than the noise of the beams
   explains, which is estimated in each scan. A cluster is looked at if it is narrower than 1.2 m and ends in front
   of farther ground on at least one side. Walls are wider, and what lies between two nearer things shows no end of its
   own.
2. Each cluster has two ends: bearings of its outermost beams, at the distance of the middle of a disc that would be
   seen under the same angle at its least range. The middle of the ends does not go round a box or a cylinder when the
   car does. The least of many noisy beams is too short, so where there is noise the ranges are averaged first, over an
   eighth of the cluster at most. An end in front of farther ground belongs to the thing itself; one beside nearer
   ground is the edge of a shadow, and says nothing of motion. Of a thing that is partly hidden the end is where it is
   seen itself, as the part in cover may be the nearest.
3. Clusters are followed from scan to scan in a frame that stands still, by dead reckoning. A Kalman filter with
   constant velocity, whose covariance is the same for x and y, is fed with the mean innovation of the ends that belong
   to the thing. So a thing that comes out of cover is measured by the end that leads. Innovations against the velocity
   are summed up (CUSUM): a thing that turns back is noticed after some scans. Its velocity is turned round then, and
   the farthest place it was seen at is kept, because it will turn there again. Where both such places are known it is
   expected to turn there, at once; if it goes on, both are forgotten.
4. A target moves if its velocity is 4 standard deviations from zero, and if this scan and one of the last
   0.8 s contradict each other. A standing thing is where a beam ends, so no other beam sees past it. The proof is that
   two of the target's beams end where the earlier scan sees past, or that this scan sees past where the earlier one saw
   it. Odometry errs by shares of the way and of the turn, and by the slip of wheels that speed up or brake. So all
   beams that may point to the place have to see past it, by more than the way may err along them. A wall's end that
   only changes its outline as the car turns round it never contradicts an earlier scan.

Sources: R. Kalman, A New Approach to Linear Filtering and Prediction Problems, Journal of Basic Engineering 82(1),
1960; E. Page, Continuous Inspection Schemes, Biometrika 41, 1954, for the sums of innovations; D. Hähnel, R. Triebel,
W. Burgard and S. Thrun, Map Building with Mobile Robots in Dynamic Environments, IEEE ICRA 2003, for ground that was
free before.

Limits: a thing that touches a wall, or one nearer than 15 cm to what is behind it, is part of it, and so is one that
the field of view cuts off. Beyond 7 m, what moves in front of nothing that the LiDAR sees is not known to move: as
the car rolls, beams pass above things there. A target that is hidden is taken to go on as it did for .6 s.
Things wider than 1.2 m stand.

The work is done in native/controllers/perception/targets.cpp.
"""

from __future__ import annotations

import numpy as np

from fg_mujoco.native import core, record

MOST_TARGETS = 24

_TARGET = record(
    "Target",
    [
        ("age", np.int64),  # sightings; 0: there is none
        ("ends", np.float64, (2, 2)),  # x and y [m] of the right and of the left end, where the planner's car began
        ("own", np.uint8, (2,)),  # whether each end belonged to the thing at the last sighting
        ("radius", np.float64),  # [m] of a disc that is seen under the same angle; 0 where an end is hidden
        ("vx", np.float64),  # [m/s]
        ("vy", np.float64),  # [m/s]
        ("p_place", np.float64),  # [m^2] covariance, the same in x and y
        ("p_mixed", np.float64),  # [m^2/s]
        ("p_speed", np.float64),  # [m^2/s^2]
        ("misfits", np.int64),  # innovations in turn that were too great
        ("against", np.float64),  # sum of those against its velocity, in standard deviations
        ("still", np.float64),  # [s] for which it has not moved
        ("unseen", np.float64),  # [s]
        ("moves", np.bool_),
        ("distance", np.float64),  # [m] from the LiDAR at the last sighting
        ("size", np.float64),  # [m] greatest radius that was seen
        ("first", np.int64),  # beam of the last sighting,
        ("end", np.int64),  # and the one behind the last
        ("turns", np.int64),  # times that it was seen to turn back
        ("turned", np.float64, (2, 2)),  # x and y [m] of the last two places where it did
        ("farthest", np.float64, (2,)),  # x and y [m] of the place that is farthest on its way since it turned
    ],
)
_SNAPSHOT = record(
    "Snapshot",
    [
        ("x", np.float64),  # [m] of the LiDAR
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("tick", np.int64),  # when it was taken; 0: none is kept
        ("turned", np.float64),  # [rad] until then
        ("doubt", np.float64),  # [m] the same
        ("noise", np.float64),  # [m]
        ("ranges", np.uint16, (1081,)),  # [mm] least of each bin
    ],
)
TARGETS = record(
    "Targets",
    [
        ("x", np.float64),  # [m] of the LiDAR, by dead reckoning from where it began
        ("y", np.float64),  # [m]
        ("heading", np.float64),  # [rad]
        ("speed", np.float64),  # [m/s] at the last scan: the mean of two is that of the time between them
        ("yaw_rate", np.float64),  # [rad/s]
        ("turned", np.float64),  # [rad] to either side
        ("doubt", np.float64),  # [m] by which the way may err
        ("noise", np.float64),  # [m] of the last scan's readings
        ("tick", np.int64),
        ("beams", np.int64),  # of the scans that are kept
        ("count", np.int64),  # of targets that move
        ("targets", _TARGET, (MOST_TARGETS,)),
        ("snapshots", _SNAPSHOT, (5,)),
    ],
)
"""Type of what is kept from tick to tick; zero at the beginning."""

track_targets = core.track_targets
