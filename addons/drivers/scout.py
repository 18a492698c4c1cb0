"""Scout: lap one as the gap finder, then a line through the ground that it saw. It is given no map and no pose.

1. Lap one. The car drives as the gap finder does, and keeps what the LiDAR saw from each place (perception.lap_map).
2. The map. Where the lap closes, the error of the dead reckoning is spread over it. From then on the car knows where it
   is by matching each scan with the readings at the nearest place.
3. The line. It is shaped between the walls of that map, first for little curvature and then for little lap time, a part
   in each tick, while the gap finder drives on. Its speed is what the tires hold through all that comes
   (safety.known_line).
4. Something new on the line is seen in the scan: the car brakes, and the gap finder passes it. Where the car is lost,
   the gap finder drives, and a new lap is recorded. `reasons` of a decision has "known line" while the line counts.

With the assist `full+learn` it is not told the friction either. It is the gap finder whose assist `full` has the stage
`remember`, which every planner with guidance can have.

Limits: those of the gap finder in the first lap, and in most of the second. Its line keeps .16 m from walls. What is
new behind a corner is seen late, as known ground counts as free before it is in sight.
"""

from __future__ import annotations

from fg_mujoco.controllers.control.assist import ASSISTS
from fg_mujoco.controllers.gap_finder import GapFinder


class Scout(GapFinder):
    """The planner that finds its map and its line by itself."""

    assists = {"full": (*ASSISTS["full"], "remember")}  # noqa: RUF012
