// Bearings of a scan's beams: every world of a batch has the same geometry.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../../core/records.hpp"

namespace fg {

// Type of a row with the geometry of the scans; units as in LaserScan.
struct ScanGeometry {
    double angle_min;
    double angle_increment;
    double range_max;
    double scan_time;
};
FG_RECORD(ScanGeometry, angle_min, angle_increment, range_max, scan_time);

// Return whether there is a scan to plan with: two beams or more, not all zero, a sensible angle between them.
bool sees(const ScanGeometry& geometry, Numbers ranges);

// Return whether a scan of so many beams has some to both sides of straight ahead.
inline bool looks_ahead(const ScanGeometry& geometry, std::int64_t count) {
    return geometry.angle_min < 0.0 &&
           0.0 < geometry.angle_min + geometry.angle_increment * static_cast<double>(count - 1);
}

// Return the bearing of a beam [rad]; a fraction is a position between two beams.
inline double bearing_of(const ScanGeometry& geometry, double beam) {
    return geometry.angle_min + geometry.angle_increment * beam;
}

// Return the bearings of the beams from `first` to before `end` [rad].
OwnRow<double> bearings_of(const ScanGeometry& geometry, std::int64_t first, std::int64_t end);

// Return the number of the beam whose bearing is nearest to that of a point; below 0 or beyond the last: no beam.
//
// That is the arctangent, rounded, to the bit, in a quarter of the time. A polynomial gives the bearing to 2e-6 rad
// (C. Hastings, Approximations for Digital Computers, 1955), which is enough except halfway between two beams.
inline double nearest_beam(double angle_min, double angle_increment, double ahead, double left) {
    const double along = std::abs(ahead), aside = std::abs(left);
    const double q = min(along, aside) / (max(along, aside) + 1e-300);
    const double s = q * q;
    double bearing =
        q * (0.99997726 +
             s * (-0.33262347 + s * (0.19354346 + s * (-0.11643287 + s * (0.05265332 + s * -0.01172120)))));
    bearing = aside > along ? 0.5 * pi - bearing : bearing;
    bearing = ahead < 0.0 ? pi - bearing : bearing;
    const double beam = (std::copysign(bearing, left) - angle_min) / angle_increment;
    const double nearest = std::rint(beam);
    if (std::abs(beam - nearest) < 0.5 - 3e-6 / angle_increment) return nearest;
    return std::rint((fg::atan2(left, ahead) - angle_min) / angle_increment);
}

// Return the beams with bearings from `right` to `left` [rad], of so many: first, and last + 1.
std::array<std::int64_t, 2> beams_between(const ScanGeometry& geometry, std::int64_t count, double right, double left);

// Return the time between commands [s].
inline double period_of(const ScanGeometry& geometry) {
    constexpr double period = 0.025;  // [s] for scans that do not tell theirs
    return geometry.scan_time > 0.0 ? geometry.scan_time : period;
}

}  // namespace fg
