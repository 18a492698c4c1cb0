// Pieces of walls that slide over the floor; fg_mujoco/simulation/pieces.py has the law of their friction.
#pragma once
#include "../core/arrays.hpp"
#include "../core/numbers.hpp"
#include "../vehicle/mujoco_library.hpp"

namespace fg {

// Take from the velocities of pieces what the floor does in a step that has been done, and from their places likewise.
//   pieces: (k, 5) see `piece_table`.
inline void rub(mjData* data, Matrix pieces, double timestep) {
    for (std::int64_t k = 0; k < pieces.rows; ++k) {
        const Numbers own = pieces[k];
        double* const place = data->qpos + static_cast<std::int64_t>(own[0]);
        double* const velocity = data->qvel + static_cast<std::int64_t>(own[1]);
        const double turning = own[3] * velocity[2];
        const double speed = std::sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1] + turning * turning);
        if (speed == 0.0) continue;
        const double lost = own[2] * timestep / speed;
        const double share = lost < 1.0 ? 0.5 : 1.0;  // it moves by the mean of its velocities, and not where it stands
        for (int axis = 0; axis < 3; ++axis) {
            const double kept = lost < 1.0 ? velocity[axis] * (1.0 - (axis == 2 ? own[4] : 1.0) * lost) : 0.0;
            place[axis] += share * (kept - velocity[axis]) * timestep;
            velocity[axis] = kept;
        }
    }
}

}  // namespace fg
