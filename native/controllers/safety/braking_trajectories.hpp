// Braking trajectories: how fast the car may go so that it can still stop within what the scan shows.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "friction_limiter.hpp"

namespace fg {

// Inputs of a planned stop.
struct BrakingSettings {
    double braking_share;  // share of the cornering acceleration: a half, less a margin for turning in
    double reaction;  // [s] a tick and the servo's lag
    double margin;  // [m] ahead of the bumper at a stop: what turning in takes
    double clearance;  // [m] round the car's front
    double least_speed;  // [m/s] slowest speed that is looked at
};
FG_RECORD(BrakingSettings, braking_share, reaction, margin, clearance, least_speed);

inline constexpr int braking_presents = 8;  // shares of the cornering grip that are in use when the scan is taken
inline constexpr int most_braking_speeds = 128;
inline constexpr int braking_turnings = 7;  // shares of the cornering grip to turn aside with
inline constexpr int braking_points = 24;

// Type of the table of all braking trajectories of a car: one megabyte and a half.
struct Trajectories {
    double radius;  // [m] of the disc that covers the car's front
    double lateral;  // [m/s^2] that may be used in cornering
    double wheelbase;  // [m]
    std::int64_t count;  // of the speeds that are looked at
    double speeds[most_braking_speeds];  // [m/s] slowest first, and behind the last of them 0
    // of the disc's centre along the trajectories that turn left, as the LiDAR sees it from where the car is now
    float bearings[braking_presents][most_braking_speeds][braking_turnings][braking_points];  // [rad]
    float distances[braking_presents][most_braking_speeds][braking_turnings][braking_points];  // [m]
};
FG_RECORD(Trajectories, radius, lateral, wheelbase, count, speeds, bearings, distances);

// Return the greatest speed [m/s] with a free braking trajectory, 0 where there is none.
double safe_speed(const Trajectories& trajectories, Numbers widened, double angle_min, double angle_increment,
                  double speed, double steering_angle);

// Write bearings [rad] and distances [m] of the points of all braking trajectories that turn left, a row for each
// trajectory, in the order of Trajectories; of speeds that are not looked at they are left as they are.
void all_trajectories(const Limiter& limiter, const BrakingSettings& settings, Numbers speeds, Table<double> bearings,
                      Table<double> distances);

}  // namespace fg
