// The position of an obstacle is a closed form of the time.
#include "moving_obstacles.hpp"

#include "../core/numbers.hpp"
#include "modulo.hpp"

namespace fg {

std::array<double, 2> obstacle_position(Numbers motion, double time) {
    const double x = motion[0], y = motion[1], end_x = motion[2], end_y = motion[3];
    const double speed = motion[4], headway = motion[6], way = motion[7];
    const bool back_and_forth = motion[5] != 0.0;
    const double driven = max(headway + speed * time, 0.0);
    const double gone = back_and_forth ? way - std::abs(modulo(driven, 2.0 * way) - way) : min(driven, way);
    const double share = gone / way;
    return {x + share * (end_x - x), y + share * (end_y - y)};
}

}  // namespace fg
