// Segments that are further away than the nearest so far are skipped by circles round them and the rectangle.
#include "clearance.hpp"

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"

namespace fg {
namespace {

// Return the lesser of `least` and the distance to segments (m, 4) at one pose (3,).
double nearer(double least, Numbers pose, Matrix segments, double ahead, double half_length, double half_width) {
    const double reach = fg::hypot(half_length, half_width);
    const double cosine = fg::cos(pose[2]), sine = fg::sin(pose[2]);
    const double x = pose[0] + ahead * cosine, y = pose[1] + ahead * sine;
    for (std::int64_t j = 0; j < segments.rows; ++j) {
        const Numbers segment = segments[j];
        const double from_x = segment[0] - x, from_y = segment[1] - y;
        const double to_x = segment[2] - x, to_y = segment[3] - y;
        const double far = least + reach + 0.5 * fg::hypot(to_x - from_x, to_y - from_y);
        const double middle_x = 0.5 * (from_x + to_x), middle_y = 0.5 * (from_y + to_y);
        if (middle_x * middle_x + middle_y * middle_y > far * far) continue;
        const double distance = rectangle_distance(from_x * cosine + from_y * sine, from_y * cosine - from_x * sine,
                                                   to_x * cosine + to_y * sine, to_y * cosine - to_x * sine,
                                                   half_length, half_width);
        least = min(least, distance);
    }
    return least;
}

}  // namespace

double rectangle_distance(double ax, double ay, double bx, double by, double half_length, double half_width) {
    const double along_x = bx - ax, along_y = by - ay;
    // The part of the segment, from share `first` to share `last`, that is inside both strips (Liang and Barsky).
    double first = 0.0, last = 1.0;
    const double strips[2][3] = {{ax, along_x, half_length}, {ay, along_y, half_width}};
    for (const auto& [start, step, half] : strips) {
        if (step == 0.0) {
            if (std::abs(start) > half) last = -1.0;
        } else {
            const double enter = (-half - start) / step, leave = (half - start) / step;
            first = max(first, min(enter, leave));
            last = min(last, max(enter, leave));
        }
    }
    if (first <= last) return 0.0;
    double squared = inf;
    const double ends[2][2] = {{ax, ay}, {bx, by}};
    for (const auto& [x, y] : ends) {
        const double away_x = max(std::abs(x) - half_length, 0.0), away_y = max(std::abs(y) - half_width, 0.0);
        squared = min(squared, away_x * away_x + away_y * away_y);
    }
    const double length_squared = along_x * along_x + along_y * along_y;
    if (length_squared > 0.0) {
        const double corners[4][2] = {
            {half_length, half_width}, {-half_length, half_width},
            {-half_length, -half_width}, {half_length, -half_width},
        };
        for (const auto& [x, y] : corners) {
            const double share = min(max(((x - ax) * along_x + (y - ay) * along_y) / length_squared, 0.0), 1.0);
            const double away_x = ax + share * along_x - x, away_y = ay + share * along_y - y;
            squared = min(squared, away_x * away_x + away_y * away_y);
        }
    }
    return std::sqrt(squared);
}

double least_clearance(Matrix poses, Cube<const double> segments, double ahead, double half_length,
                       double half_width) {
    double least = inf;
    for (std::int64_t i = 0; i < poses.rows; ++i)
        least = nearer(least, poses[i], segments[i % segments.length], ahead, half_length, half_width);
    return least;
}

void clearances(Matrix poses, Cube<const double> segments, double ahead, double half_length, double half_width,
                Row<double> found) {
    for (std::int64_t i = 0; i < poses.rows; ++i)
        found[i] = nearer(inf, poses[i], segments[i % segments.length], ahead, half_length, half_width);
}

}  // namespace fg
