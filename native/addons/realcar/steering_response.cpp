#include "steering_response.hpp"

#include <cmath>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../../course/projection.hpp"

namespace fg {
namespace {

// Return the angle after some time; a servo with a greatest rate has a target that stays.
double turned(double angle, double target, double slope, double lag, double rate, double seconds) {
    double left = seconds;
    const double away = target - angle;
    if (slope == 0.0 && std::abs(away) > rate * lag) {
        const double turning = min(left, (std::abs(away) - rate * lag) / rate);
        angle += std::copysign(rate * turning, away);
        left -= turning;
    }
    if (lag == 0.0) return left > 0.0 ? target + slope * seconds : angle;
    const double end = target + slope * (seconds - lag);
    return end + (angle - target + slope * lag) * fg::exp(-left / lag);
}

}  // namespace

void follow_targets(const SteeringTargets& of, Numbers time, double lag, double rate, Row<double> out) {
    double now = time[0];
    std::int64_t piece = segment_at(of.knots, now);
    const auto target_at = [&](double when) { return of.targets[piece] + of.slopes[piece] * (when - of.knots[piece]); };
    double angle = target_at(now);
    for (std::int64_t i = 0; i < time.length; ++i) {
        while (now < time[i]) {
            const bool is_last = piece + 1 == of.knots.length;
            const double until = is_last ? time[i] : min(time[i], of.knots[piece + 1]);
            angle = turned(angle, target_at(now), of.slopes[piece], lag, rate, until - now);
            now = until;
            if (!is_last && now >= of.knots[piece + 1]) ++piece;
        }
        out[i] = angle;
    }
}

}  // namespace fg
