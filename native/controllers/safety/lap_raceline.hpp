// Lap raceline: a line of short lap time through the ground of the first lap.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"
#include "../perception/lap_map.hpp"
#include "../perception/scan_geometry.hpp"
#include "friction_limiter.hpp"
#include "lap_trial.hpp"

namespace fg {

struct Driver;
struct Tick;

inline constexpr int line_points = 2048;  // of a line, at most

// Where the car is: the planner drives, the car is led to the line, or it follows the line.
inline constexpr std::int64_t line_away = 0, line_near = 1, line_on = 2;

// Type of a line, and of what is kept of it from tick to tick; zero at the beginning.
struct Line {
    std::int64_t step;  // of steps_of_a_line
    double weight;  // of that step
    std::int64_t failed;  // trials that failed
    bool ready;
    bool refused;  // it is too sharp, or there is none
    bool follows;  // the reference is that of the line
    std::int64_t next;  // index of the point that is next
    double until;  // `driven` until which the planner drives
    std::int64_t count;  // of points
    double spacing;  // [m]
    float points[2048][2];  // [m] evenly apart, once the line is ready
    float described[2048][4];  // heading [rad], curvature [1/m], window_radius and window_demand of line_following
    Trial trial;  // of a lap on it, on soft tires
};
FG_RECORD(Line, step, weight, failed, ready, refused, follows, next, until, count, spacing, points, described, trial);

// Type of all that is remembered: of the first lap, whether anything has moved, and the way [m] since.
struct Remembered {
    LapMap lap;
    Line line;
    bool moved;
    double still;
};
FG_RECORD(Remembered, lap, line, moved, still);

// How to follow the line.
struct LineProposal {
    std::int64_t state;       // line_away: there is no proposal; line_near or line_on
    OwnTable<double> points;  // (n, 5) of the line ahead, in the frame of the car, see motions.py
    double steering_angle;    // [rad] for now
    double speed;             // [m/s] for now
};

// Record the lap or find the car in it, and do a tick's part of the work on the line. Readings (n,) [m] are without NaN
// or inf.
void keep_lap(Remembered& remembered, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry,
              const Driver& driver);

// Move the points of the line once. The lap is closed; of the walls see `walls_of`.
void shape_line(Line& line, const LapMap& lap, Cube<const double> walls, const Limiter& limiter, double max_speed);

// Return how to follow the line from here, or to come to it; line_away: the car is not near it, or may not follow it.
// The car is to be so far to the left of the line [m].
LineProposal propose_line(Remembered& remembered, const Odometry& odometry, const Limiter& limiter, double shift);

// Keep the lap, and decide while the car is on its line: the work of the stage `remember` after guidance.
void remember(const Tick& tick, Remembered& remembered);

}  // namespace fg
