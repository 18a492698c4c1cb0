// Moves the tires, the drive and the steering of a car by short steps within a physics step.
//
// Tires are far stiffer than the car: a wheel's spin follows its tire at some 300 rad/s, where a body rolls on its
// springs at 50. So a physics step h moves the tires by n shorter ones (steps_within of tire_rows.py) while the rest
// of the car goes on as MuJoCo has it. The velocities of the four contact points, of the drive and of each two
// shafts that are tied make one vector w, and in a step
//
//     dw/dt = J M^-1 (the forces without tires and drive) + (J M^-1 J') f(w, u)
//
// with MuJoCo's own inertia M, joint damping taken implicitly as its implicitfast does, and the Jacobian J of w.
// MuJoCo is then given the mean of f over the step, so that it ends with the very w that the short steps ended with.
// The motor's force is a part of f. No tire moves the steering servo, which is stepped by itself; Ackermann's
// kingpins are then put where they belong.
//
// What ties the wheels (drive_line.py) is rigid, and gone before the short steps begin: a speed i of w that must
// stay 0 takes the mobility A = J M^-1 J' to A - A_i A_i' / A_ii (Schur), and the free motion a and w likewise. The
// inertia m of the motor, which turns with the speed i, takes A to A - A_i A_i' / (1 / m + A_ii) (Sherman and
// Morrison). MuJoCo gets their mean forces with the others: -(a_i + A_i' f) / (1 / m + A_ii). A clutch pushes
// against the difference of two shafts with what stops it in a short step, up to what it holds.
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
