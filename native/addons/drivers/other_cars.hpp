// Other cars in the scan: which small things there move, where they are, and how fast.
#pragma once
#include <array>
#include <cstdint>

#include "../../controllers/control/planner_settings.hpp"
#include "../../controllers/perception/scan_geometry.hpp"
#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"

namespace fg {

inline constexpr int most_cars = 6;     // that a planner follows by rules of its own
inline constexpr int most_others = 15;  // cars that it can be told of

inline constexpr double least_range = 0.02;  // [m] that a beam counts as long, at least
inline constexpr double widest_box = 0.25;   // [m] from end to end of a run of beams

struct CarSeen {
    std::int64_t age;  // sightings; 0: there is none
    double x;          // [m] middle of its box, where the planner's car began
    double y;          // [m]
    double vx;         // [m/s]
    double vy;         // [m/s]
    double heading;    // [rad] in which it last moved
    double turn_rate;  // [rad/s] of its heading
    double first_x;    // [m] where it was first seen
    double first_y;    // [m]
    double unseen;     // [s]
    bool moves;        // it has moved
};
FG_RECORD(CarSeen, age, x, y, vx, vy, heading, turn_rate, first_x, first_y, unseen, moves);

// What the sensor of the other cars says of one, all NaN where there is none: its pose [m, rad], speed and yaw rate.
struct ToldCar {
    double x, y, heading;
    double speed;     // [m/s]
    double yaw_rate;  // [rad/s]
};

// Type of what a planner is told of other cars, and where it keeps each; zero at the beginning.
struct Told {
    double stamp;  // [s] of the odometry; 0: none has been told
    ToldCar cars[most_others];
    bool follows;                      // they are followed now
    std::int64_t places[most_others];  // of each in `cars` of OtherCars, from 1; 0: it has none
    double unseen[most_others];        // [s]
};
FG_RECORD(Told, stamp, cars, follows, places, unseen);

// Type of what is kept from tick to tick; zero at the beginning.
struct OtherCars {
    double x;        // [m] of the LiDAR, by dead reckoning from where it began
    double y;        // [m]
    double heading;  // [rad]
    CarSeen cars[most_cars];
};
FG_RECORD(OtherCars, x, y, heading, cars);

// Follow what is in a scan, and say whether there is a car.
//
// ranges: readings (n,) [m], without NaN or inf; lidar_offset: of the LiDAR ahead of the rear axle [m].
bool watch_cars(OtherCars& memory, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry,
                double lidar_offset);

// Return whether the odometry of the others is known, and not too old; and where the planner's own car is.
bool is_told(const Told& told, const Odometry& odometry);

// Have the cars that were told of as those that are followed, and say whether there is one.
//
// They are where they go from where they were, when that was measured, at a constant speed and turn rate. One counts
// if a beam reaches it, and for a time after; beside or behind, where no beam goes, for as long as it is near.
// ranges: readings (n,) [m], without NaN or inf; odometry: with a pose on the map; car: parameters of the others, too.
bool follow_told(OtherCars& memory, Told& told, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry,
                 const CarParameters& car);

// Write where the middles of what may be boxes are, ahead and left of the LiDAR (k, 2) [m]; return how many.
//
// ranges: readings (n,) [m], without NaN or inf; noise: their standard deviation [m].
std::int64_t find_boxes(const ScanGeometry& geometry, Numbers ranges, double noise, Table<double> found);

// Return the distances of a place ahead of the LiDAR and to its left [m].
std::array<double, 2> seen_from(const OtherCars& memory, double x, double y);

}  // namespace fg
