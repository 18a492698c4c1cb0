// Bearings of a scan's beams.
#include "scan_geometry.hpp"

namespace fg {
namespace {

constexpr double least_increment = 1e-9;  // [rad] below it, counts of beams overflow

// A number as a count of beams; what is too great for one, or NaN, is below all counts.
std::int64_t count_of(double beams) {
    return std::abs(beams) < 9e18 ? static_cast<std::int64_t>(beams) : -9'000'000'000'000'000'000;
}

}  // namespace

bool sees(const ScanGeometry& geometry, Numbers ranges) {
    const double increment = geometry.angle_increment;
    if (ranges.length < 2 || !(least_increment < increment && increment < 2.0 * pi)) return false;
    for (int beam = 0; beam < ranges.size(); ++beam)
        if (ranges[beam] > 0.0) return true;
    return false;
}

std::array<std::int64_t, 2> beams_between(const ScanGeometry& geometry, std::int64_t count, double right, double left) {
    const double angle_min = geometry.angle_min, increment = geometry.angle_increment;
    std::int64_t first = count_of(std::ceil((right - angle_min) / increment - 1e-6));
    const std::int64_t end = count_of(std::floor((left - angle_min) / increment + 1e-6)) + 1;
    first = min(max(first, std::int64_t{0}), count);
    return {first, min(max(end, first), count)};
}

OwnRow<double> bearings_of(const ScanGeometry& geometry, std::int64_t first, std::int64_t end) {
    OwnRow<double> result = OwnRow<double>::unset(end - first);
    for (std::int64_t beam = first; beam < end; ++beam)
        result[beam - first] = bearing_of(geometry, static_cast<double>(beam));
    return result;
}

}  // namespace fg
