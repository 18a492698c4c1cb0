// Moving targets in the scan: which things move, where they are and how fast, from the LiDAR and odometry alone.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"
#include "scan_geometry.hpp"

namespace fg {

struct Target {
    std::int64_t age;  // sightings; 0: there is none
    double ends[2][2];  // x and y [m] of the right and of the left end, where the planner's car began
    std::uint8_t own[2];  // whether each end belonged to the thing at the last sighting
    double radius;  // [m] of a disc that is seen under the same angle; 0 where an end is hidden
    double vx;  // [m/s]
    double vy;  // [m/s]
    double p_place;  // [m^2] covariance, the same in x and y
    double p_mixed;  // [m^2/s]
    double p_speed;  // [m^2/s^2]
    std::int64_t misfits;  // innovations in turn that were too great
    double against;  // sum of those against its velocity, in standard deviations
    double still;  // [s] for which it has not moved
    double unseen;  // [s]
    bool moves;
    double distance;  // [m] from the LiDAR at the last sighting
    double size;  // [m] greatest radius that was seen
    std::int64_t first;  // beam of the last sighting,
    std::int64_t end;  // and the one behind the last
    std::int64_t turns;  // times that it was seen to turn back
    double turned[2][2];  // x and y [m] of the last two places where it did
    double farthest[2];  // x and y [m] of the place that is farthest on its way since it turned
};
FG_RECORD(Target, age, ends, own, radius, vx, vy, p_place, p_mixed, p_speed, misfits, against, still, unseen, moves,
          distance, size, first, end, turns, turned, farthest);

struct Snapshot {
    double x;  // [m] of the LiDAR
    double y;  // [m]
    double heading;  // [rad]
    std::int64_t tick;  // when it was taken; 0: none is kept
    double turned;  // [rad] until then
    double doubt;  // [m] the same
    double noise;  // [m]
    std::uint16_t ranges[1081];  // [mm] least of each bin
};
FG_RECORD(Snapshot, x, y, heading, tick, turned, doubt, noise, ranges);

// Type of what is kept from tick to tick; zero at the beginning.
struct Targets {
    double x;  // [m] of the LiDAR, by dead reckoning from where it began
    double y;  // [m]
    double heading;  // [rad]
    double speed;  // [m/s] at the last scan: the mean of two is that of the time between them
    double yaw_rate;  // [rad/s]
    double turned;  // [rad] to either side
    double doubt;  // [m] by which the way may err
    double noise;  // [m] of the last scan's readings
    std::int64_t tick;
    std::int64_t beams;  // of the scans that are kept
    std::int64_t count;  // of targets that move
    Target targets[24];
    Snapshot snapshots[5];
};
FG_RECORD(Targets, x, y, heading, speed, yaw_rate, turned, doubt, noise, tick, beams, count, targets, snapshots);

struct Cluster {
    double ends[2][2];  // as of a target
    std::uint8_t own[2];
    double radius;  // [m] as of a target
    double distance;  // [m] least range
    double variance;  // [m^2] of an end
    std::int64_t first;  // beam
    std::int64_t end;  // and the one behind the last
    bool taken;
};

// Follow what is in a scan, and return how many targets move.
//
// ranges: readings (n,) [m], without NaN or inf; lidar_offset: of the LiDAR ahead of the rear axle [m]; course:
// direction in which the rear axle moves, from the car's heading [rad].
std::int64_t track_targets(Targets& memory, const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry,
                           double lidar_offset, double course);

}  // namespace fg
