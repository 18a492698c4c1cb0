// Predicted paths of moving targets: where they may be when the car is there, and in the car's simulated stops.
#pragma once
#include <array>
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"
#include "../perception/scan_geometry.hpp"
#include "../perception/targets.hpp"

namespace fg {

struct Driver;

inline constexpr double seen_after = 0.15;  // [s] after which it is known that one has turned
inline constexpr double wait_time = 0.4;    // [s] for which a car that has stopped should not be met,
inline constexpr int waits = 4;             // so many times

// Type of what is kept from tick to tick; zero at the beginning.
struct Predictions {
    Targets targets;
    Odometry odometry;     // of the time of the scan
    double speeds[16];     // [m/s] of the last ticks
    double yaw_rates[16];  // [rad/s]
    std::int64_t tick;
    std::int64_t count;
    std::int64_t cars;  // how many of them, at the end, are of cars that a planner follows by its own rules
    double rows[42][12];
};
FG_RECORD(Predictions, targets, odometry, speeds, yaw_rates, tick, count, cars, rows);

// A row of predictions.
struct Prediction {
    double x, y;       // [m] middle, ahead and left of the LiDAR
    double cos, sin;   // of its course
    double speed;      // [m/s]
    double radius;     // [m]
    double to_wall;    // [m] way to what stands
    double braking;    // [m/s^2]
    double spread;     // [m/s] uncertainty of the speed
    double curvature;  // [1/m] of its path
    double from_wall;  // [m] way back to what stands
    double turns;      // at how many ends of its way it was seen to turn
};
static_assert(sizeof(Prediction) == sizeof(Predictions::rows[0]));

inline Prediction& prediction(Row<double> row) { return *reinterpret_cast<Prediction*>(row.data); }
inline const Prediction& prediction(Numbers row) { return *reinterpret_cast<const Prediction*>(row.data); }

// Predict and separate the targets; return whether one moves. Without one neither scan is written to.
bool foresee(const ScanGeometry& geometry, Row<double> seen, Row<double> ranges_without_movers,
             const Odometry& odometry, const Driver& driver, Predictions& memory);

// Track the targets in a scan (n,) [m] and predict those that move; return whether there is one.
bool predict(const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, const Driver& driver,
             Predictions& memory);

// Track the targets in a scan; return whether one moves. Arguments as of `predict`.
bool track(const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, const Driver& driver,
           Predictions& memory);

// Return how far the middle of a target is ahead of the LiDAR and to its left [m].
std::array<double, 2> position_of(const Targets& seen, const Target& target);

// Predict the targets that move; return whether there is one.
bool write_predictions(Predictions& memory);

// Take the targets out of a scan (n,) [m], copy it, and write how far each of them can go on and back.
void separate(const ScanGeometry& geometry, Row<double> seen, Row<double> ranges_without_movers, Predictions& memory);

// Take moving targets out of a scan (n,) [m]: their beams get the nearer of the ranges beside them.
void hide_targets(const Targets& targets, Row<double> ranges);

// Return the interval of its line in which a target may be at a time [s]: ways from where it is now [m].
std::array<double, 2> interval(Numbers row, double time);

// Return the same interval as the plan in time counts on: what crosses slows by little, and turns at walls.
// `bold`: from 0 to 1, as the car has waited.
std::array<double, 2> occupied(Numbers row, double time, double bold);

// Return whether a disc at a place [m] could touch a target at a time [s]; `rows` are predictions (k, 12).
bool meets(Matrix rows, double ahead, double left, double radius, double time);

// Return the predictions (k, 12) in a frame that is turned to the left by an angle [rad] round the LiDAR.
OwnTable<double> turned(const Predictions& memory, double angle);

}  // namespace fg
