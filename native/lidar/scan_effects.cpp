// Models of the errors of a real LiDAR: normal noise, beams that fail, sweeps that come late, and tables of measured errors
// that are linear between their distances.
#include "scan_effects.hpp"

#include "../core/numbers.hpp"

namespace fg {
namespace {

// What a beam with measured errors reads at a distance [m]: noise and bias at that distance, then its failure.
double reading(const Effects& effects, std::int64_t row, int beam, double distance) {
    const std::int64_t table = effects.table_of[row];
    const Numbers knots = effects.knots[table];
    const std::int64_t first = (table * effects.noise.length + beam) * knots.length;
    if (knots.length > 0) check(first + knots.length - 1, effects.values.rows);
    const Matrix values{effects.values.data + first * 3, knots.length, 3};
    const double dropout = effects.dropouts[row];
    const double failure = dropout + (1.0 - dropout) * error_at(knots, values, 2, distance);
    if (effects.shares[beam] < failure) return nan;
    if (!(-inf < distance && distance < inf)) return distance;
    const double own = effects.deviations[row], measured = error_at(knots, values, 0, distance);
    const double deviation = std::sqrt(own * own + measured * measured);
    distance += error_at(knots, values, 1, distance) + deviation * effects.noise[beam];
    if (!(distance < effects.range_max)) return inf;
    return distance < effects.range_min ? -inf : distance;
}

// What a beam without measured errors reads at a distance [m].
double plain_reading(const Effects& effects, std::int64_t row, int beam, double distance) {
    const double deviation = effects.deviations[row], dropout = effects.dropouts[row];
    if (deviation > 0.0) {
        distance += deviation * effects.noise[beam];
        if (!(distance < effects.range_max))
            distance = inf;
        else if (distance < effects.range_min)
            distance = -inf;
    }
    return dropout > 0.0 && effects.shares[beam] < dropout ? nan : distance;
}

// Hold a sweep's reading of a beam back; return the one that is due. Until one is old enough, that is the first one.
double delivered(const Effects& effects, std::int64_t row, int beam, double distance) {
    const Table<double> held = effects.held[row];
    const std::int64_t late = effects.lates[row], place = effects.sweeps[row] % late;
    if (effects.sweeps[row] == 0)
        for (std::int64_t other = 0; other < late; ++other) held[other][beam] = distance;
    const double due = held[place][beam];
    held[place][beam] = distance;
    return due;
}

}  // namespace

void apply_effects(const Effects& effects, Row<const std::int64_t> rows, Table<double> ranges) {
    for (int k = 0; k < rows.size(); ++k) {
        const std::int64_t row = rows[k];
        const bool has_table = effects.table_of[row] >= 0;
        if (has_table || effects.deviations[row] > 0.0)
            draw_normals(effects.states[row], effects.ziggurat, effects.noise);
        if (has_table || effects.dropouts[row] > 0.0) draw_shares(effects.states[row], effects.shares);
        const Row<double> readings = ranges[row];
        for (int beam = 0; beam < readings.size(); ++beam) {
            double distance = has_table ? reading(effects, row, beam, readings[beam])
                                        : plain_reading(effects, row, beam, readings[beam]);
            if (distance == inf) distance = effects.no_returns[row];
            if (effects.lates[row] > 0) distance = delivered(effects, row, beam, distance);
            readings[beam] = distance;
        }
        effects.sweeps[row] += 1;
    }
}

void add_noise(Numbers ranges, double deviation, double range_max, Row<double> noise) {
    for (int beam = 0; beam < noise.size(); ++beam)
        noise[beam] = min(max(ranges[beam] + deviation * noise[beam], 0.0), range_max);
}

double error_at(Numbers knots, Matrix values, int which, double distance) {
    int place = 0;
    while (place + 1 < knots.size() && knots[place + 1] <= distance && knots[place + 1] < inf) ++place;
    if (distance <= knots[place] || place + 1 >= knots.size() || knots[place + 1] == inf) return values[place][which];
    const double share = (distance - knots[place]) / (knots[place + 1] - knots[place]);
    return values[place][which] + share * (values[place + 1][which] - values[place][which]);
}

}  // namespace fg
