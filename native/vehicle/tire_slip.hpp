// The slip meter: how fast each tire's contact point slides over the ground, and how much of its friction it uses.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"
#include "tire_rows.hpp"

namespace fg {

// What the slip meter writes of each tire and step: TireSlip of tire_slip.py describes it.
namespace quantity {
enum {
    sliding_speed, friction_use, normal_force, friction_force, lateral_speed, force_x, force_y, slip_angle, slip_ratio,
    slides, count
};
}  // namespace quantity

// Sensor readings of a tire: found, force in the contact's frame (normal first), point, normal; centre, velocity and
// angular velocity of the wheel.
constexpr int contact_readings = 19;

// Work out the slip of the tires in each of some steps.
//   records: (at least steps, m) sensor readings, one row a step.
//   start, axles: where in a row the tires' and the axles' are; axles -1: nowhere.
//   mu: (steps, 4), or (1, 4) where all steps have the same.
//   tires: (4,); none for the model `contact`.
//   states: (at least steps, k) user data, one row a step, from `place` on; of tires with a curve.
//   slip: (QUANTITIES, steps, 4), written to, by quantity, step, tire.
void measure_slip(Matrix records, std::int64_t start, std::int64_t axles, Matrix mu, Row<const Tire> tires,
                  Matrix states, std::int64_t place, Cube<double> slip);

// Return how many steps slide, and write the tires' speeds [m/s] and friction utilisations [-] (8,); NaN: none.
std::int64_t greatest_slip(Cube<const double> slip, Row<double> greatest);

// Return the greatest sliding speed across a wheel's heading in `slip` [m/s], or `so_far` if that is greater.
double greatest_lateral_speed(Cube<const double> slip, double so_far);

}  // namespace fg
