// The state of the cars after a tick: what reward terms, end conditions and observations are functions of.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"

namespace fg {

// Write what the race monitor says of the cars `driven` (r,), and how their tires slid, to the arrays whose table is at
// an address; those of fg_mujoco/envs/tick_state.py.
void note_judged(std::int64_t table, Row<const bool> driven, std::int64_t substeps);

// Write how fast the axles of the cars `driven` (r,) slipped at the start of a tick, the mean of both.
void note_slips(std::int64_t table, Row<const bool> driven);

// Write the angles from the direction of the course at `places` (n,) to the headings of `poses` (n, 3).
void heading_errors(Matrix poses, Numbers places, Matrix table, Row<double> errors);

}  // namespace fg
