#include "line_profile.hpp"

#include "../../controllers/control/slip.hpp"
#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

bool is_closed(Matrix line) { return line[line.rows - 1][line_step] > 0.0; }

// Return the point that is so many points further along the line, or before; at most the end of an open line.
std::int64_t moved_by(Matrix line, std::int64_t point, std::int64_t points) {
    const std::int64_t count = line.rows;
    if (!is_closed(line)) return min(max(point + points, std::int64_t{0}), count - 1);
    const std::int64_t rest = (point + points) % count;
    return rest < 0 ? rest + count : rest;
}

}  // namespace

// By a pass against the driving direction and one along it, twice round a closed line; at the end of an open one the
// car stands. Braking and accelerating have what cornering leaves (friction_limiter.longitudinal_share). Source: the
// field's forward-backward solver, as in TUM's trajectory planning helpers (A. Heilmeier et al., 2019).
void limit_speeds(Table<double> table, Numbers bend, const Limiter& limiter, double cornering_use, double braking_use) {
    const std::int64_t count = table.rows;
    const double step = table[0][line_step], grip = limiter.mu * limiter.car.gravity;
    const bool closed = is_closed(table);
    for (std::int64_t point = 0; point < count; ++point) {
        if (bend[point] == 0.0) continue;
        double corner = std::sqrt(cornering_use * limiter.lateral / std::abs(bend[point]));
        if (limiter.slip.needs_slip_angle) {
            const double arc = fg::atan(limiter.car.wheelbase * std::abs(bend[point]) / cornering_use);
            corner = min(corner, fastest_on(limiter.slip, arc, limiter.slip.least_speed));
        }
        table[point][line_speed] = min(table[point][line_speed], corner);
    }
    if (!closed) table[count - 1][line_speed] = 0.0;
    const std::int64_t rounds = closed ? 2 * count : count - 1;
    for (const int direction : {-1, 1}) {
        const bool braking = direction < 0;
        const double most = braking_use * (braking ? limiter.braking : limiter.accelerating);
        std::int64_t point = braking ? count - 1 : 0;
        for (std::int64_t i = 0; i < rounds; ++i) {
            const std::int64_t near = (point + direction + count) % count;
            if (braking || point > 0 || closed) {
                const double known = table[point][line_speed];
                const double share = longitudinal_share(limiter, known * known * std::abs(bend[point]) / grip, braking);
                const double reached = std::sqrt(known * known + 2.0 * most * share * step);
                table[near][line_speed] = min(table[near][line_speed], reached);
            }
            point = near;
        }
    }
}

std::int64_t next_point(Matrix line, std::int64_t point, int direction) { return moved_by(line, point, direction); }

std::int64_t moved_along(Matrix line, std::int64_t point, double distance) {
    const std::int64_t points = max(whole(std::nearbyint(std::abs(distance) / line[0][line_step])), 0);
    return moved_by(line, point, distance > 0.0 ? points : -points);
}

}  // namespace fg
