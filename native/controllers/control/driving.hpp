// Settings of driving, and the records of a car, its reference and its memory, which all planners share.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"
#include "../perception/scan_geometry.hpp"
#include "../safety/friction_limiter.hpp"
#include "../safety/guidance.hpp"
#include "../safety/judge.hpp"
#include "../safety/plan_in_time.hpp"
#include "../safety/predictions.hpp"
#include "../safety/recovery.hpp"
#include "actuation.hpp"
#include "planner_settings.hpp"
#include "slip.hpp"

namespace fg {

// Indices of the words of DrivingSettings' method and steering.
inline constexpr std::int64_t method_source = 1, steering_by_bearing = 1;

// Parameters of driving, which all planners have; a planner may have other defaults.
struct DrivingSettings {
    double safe_distance;  // [m] distance_ahead: nearer ahead of the LiDAR than this, the car stops
    // [m] distance_ahead: full speed beyond it; as the only law it has to slow the car for bends, too
    double full_speed_distance;
    double lookahead;  // [m] mean_range: longer readings count as this
    double mean_range_gain;  // mean_range: full speed at a mean range of lookahead / gain
    double front_width;  // [rad] mean_range: around the goal, for the mean range; 4 pi is the whole scan
    double pursuit_distance;  // [m] the arc leads through the point this far along the goal's direction
    double pursuit_time;  // [s] the same point is at least the way of this time ahead
    std::int64_t method;  // source: exactly the planner's source, the default without sight; refined: with improvements
    std::int64_t steering;  // to the goal: along an arc, or by its bearing as the steering angle
};
FG_RECORD(DrivingSettings, safe_distance, full_speed_distance, lookahead, mean_range_gain, front_width,
          pursuit_distance, pursuit_time, method, steering);

// Type of what driving reads of a planner.
struct Driver {
    CarParameters car;
    double max_speed;  // [m/s]
    bool mean_range;
    bool distance_ahead;
    bool friction_law;
    bool sight;
    bool safety_filter;
    bool recovery;
    bool prediction;
    bool guidance;
    bool has_limiter;
    std::int64_t late;  // ticks by which scans are older than the odometry
    DrivingSettings settings;
    Limiter limiter;
    JudgeSettings judge_settings;
    RecoverySettings recovery_settings;
    GuidanceSettings guidance_settings;
    std::int64_t trajectories;  // which table of braking trajectories is its own
    std::int64_t line_first;  // which points of the lines through the map are its own: the first,
    std::int64_t line_end;  // and the one behind the last
};
FG_RECORD(Driver, car, max_speed, mean_range, distance_ahead, friction_law, sight, safety_filter, recovery, prediction,
          guidance, has_limiter, late, settings, limiter, judge_settings, recovery_settings, guidance_settings,
          trajectories, line_first, line_end);

// Type of what they keep of its car from tick to tick; zero at the beginning.
struct DrivingMemory {
    LimiterMemory limiter;
    Recovery recovery;
    Guidance guidance;
    std::int64_t lead;  // who leads the car on, see PLANNER_LEADS of guidance,
    bool knows_speed;  // and whether the speed is that of a motion, which is free farther than is in sight
    Speedometer speedometer;
    VelocityFrame velocity_frame;
    Predictions predictions;
    PlanInTime plan;
    Judge judge;
    double reasons[20][2];  // of the last decision; written, and never read
};
FG_RECORD(DrivingMemory, limiter, recovery, guidance, lead, knows_speed, speedometer, velocity_frame, predictions, plan,
          judge, reasons);

// Type of the reference of a planner for one scan.
struct Reference {
    double steering_angle;  // [rad]; NaN: there is no reference, and the car brakes
    double speed;  // [m/s] greatest
    double bearing;  // [rad] of the goal; NaN: there is none
    double distance;  // [m] of the goal from the LiDAR; of one on a line, from the rear axle
    std::int64_t point;  // of the planner's line through the map, which is nearest to the rear axle
    double off_line;  // [m] of the rear axle from there
    double own_speed;  // [m/s] before any speed law
    std::int64_t plan;  // of the tracker mpc, by which it is: 0 this tick's, 1 the last one, 2 none: the car brakes
    double limit;  // [m/s] greatest, whatever guidance makes of the rest; inf: none
    double lane[20][4];  // motion beside another car, which guidance leaves, as in `tracking`
    std::int64_t lane_points;  // of the lane; 0: there is none
};
FG_RECORD(Reference, steering_angle, speed, bearing, distance, point, off_line, own_speed, plan, limit, lane,
          lane_points);

// Type of all that the stages read and keep of one world.
struct TickRecord {
    Driver driver;
    ScanGeometry geometry;  // of this tick; from guidance on in the velocity frame, see slip,
    Odometry odometry;  // of a car whose tires need slip angles
    Reference reference;
    DrivingMemory memory;
    bool decided;  // there is a command for this tick
};
FG_RECORD(TickRecord, driver, geometry, odometry, reference, memory, decided);

// Write the reference that leads to a goal, along an arc or by the goal's bearing.
//   filtered  readings as the planner left them (n,) [m], for the mean range towards the goal
//   bearing   of the goal [rad]; NaN: there is none
//   distance  of the goal from the LiDAR [m]
void refer_to_goal(TickRecord& tick, Numbers filtered, double bearing, double distance);

// Write a reference, no faster than by the law of the mean range; arguments as in `refer_to_goal` and Reference.
void refer(TickRecord& tick, Numbers filtered, double steering_angle, double speed, double bearing, double distance);

}  // namespace fg
