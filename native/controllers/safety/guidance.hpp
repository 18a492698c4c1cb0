// Guidance: leads a planner that would drive into a pocket, or back, to the frontier.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../perception/frontiers.hpp"
#include "../perception/scan_geometry.hpp"
#include "friction_limiter.hpp"
#include "motion_search.hpp"
#include "turning.hpp"
#include "../../messages.hpp"

namespace fg {

struct Reference;

// When the planner drives, and how fast a motion is driven.
struct GuidanceSettings {
    std::int64_t every;  // ticks between two searches for the frontier, at least
    std::int64_t every_plain;  // the same, at most
    double as_good;  // of the best beam's gain of way: the planner's goal leads on
    double worth_simulating;  // of the best beam's gain: its reference is simulated
    double tight_distance;  // [m] way to go to a hidden frontier that counts as nearby
    double viable_time;  // [s] for which the planner's reference is simulated
    double lock;  // of the curvature at full lock, for motions; the rest keeps the car on them
    double grip;  // of the cornering acceleration, for motions
    double profile_grip;  // of the cornering acceleration, for the speed on a motion
    double profile_braking;  // of the greatest braking, ahead of a motion's curve
    double stop_braking;  // of the greatest braking, ahead of a motion's end
    double hidden_braking;  // of the greatest braking, ahead of a hidden frontier
    double horizon;  // [m] of a motion, and .1 s^2/m v^2 more
    double narrow_speed;  // [m/s] in gaps that are hardly wider than the car
    double trusted_speed;  // [m/s] below it a simulated motion gives the speed
    std::int64_t lost_after;  // ticks without a frontier, after which the car stops ahead of what it sees
    std::int64_t start_again_after;  // ticks, after which a car that stands forgets its path
    double stop_margin;  // [m] ahead of the bumper, where there is no frontier
};
FG_RECORD(GuidanceSettings, every, every_plain, as_good, worth_simulating, tight_distance, viable_time, lock, grip,
          profile_grip, profile_braking, stop_braking, hidden_braking, horizon, narrow_speed, trusted_speed,
          lost_after, start_again_after, stop_margin);

// Type of what guidance keeps of its car from tick to tick; zero at the beginning.
struct Guidance {
    FrontierSearch frontier;
    Motion motion;  // that the car follows
    Motion trial;  // that was last searched for
    Motion stop;  // along which the safety filter last found a stop; without points: none yet
    std::int64_t stop_progress;  // index of its point that is next
    bool follows;  // there is a motion to follow
    std::int64_t progress;  // index of the motion's point that is next
    bool narrow;  // the motion leads through a gap that is hardly wider than the car
    std::int64_t led_on;  // tick in which the planner was last found to lead on, by this reference:
    double steering_angle;  // [rad]
    double bearing;  // [rad]
    double speed;  // [m/s] that a simulated motion gave; inf: none did
    std::int64_t lost;  // ticks without a frontier
    bool careful;  // the car has had to turn in several moves: there are bends tighter than they look
    Turning turning;
};
FG_RECORD(Guidance, frontier, motion, trial, stop, stop_progress, follows, progress, narrow, led_on, steering_angle,
          bearing, speed, lost, careful, turning);

// What guidance proposes in place of a planner's reference.
struct Lead {
    // Who leads the car on: its planner; a motion; nobody, as none is found, and it brakes; a turn in moves.
    static constexpr std::int64_t by_planner = 0, by_motion = 1, by_nobody = 2, by_turn = 3;

    std::int64_t who;
    double steering_angle;  // [rad] of the motion or turn; NaN: the planner's
    double bearing;         // [rad] of the next point of the motion; NaN: the planner's, or none
    double distance;        // [m] of that point
    double speed;           // [m/s] greatest; of a turn the speed itself, negative in reverse
    bool knows_speed;       // the speed is that of a motion, which is free farther than is in sight
};

// What guidance sees in a tick.
struct Seen {
    const ScanGeometry& geometry;
    Numbers ranges;  // (n,) [m], without NaN or inf
    const Odometry& odometry;
    const Limiter& limiter;
    const GuidanceSettings& settings;
    const Reference& reference;  // the planner's
};

// Return who leads the car on in this tick, and how. Without a scan that looks ahead the planner does.
Lead follow_frontier(const Seen& seen, Guidance& memory);

// Return the points (m, 4) of the motion that the car follows, in the frame of its rear axle; or none.
OwnTable<double> path_ahead(const Guidance& memory);

// Keep the motion that the car follows as one along which it can stop.
void keep_stop(Guidance& memory);

// Return the points (m, 4) of the motion along which the car could last stop, as `path_ahead` does.
OwnTable<double> stop_ahead(Guidance& memory);

// Return the speed [m/s] from which the car stops ahead of what is in front of it.
double speed_to_stop(const ScanGeometry& geometry, Numbers ranges, const Limiter& limiter,
                     const GuidanceSettings& settings);

}  // namespace fg
