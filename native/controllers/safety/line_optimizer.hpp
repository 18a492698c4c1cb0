// The fastest closed line within a band: of least curvature, or of least lap time.
#pragma once
#include <array>
#include <cstdint>
#include <tuple>

#include "../../core/arrays.hpp"
#include "friction_limiter.hpp"

namespace fg {

inline constexpr int grip_entries = 65;        // of the tables of what cornering leaves
inline constexpr int steps_of_flattening = 7;  // steps of least curvature, which are the first ones
inline constexpr int steps_of_a_round = 8;     // steps of least time, after which the points are spread evenly again
inline constexpr int steps_of_a_line = steps_of_flattening + 4 * steps_of_a_round;  // until it is finished

// What tires, motor and steering give: greatest acceleration and braking by lateral acceleration, and top speed.
struct Grip {
    double lateral;        // [m/s^2] greatest
    Numbers accelerating;  // (k,) [m/s^2] at k lateral accelerations, evenly from 0 to `lateral`
    Numbers braking;       // (k,) [m/s^2] positive
    double power;          // [m^2/s^3] of the motor over the mass, that accelerates
    double max_speed;      // [m/s]
    double lock;           // [1/m] greatest curvature without a price
    double use;            // share of the cornering acceleration that `lateral` is
    double turning;        // [m] times the change of curvature is what turning in takes of the grip; 0: nothing,
    double turning_out;    // and the same for turning out
};

// Return shares of what a friction limiter, of type LIMITER, allows up to a speed [m/s]. Its tables are those that are
// given (grip_entries,), which are written to.
Grip limited_grip(const Limiter& limiter, double max_speed, std::array<double, 3> uses, double turning_use,
                  Row<double> accelerating, Row<double> braking);

// Return the directions to the left of the points of a closed line (n, 2). Shape (n, 2).
OwnTable<double> normals_of(Matrix line);

// Write the curvatures [1/m] of a closed line (n, 2), and the steps to each point and from it [m]; all (n,).
void measure(Matrix line, Row<double> bends, Row<double> to, Row<double> on);

// Return the points for a step, evenly apart where a round begins, and how far each may move then [m].
std::tuple<OwnTable<double>, double> begin_step(Matrix line, std::int64_t step, double spacing);

// Move all points of a closed line once, and return the next step and its weight; NaN: there is no such line.
std::tuple<std::int64_t, double> improve(Table<double> line, Matrix normals, std::array<Row<double>, 2> room,
                                         std::int64_t step, double weight, const Grip& grip);

// Move each value (n,) of a ring by half of the way to the middle of its neighbours; `values` is written to.
void average(Row<double> values);

// Return so many points at even steps on the closed curve through points (n, 2); the first stays. (count, 2).
OwnTable<double> spread(Matrix line, std::int64_t count);

// Return the length of a closed row of points (n, 2) [m].
double length_of(Matrix line);

// Return the time of a lap [s] and the price of curvature beyond the lock, and write speeds and derivatives.
double fastest_lap(Numbers bends, Numbers steps, const Grip& grip, Row<double> speeds, Row<double> by_bend,
                   Row<double> by_step);

}  // namespace fg
