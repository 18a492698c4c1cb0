// Motion search: arcs that lead a car of its turning circle and speed through the local map to the frontier.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../control/planner_settings.hpp"
#include "../perception/frontiers.hpp"
#include "../perception/local_map.hpp"
#include "friction_limiter.hpp"

namespace fg {

inline constexpr int motion_direction = 4;        // column of a motion, after those of tracking
inline constexpr int motion_points = 64;          // at most
inline constexpr std::int64_t most_nodes = 6400;  // of all searches in a tick
inline constexpr double most_lock = 0.97;         // share of the curvature at full lock, where less leads nowhere
// Points of the outline that may lie in cells of walls, whose cells are thicker than they are.
inline constexpr std::int64_t most_in_walls = 7;

// Type of a motion: where the rear axle is after each arc.
struct Motion {
    bool found;  // it leads to the horizon or to the frontier
    std::int64_t count;
    double points[motion_points][5];  // x, y [m], heading [rad], curvature [1/m] up to there, 1 or -1: reverse
};
FG_RECORD(Motion, found, count, points);

// The motion that is searched for.
struct Query {
    double curvature;         // present [1/m]
    double speed;             // present [m/s]
    double lag;               // [s] for which the car drives on as it does
    double grip;              // share of the cornering acceleration that may be used
    double lock;              // share of the curvature at full lock that may be used
    double horizon;           // [m] by which the motion shortens the way to go
    std::int64_t nearest;     // nearness of walls from which on it is too near: within two cells, or one
    bool reverses;            // the car may drive in reverse, too
    std::int64_t most_nodes;  // after which the search ends; all searches of a tick have as many as above
};

// Ends of beams by the squares in which they lie.
struct Ends {
    static constexpr int squares = 20;  // to each side

    double points[720][2];             // [m] (n, 2)
    int first[squares * squares + 1];  // of each square, numbered along y first, and of the one after the last
    double left, low;                  // [m] where the squares begin
};

// Write the motion from where the car is that shortens the way to go by the horizon; return whether there is one.
// Where there is none, the motion leads to where the way to go is shortest.
bool search_motion(FrontierSearch& frontier, const Limiter& limiter, Motion& motion, const Query& query);

// Return whether three discs on the axis of a car at a place keep clear of walls.
bool is_clear(const FrontierSearch& frontier, const CarParameters& car, double x, double y, double cos, double sin,
              std::int64_t nearest);

// Return how many of 14 points of a car's outline lie in cells of walls, by its heading's cosine and sine.
std::int64_t outline_in_walls(const LocalMap& world, const CarParameters& car, double x, double y, double cos,
                              double sin);

// Return the first ends of beams by the squares in which they lie, for `touches`.
Ends sorted_ends(const LocalMap& world, std::int64_t count);

// Return whether an end of a beam lies in the outline of a car at a place, wider by a margin [m].
bool touches(const Ends& ends, const CarParameters& car, double x, double y, double cos, double sin, double margin);

}  // namespace fg
