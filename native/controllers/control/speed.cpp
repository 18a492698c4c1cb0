// Speed laws by what the scan shows.
#include "speed.hpp"

namespace fg {

double distance_ahead_speed(double distance, double safe, double full_speed, double top_speed) {
    if (!(distance > safe)) return 0.0;
    return top_speed * min(1.0, (distance - safe) / max(full_speed - safe, 1e-9));
}

double mean_range_speed(Numbers ranges, double lookahead, double gain, double top_speed) {
    const int count = ranges.size();
    if (count == 0) return 0.0;
    double total = 0.0;
    for (int i = 0; i < count; ++i) total += min(ranges[i], lookahead);
    return top_speed * min(1.0, gain * total / count / lookahead);
}

}  // namespace fg
