// Turning in several moves: a slow car in a place that is tighter than its turning circle turns as in a parking lot.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../perception/frontiers.hpp"
#include "friction_limiter.hpp"
#include "motion_search.hpp"

namespace fg {

// Type of what is kept from tick to tick; zero at the beginning.
struct Turning {
    bool active;
    double slow;          // [s] for which the car has been slow; while turning, for which it has stood
    std::int64_t failed;  // times that no motion was found
    std::int64_t begun;   // turns that began near a place of the path,
    double begun_at;      // [m] along it
    Motion motion;
    std::int64_t next_point;  // index of the motion's point that is next
    std::int64_t in_walls;    // points of the outline in cells of walls at the beginning
    double steering_angle;    // [rad] of the command
    double speed;             // [m/s] of the command, negative in reverse
};
FG_RECORD(Turning, active, slow, failed, begun, begun_at, motion, next_point, in_walls, steering_angle, speed);

// Begin, follow or end a turn in several moves. While it is active, its command is in the memory.
// Arguments: present steering angle [rad] and speed [m/s]; period of a tick [s].
void turn_in_moves(FrontierSearch& frontier, const Limiter& limiter, Turning& memory, double steering_angle,
                   double speed, double period);

}  // namespace fg
