// One simulation of the car along a proposal: the friction limiter, the servos and the slip of soft tires in the loop.
#pragma once
#include <cmath>
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/numbers.hpp"
#include "../perception/frontiers.hpp"
#include "../perception/scan_geometry.hpp"
#include "friction_limiter.hpp"

namespace fg {

struct JudgeSettings;

// What a proposal is judged by: the car, and all that may be in its way.
struct Situation {
    const Limiter& limiter;
    LimiterMemory& memory;  // unchanged after a simulation
    const JudgeSettings& settings;
    const ScanGeometry& geometry;
    Numbers ranges;   // readings (n,) [m]
    Numbers widened;  // the same, each widened by a disc over the car's front
    double radius;    // [m] of that disc
    Matrix movers;    // (k, 12) predictions of what moves, which is not in the scan
    const FrontierSearch& ground;
    double angle;   // [rad] present steering angle
    double speed;   // [m/s] present
    double period;  // [s] of a tick
    bool known;     // whether what the scan hides counts as free: the car has driven there
};

// What a simulated car meets on its way to a stop.
struct Met {
    static constexpr std::int64_t free = 0, stands = 1, moves = 2;

    double speed;       // [m/s] then; 0: it meets nothing
    double time;        // [s] until then, or until it stands
    std::int64_t what;  // free, or what it meets stands, or moves
};

// How a proposal is followed: the frame is that of the rear axle; `path` has no points where it leads to a goal.
struct Plan {
    double bearing;   // [rad] of the goal from the LiDAR
    double distance;  // [m] of that goal
    Matrix path;      // (m, 4) motion, as in motions.py, or (m, 5) with the speeds at which the car goes on
    double speed;     // [m/s] that is commanded for a tick, before the car brakes
    double margin;    // [m] ahead of the bumper
};

// Return the situation without what moves, of a car whose wheels stand at an angle [rad].
inline Situation among_standing(const Situation& here, double angle) {
    return {here.limiter,
            here.memory,
            here.settings,
            here.geometry,
            here.ranges,
            here.widened,
            here.radius,
            {here.movers.data, 0, here.movers.columns},
            here.ground,
            angle,
            here.speed,
            here.period,
            here.known};
}

// Return the situation without what moves.
inline Situation without_movers(const Situation& here) { return among_standing(here, here.angle); }

// Return what a car of a speed [m/s] meets on its way to a stop, with a share of the grip for cornering.
Met simulate(const Situation& here, const Plan& plan, double use, double speed);

// Return the widened reading [m] of a beam, or of the first or last one: NaN is the first. Of no beams it is 0.
inline double reading_of(const Situation& here, double beam) {
    if (here.widened.length == 0) return 0.0;
    return here.widened[whole(min(static_cast<double>(here.widened.length - 1), max(0.0, beam)))];
}

// Return the widened reading [m] in the direction of a point [m] in the frame of the LiDAR.
inline double reading_towards(const Situation& here, double ahead, double left) {
    return reading_of(here, nearest_beam(here.geometry.angle_min, here.geometry.angle_increment, ahead, left));
}

// Return the widened reading [m] at a bearing [rad].
inline double reading(const Situation& here, double bearing) {
    return reading_of(here, std::rint((bearing - here.geometry.angle_min) / here.geometry.angle_increment));
}

}  // namespace fg
