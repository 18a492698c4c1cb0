// The plan in time: among things that move, motions of the car are judged by where everything is when.
#pragma once
#include <array>
#include <cstdint>
#include <iterator>
#include <tuple>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "rollout.hpp"

namespace fg {

// What a plan says: no motion passed, a steering angle and a speed, or that the car backs off.
inline constexpr std::int64_t no_plan = 0, plan_drives = 1, plan_backs_off = 2;

inline constexpr double backing_speed = 1.0;  // [m/s]

// Type of what is kept from tick to tick; zero at the beginning.
struct PlanInTime {
    std::int64_t tick;
    std::int64_t kept;  // tick of the last plan, through this place in the frame of the targets:
    double x;           // [m]
    double y;           // [m]
    double waited;      // [s] for which the car has been slow
    double backed;      // [m] that it has backed off since it last drove
};
FG_RECORD(PlanInTime, tick, kept, x, y, waited, backed);

// Return whether a target is so near that the car plans in time; `rows` are predictions (k, 12).
bool is_among(Matrix rows);

// Return what to do, plan_drives and so on, and the steering angle [rad] and the speed [m/s] of a car that drives.
// Arguments: the LiDAR's x, y [m] and heading [rad] in the frame of the targets; bearing of the reference's goal from
// the LiDAR [rad], and its distance [m]; speed [m/s] at which the car would go on; whether it stands, and may reverse.
std::tuple<std::int64_t, double, double> plan_in_time(const Situation& here, PlanInTime& plan,
                                                      std::array<double, 3> pose, std::array<double, 2> goal,
                                                      double onwards, bool may_back_off);

// -- parts of it, which tests look at

inline constexpr int path_length = 56;  // points
inline constexpr int span_steps = 53;   // of a motion, and those that a car waits at its end

// The car drives at a share of the onward speed for a time [s], and at another one; then it brakes.
struct Profile {
    double share, time, next_share, next_time;
};
inline constexpr Profile profiles[] = {
    {0.0, 0.0, 0.0, 0.0}, {1.0, 0.4, 0.0, 0.0}, {1.0, 0.8, 0.0, 0.0}, {1.0, 1.2, 0.0, 0.0},
    {1.0, 1.8, 0.0, 0.0}, {0.5, 0.6, 0.0, 0.0}, {0.5, 1.2, 0.0, 0.0}, {0.15, 0.5, 0.0, 0.0},
    {0.0, 0.3, 1.0, 0.8}, {0.0, 0.6, 1.0, 0.8}, {0.5, 0.5, 1.0, 0.8}, {0.2, 1.0, 1.0, 0.8},
};
inline constexpr int profile_count = std::size(profiles);

// Where the rear axle is on a path.
struct PathPoint {
    double x, y;       // [m]
    double cos, sin;   // of the heading
    double curvature;  // [1/m]
    double turning;    // share of the lateral grip that turning the wheels takes
};

// What the motions of a tick have in common.
struct Among {
    Situation here;
    std::array<double, 2> goal;  // [m] ahead of the LiDAR and to its left
    double onwards;              // [m/s] at which the car would go on
    double room;                 // [m] of way to where the car may only pass
    double servo;                // share of the limiter's rate of turning with which the wheels turn
    Matrix spans;                // of targets, see `spans_of`
    Numbers reaches;             // [m] of targets (k,), see `reaches_of`
    double may_turn;             // worth [m] that a motion touches nothing that turns back at once
};

// Return for each target (k,) how near its middle a disc of the car may come [m]; one that is nearer may leave.
// `bold` is as of `occupied`.
OwnRow<double> reaches_of(const CarParameters& car, Matrix rows, double bold);

// Return for each step and target (span_steps, 3 k) where it may be on its line [m]: from, to, and from if it turns back now.
OwnTable<double> spans_of(Matrix rows, double bold);

// Write the path of the rear axle through a place [m] and on to the goal; return how many of its points are free.
int lay_path(const Among& among, double to_x, double to_y, Row<PathPoint> path);

// Try a profile on a path, so many of whose points are free; `turns_now`: among targets that turn back now.
// Return the room beside targets [m], of a motion that touches something -1000 and more, the later and slower; and the
// way that counts [m].
std::array<double, 2> try_profile(const Among& among, Row<const PathPoint> path, int free, const Profile& profile,
                                  bool turns_now);

// Write the scores [m] of all profiles on a path; `free` is how many of its points are, `cost` its own [m].
void judge_path(const Among& among, Row<const PathPoint> path, int free, double cost, Row<double> scores);

}  // namespace fg
