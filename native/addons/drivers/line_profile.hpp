// Lines through a map and how fast they can be driven: what a planner with a map follows.
#pragma once
#include <cstdint>

#include "../../controllers/safety/friction_limiter.hpp"
#include "../../core/arrays.hpp"

namespace fg {

// Columns of a table: the place [m], the speed there [m/s], how far it is to the next point [m] (0: the end), and how
// far the car may be beside it, from (negative, to the right) and to [m].
inline constexpr int line_x = 0, line_y = 1, line_speed = 2, line_step = 3, line_right = 4, line_left = 5;
inline constexpr int line_columns = 6;

inline constexpr double line_room = 1.0;  // [m] greatest to either side, and all that is known where there are no walls

// Lower the speeds of a table to what the tires hold: cornering together with braking and accelerating.
void limit_speeds(Table<double> table, Numbers bend, const Limiter& limiter, double cornering_use, double braking_use);

// Return the point after (direction 1) or before (-1) one of the line; at the end of an open line, the same.
std::int64_t next_point(Matrix line, std::int64_t point, int direction);

// Return the point that is `distance` [m] further along the line, or before where negative.
std::int64_t moved_along(Matrix line, std::int64_t point, double distance);

}  // namespace fg
