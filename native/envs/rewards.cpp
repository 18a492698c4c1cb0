// Rewards of a tick, and the numbers that go in and out of a policy.
#include "rewards.hpp"

#include "../core/numbers.hpp"

namespace fg {

std::int64_t read_actions(Matrix actions, Row<const bool> taken, Matrix limits, double share, Matrix planned,
                          double slow, Cube<double> targets, Table<double> held_before, Table<double> commands,
                          Row<std::int64_t> clipped) {
    for (std::int64_t i = 0; i < actions.rows; ++i)
        for (int part = 0; part < 2; ++part)
            if (taken[i] && std::isnan(actions[i][part])) return 2 * i + part;
    for (std::int64_t i = 0; i < actions.rows; ++i) {
        if (!taken[i]) continue;
        bool differs = false;
        for (int part = 0; part < 2; ++part) {
            const double given = actions[i][part], least = limits[5][part], greatest = limits[6][part];
            const double held = min(max(given, limits[0][part]), limits[1][part]);
            differs = differs || held != given;
            held_before[i][part] = held;
            double asked = limits[2][part] + limits[3][part] * held;
            double &target = targets[0][i][part], &command = targets[1][i][part];
            if (limits[4][part] > 0.0) asked = min(max(target + limits[4][part] * asked, least), greatest);
            if (planned.rows > 0) {
                if (slow > 0.0 && planned[i][1] < slow) asked *= max(planned[i][1], 0.0) / slow;
                asked = min(max(planned[i][part] + asked, least), greatest);
            }
            target = asked;
            if (share < 1.0) asked = command + share * (asked - command);
            command = commands[i][part] = asked;
        }
        clipped[i] += differs;
    }
    return -1;
}

void reward_ticks(Row<const bool> driven, Numbers progress, Row<double> before, Row<const bool> crashed,
                  Numbers sliding, Numbers impacts, Numbers weights, double share, bool alone, Row<double> rewards,
                  Cube<double> terms) {
    const Table<double> now = terms[0], sums = terms[1];
    for (std::int64_t i = 0; i < driven.length; ++i) {
        if (!driven[i]) continue;
        const double made = weights[0] * (progress[i] - before[i]);
        double slid = weights[2] * sliding[i];
        if (alone && slid > 0.0 && share < inf) slid = min(slid, share * max(made, 0.0));
        double reward = made - slid;
        now[0][i] = made, now[1][i] = 0.0, now[2][i] = 0.0 - slid, now[3][i] = 0.0;
        if (crashed[i]) {
            now[1][i] = -weights[1], now[3][i] = 0.0 - weights[3] * impacts[i];
            reward = reward + now[1][i] + now[3][i];
        }
        rewards[i] = reward;
        before[i] = progress[i];
        if (alone)
            for (int term = 0; term < 4; ++term) sums[term][i] += now[term][i];
    }
}

std::int64_t sum_terms(Row<const bool> driven, Row<const bool> running, double share, Row<double> rewards,
                       Cube<double> terms) {
    const Table<double> now = terms[0], sums = terms[1];
    const std::int64_t count = driven.length;
    for (std::int64_t term = 4; term < running.length; ++term) {
        for (std::int64_t i = 0; i < count; ++i) {
            if (!driven[i]) now[term][i] = 0.0;
            else if (!std::isfinite(now[term][i])) return term * count + i;
        }
    }
    for (std::int64_t i = 0; i < count; ++i) {
        if (!driven[i]) continue;
        double gain = 0.0, cost = 0.0;
        for (std::int64_t term = 0; term < running.length; ++term) {
            const double value = now[term][i];
            if (running[term]) cost -= min(value, 0.0);
            else gain += max(value, 0.0);
        }
        const double bound = share < inf ? share * gain : cost;
        for (std::int64_t term = 0; term < running.length; ++term) {
            double& value = now[term][i];
            if (cost > bound && running[term] && value < 0.0) value = value / cost * bound;
            sums[term][i] += value;
        }
        double reward = now[0][i] + now[2][i] + now[1][i] + now[3][i];  // in the order of `reward_ticks`
        for (std::int64_t term = 4; term < running.length; ++term) reward += now[term][i];
        rewards[i] = reward;
    }
    return -1;
}

void read_sensors(const SensorReadings& readings, const SensorParts& parts, Table<float> scan, Table<float> values) {
    const std::int64_t width = readings.odometry.columns;
    for (std::int64_t i = 0; i < scan.rows; ++i) {
        const std::int64_t row = i * readings.stride;
        const Row<float> seen = scan[i], own = values[i];
        for (std::int64_t beam = 0; beam < seen.length; ++beam) {
            const double distance = readings.ranges[row][parts.beams[beam]];
            // a NaN is not above 0
            seen[beam] = static_cast<float>(distance > 0.0 ? min(distance, parts.range_max) : 0.0);
        }
        for (std::int64_t k = 0; k < parts.columns.length; ++k) {
            const std::int64_t column = parts.columns[k];
            const double value = column < width       ? readings.odometry[row][column]
                                 : column < width + 2 ? readings.actions[i][column - width]
                                                      : readings.planned[i][column - width - 2];
            own[k] = static_cast<float>(min(max(static_cast<float>(value), parts.low[k]), parts.high[k]));
        }
    }
}

}  // namespace fg
