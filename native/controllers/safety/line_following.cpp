#include "line_following.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/slip.hpp"
#include "../control/steering.hpp"
#include "../control/tracking.hpp"
#include "line_optimizer.hpp"

namespace fg {
namespace {

// Shares of the limiter's cornering acceleration and of its braking; of tires that need slip angles, which answer late.
constexpr std::array<double, 2> uses{0.93, 0.85}, uses_when_late{0.9, 0.7};
constexpr double correction_use = 0.9;  // share of the limiter's cornering acceleration for coming back to the line
constexpr double turns_faster = 1.35;   // times the share of the grip for turning the wheels, on the line
constexpr double rate_use = 0.58;       // share of the limiter's steering rate; in the mean of a tick the servo has .59
constexpr double near_lock_from = 0.8;  // share of the curvature at full lock from which on the car is slower, as it
                                        // hardly can correct
constexpr double slower = 0.5;          // share by which the squared speed is less at full lock
constexpr double lookahead = 0.1;       // [s] for which the speed is read ahead
constexpr double length_at_rest = 0.35, length_time = 0.15;  // [m] and [s]: over which the distance from the line falls
constexpr double on_it = 0.06;      // [m] to the side of the line from which on the car is slower,
constexpr double slower_off = 1.5;  // [1/m] by this share for each metre

// Return the whole turns that are nearest to an angle [rad]; never -0.
double whole_turns(double angle) { return 2.0 * pi * (std::nearbyint(angle / (2.0 * pi)) + 0.0); }

// Return the share of what cornering leaves for turning the wheels, of a car on the line: it turns them faster.
double turn_in_use(const Limiter& limiter) {
    const double own = limiter.settings.turn_in_use;
    return limiter.slip.needs_slip_angle ? own : min(turns_faster * own, 1.0);
}

}  // namespace

std::array<double, 2> uses_on(const Limiter& limiter) { return limiter.slip.needs_slip_angle ? uses_when_late : uses; }

std::array<double, 2> on_line(const Limiter& limiter) {
    const double in_braking = limiter.slip.needs_slip_angle ? limiter.settings.lateral_use_in_braking : 1.0;
    return {turn_in_use(limiter), in_braking};
}

double turning_use(const Limiter& limiter) { return rate_use * turn_in_use(limiter); }

void describe_line(Line& line, const Limiter& limiter) {
    const int n = static_cast<int>(line.count);
    const Table<float> points = table(line.points), described = table(line.described);
    const double spacing = line.spacing, share = turning_use(limiter), lateral_use = uses_on(limiter)[0];
    const OwnRow<double> bends(n);
    for (int k = 0; k < n; ++k) {
        const Row<float> before = points[k > 0 ? k - 1 : n - 1], here = points[k];
        const Row<float> after = points[k + 1 < n ? k + 1 : 0];
        const float to_x = here[0] - before[0], to_y = here[1] - before[1];
        const float on_x = after[0] - here[0], on_y = after[1] - here[1];
        const float dx = to_x + on_x, dy = to_y + on_y;  // all this in single precision
        bends[k] = (to_x * on_y - to_y * on_x) / (spacing * spacing * 0.5 * max(fg::hypot(dx, dy), 1e-9));
        described[k][0] = fg::atan2(dy, dx);
    }
    average(bends);
    const CarParameters& car = limiter.car;
    const double tightest = fg::tan(lock_arc(limiter.slip, car)) / car.wheelbase;
    const double rear_lag = car.yaw_inertia / (car.mass * car.front_axle_distance);
    for (int k = 0; k < n; ++k) {
        const double bend = std::abs(bends[k]);
        const double growth = (bends[k + 1 < n ? k + 1 : 0] - bends[k > 0 ? k - 1 : n - 1]) / (2.0 * spacing);
        const double change = std::abs(growth);
        const bool inwards = bends[k] * growth > 0.0;
        double most = max(bend / lateral_use, limiter.yaw_lag * change / (share * limiter.settings.most_left));
        if (inwards)  // the limiter turns the wheels in with a share of what cornering leaves
            most = max(most, limiter.yaw_lag * change / share + bend);
        const double near_lock = min(max((bend / tightest - near_lock_from) / (1.0 - near_lock_from), 0.0), 1.0);
        described[k][1] = static_cast<float>(bends[k]);
        described[k][2] = static_cast<float>((1.0 - slower * near_lock) / max(most, 1e-3));
        described[k][3] = static_cast<float>(bend + (inwards ? limiter.yaw_lag : 2.0 * rear_lag) * change);
    }
}

OwnTable<double> line_ahead(const Line& line, std::int64_t first, double x, double y, double heading,
                            const Limiter& limiter) {
    OwnTable<double> window(window_points, window_columns);
    const double cos = fg::cos(heading), sin = fg::sin(heading);
    for (int k = 0; k < window_points; ++k) {
        const Row<double> row = window[k];
        const std::int64_t at = (first - 1 + k + line.count) % line.count;
        const Row<const float> described = table(line.described)[at];
        const double dx = line.points[at][0] - x, dy = line.points[at][1] - y, turn = described[0] - heading;
        row[motion_x] = cos * dx + sin * dy, row[motion_y] = cos * dy - sin * dx;
        row[motion_heading] = turn - whole_turns(turn);
        row[motion_curvature] = described[1], row[window_radius] = described[2], row[window_demand] = described[3];
    }
    write_speeds(window, line.spacing, limiter);
    return window;
}

void write_speeds(Table<double> window, double spacing, const Limiter& limiter) {
    const double grip = limiter.mu * limiter.car.gravity, braking = uses_on(limiter)[1] * limiter.braking;
    double square = inf, demand = 0.0;
    for (int k = static_cast<int>(window.rows) - 1; k >= 0; --k) {
        const Row<double> row = window[k];
        const double corner = limiter.lateral * row[window_radius];
        if (square < corner) {
            const double used = square * demand / grip;
            double share = longitudinal_share(limiter, used, true);
            if (limiter.slip.needs_slip_angle) share = stable_share(limiter, share, used, std::sqrt(square));
            square += 2.0 * braking * share * spacing;
        }
        square = min(square, corner);
        row[motion_speed] = std::sqrt(square), demand = row[window_demand];
    }
}

std::array<double, 3> position_on(Matrix window, std::int64_t point, double spacing) {
    const Numbers before = window[point - 1], after = window[point];
    const double left =
        fg::cos(after[motion_heading]) * after[motion_x] + fg::sin(after[motion_heading]) * after[motion_y];
    const double share = min(max(1.0 - left / spacing, 0.0), 1.0);
    double turn = after[motion_heading] - before[motion_heading];
    turn -= whole_turns(turn);
    const double direction = before[motion_heading] + share * turn;
    const double dx = before[motion_x] + share * (after[motion_x] - before[motion_x]);
    const double dy = before[motion_y] + share * (after[motion_y] - before[motion_y]);
    double aside = fg::sin(direction) * dx - fg::cos(direction) * dy;
    aside += 0.5 * share * (1.0 - share) * spacing * turn;  // from the chord to the arc
    return {static_cast<double>(point - 1) + share, aside, whole_turns(direction) - direction};
}

double curvature_at(Matrix window, double position) {
    const std::int64_t last = window.rows - 1;
    if (position >= last) return window[last][motion_curvature];
    const int at = max(whole(position), 0);
    const double share = position - at;
    return (1.0 - share) * window[at][motion_curvature] + share * window[at + 1][motion_curvature];
}

double speed_on(Matrix window, double position, double spacing, double now) {
    double best = inf;
    for (const double each : {position, position + lookahead * max(now, 0.0) / spacing}) {
        const int at = max(min(whole(each), static_cast<int>(window.rows) - 2), 0);
        const double share = min(each - at, 1.0);
        const double here = window[at][motion_speed], ahead = window[at + 1][motion_speed];
        best = min(best, (1.0 - share) * (here * here) + share * (ahead * ahead));
    }
    return std::sqrt(best);
}

std::array<double, 3> reference_on(Matrix window, double position, double aside, double turned, double spacing,
                                   const Limiter& limiter, double now, bool follows) {
    const CarParameters& car = limiter.car;
    double speed = speed_on(window, position, spacing, now);
    const double length = length_at_rest + length_time * max(now, 0.0);
    const double ahead = curvature_at(window, position + (steering_lag + late_by(car)) * max(now, 0.0) / spacing);
    const double steering =
        fg::atan(car.wheelbase * (ahead - aside / (length * length) - 2.0 * fg::sin(turned) / length));
    const double wanted = std::abs(fg::tan(steering)) / car.wheelbase;
    if (follows && std::abs(aside) > off_the_line)
        speed = min(speed, std::sqrt(correction_use * limiter.lateral / max(wanted, 1e-3)));
    speed *= 1.0 - slower_off * min(max(std::abs(aside) - on_it, 0.0), leaves_line);
    const double held = correction_use * (limiter.lateral / max(now * now, 0.5));
    const double most = fg::atan(car.wheelbase * max(std::abs(curvature_at(window, position)), held));
    return {saturate(steering, most), speed, most};
}

}  // namespace fg
