// Among other cars: which to keep behind, which to pass and on which side, and how fast.
#pragma once
#include <array>
#include <cstdint>

#include "../../controllers/control/driving.hpp"
#include "../../controllers/gap_finder.hpp"
#include "../../controllers/safety/predictions.hpp"
#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "corridor.hpp"
#include "other_cars.hpp"

namespace fg {

// Parameters of the gap finder, and of the cars that it meets.
struct OvertakerSettings {
    GapFinderSettings gap_finder;
    double braking;         // [m/s^2] with which another car may stop
    double car_margin;      // [m] round another car
    double least_lead;      // [s] for which a car goes on at least
    double closing;         // [m/s] faster than a car that it passes, at most
    double slowing;         // [m/s^2] with which the car can slow behind another, in a bend, too
    double behind;          // [m] from a car that it follows, beside what braking takes
    double look_at;         // [m] from a car that it may pass
    double aside;           // [m] from a car that it passes, at most
    double beside_wall;     // [m] from a wall beside another car, where there is more room
    double patience;        // [s] from giving up a pass to the next one
    double clear;           // [m] from side to side, from which on it goes faster than a car ahead
    double clear_by_speed;  // [s] the same, more for each m/s of the other car
    double room_to_pass;    // [m] to a side of another car, for a pass to begin
    double room_by_speed;   // [s] the same, more for each m/s of the other car
    double room_to_go_on;   // [m] the same, for it to go on
};
FG_RECORD_AFTER(OvertakerSettings, gap_finder, braking, car_margin, least_lead, closing, slowing, behind, look_at,
                aside, beside_wall, patience, clear, clear_by_speed, room_to_pass, room_by_speed, room_to_go_on);

inline constexpr int most_places = 15;     // of a walk: 3.5 m
inline constexpr double stands_for = 2.0;  // [s] after which a car that stands may do so for good, and is an obstacle

struct Passing {
    static constexpr std::int64_t follows = 0, passes = 1, drops_back = 2;

    std::int64_t what;           // one of these
    std::int64_t side;           // on which it passes: 1 to the left, -1 to the right
    double along;                // [m] by which the middle of the other car is ahead of that of the planner's car
    double across;               // [m] by which the planner's car is to its left
    double speed;                // [m/s] of the other car in the direction of both
    double stood;                // [s] for which the other car has stood
    double waits;                // [s] before the next pass begins
    double lasts;                // [s] for which it passes and is still behind
    std::int64_t places;         // of its way,
    WalkPlace way[most_places];  // on which it is expected
};
FG_RECORD(Passing, what, side, along, across, speed, stood, waits, lasts, places, way);

// Type of what a planner among other cars keeps from tick to tick; zero at the beginning.
struct Racing {
    OtherCars seen;
    Told told;
    bool met;
    Passing passing[most_cars];
};
FG_RECORD(Racing, seen, told, met, passing);

// Decide for each car in sight whether to follow or to pass it; return the greatest speed [m/s], inf: any.
//
// without: readings (n,) [m] without cars; the others have the parameters of `car`.
double choose(Racing& memory, const ScanGeometry& geometry, Numbers without, const CarParameters& car,
              const OvertakerSettings& settings);

// Add the cars ahead or beside, braking by [m/s^2], to the predictions: three discs each, along the course.
void predict_cars(const Racing& memory, const CarParameters& car, double braking, Predictions& predictions);

// Return where a car is when it has come so far on its way [m]: place [m] and heading [rad].
std::array<double, 3> pose_on(const Passing& passing, double way);

// Write the reference beside the nearest car that is passed, if there is one: a motion, its steering and its speed.
//
// The lane is the way of the other car, moved aside: as far as the wall there allows, at least to the middle of the
// room, and no farther than `aside` from side to side. The motion leads to it by pure pursuit, with a share of the
// grip.
void take_lane(const Racing& memory, double own_speed, const Driver& driver, const OvertakerSettings& settings,
               Reference& reference);

}  // namespace fg
