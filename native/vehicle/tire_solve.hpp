// Moves the tires, the drive and the steering of a car by short steps within a physics step. tire_solve.py has how.
#pragma once
#include <array>
#include <cstdint>

#include "../core/arrays.hpp"
#include "mujoco_library.hpp"
#include "tire_rows.hpp"

namespace fg {

// Which entries MuJoCo keeps of its inertia matrices: of a model, and the same for all its data.
struct Inertia {
    Row<const std::int32_t> row_counts;
    Row<const std::int32_t> row_starts;
    Row<const std::int32_t> columns;
};

// Return that of a model.
inline Inertia inertia_of(const mjModel* model) {
    return {{model->M_rownnz, model->nv}, {model->M_rowadr, model->nv}, {model->M_colind, model->nC}};
}

constexpr int scratch_numbers = 1536;  // SCRATCH, that `push_car` needs room for

// Move the tires and the drive line of a car by the short steps of a physics step, and add their mean forces.
// MuJoCo's stages up to the acceleration without constraints must be done, with the inertia of `damp_inertia`.
//   tires: (k,), up to four, of peaks `mu` (k,) [-] and states `own` (k,), which are written to.
//   scratch: (SCRATCH,) room.
void push_car(const mjModel* model, mjData* data, const Inertia& inertia, const Gear& gear, Row<const Tire> tires,
              Numbers mu, Row<TireState> own, Row<double> scratch, std::int64_t dofs, double timestep,
              std::int64_t steps);

// Return where the steering servo is after a physics step [rad], and its rate [rad/s].
std::array<double, 2> steer(const mjModel* model, const mjData* data, const Gear& gear, double timestep,
                            std::int64_t steps);

// Put the steering where its servo is, and the kingpins where Ackermann's polynomials have them.
void put_steering(mjData* data, const Gear& gear, double angle, double rate);

}  // namespace fg
