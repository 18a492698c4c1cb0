// For a grid of speeds and of shares of the grip used for turning, the trajectory of a car that turns with that share
// and brakes with what cornering leaves is computed once. With each scan the trajectories are looked up: one is free
// when each of its points is nearer than the reading in its direction.
#include "braking_trajectories.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double presents[braking_presents] = {-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0};
constexpr double turnings[braking_turnings] = {0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8};
constexpr double time_step = 0.01;  // [s] of the integration
constexpr int longest_stop = 2000;  // steps

// Return whether each point of a trajectory to `side` (1 left, -1 right) is nearer than the reading there.
bool is_free(Numbers widened, double angle_min, double angle_increment, double side, const float* bearings,
             const float* distances) {
    const double last = widened.size() - 1.0;
    for (int point = braking_points - 1; point >= 0; --point) {  // the far ones first: those are the ones that fail
        const double index = std::nearbyint((side * bearings[point] - angle_min) / angle_increment);
        const int beam = static_cast<int>(min(last, max(0.0, index)));
        if (!(widened[beam] > distances[point])) return false;
    }
    return true;
}

// Return the index in `presents` of what is nearest to a share.
int nearest_present(double share) {
    int best = 0;
    for (int i = 1; i < braking_presents; ++i)
        if (std::abs(presents[i] - share) < std::abs(presents[best] - share)) best = i;
    return best;
}

// Write x [m], y [m], heading [rad] and way [m] of the rear axle at each step of a stop; return how many steps. The
// car starts at `speed` [m/s] with the share `present` of the cornering grip in use and turns to the share `turning`
// once it has reacted.
int stop(const Limiter& limiter, const BrakingSettings& settings, double speed, double present, double turning,
         Table<double> trace) {
    const bool soft = limiter.slip.needs_slip_angle;
    const double tightest = fg::tan(lock_arc(limiter.slip, limiter.car)) / limiter.car.wheelbase;
    const double braking = min(settings.braking_share * limiter.lateral, limiter.braking);
    double curvature = min(max(present * limiter.lateral / (speed * speed), -tightest), tightest);
    double x = 0.0, y = 0.0, heading = 0.0, way = 0.0;
    const auto write = [&](int row) {
        const Row<double> here = trace[row];
        here[0] = x, here[1] = y, here[2] = heading, here[3] = way;
    };
    write(0);
    for (int step = 0; step < longest_stop; ++step) {
        if (step * time_step >= settings.reaction) {
            const double fast = max(speed, 0.1);
            const double wanted = min(turning * limiter.lateral / (fast * fast), tightest);
            double lag = limiter.yaw_lag;
            if (soft) lag += path_lag(limiter.slip, speed);
            curvature += (wanted - curvature) * (1.0 - fg::exp(-speed * time_step / lag));
            // below 1, or it never stops
            const double used = min(std::abs(curvature) * (speed * speed) / limiter.lateral, 0.999);
            double held = braking * longitudinal_share(limiter, used, true);
            if (soft) held = min(held, stable_share(limiter, 1.0, used, speed) * limiter.braking);
            speed = max(speed - held * time_step, 0.0);
        }
        const double distance = speed * time_step;
        heading += curvature * distance;
        x += distance * fg::cos(heading);
        y += distance * fg::sin(heading);
        way += distance;
        write(step + 1);
        if (speed == 0.0) return step + 1;
    }
    return longest_stop;
}

// Write where the LiDAR sees the disc over the car's front at points evenly spread over a stop and its margin: bearings
// [rad] and distances [m]. `trace` is that of `stop`.
void spread_points(const CarParameters& car, const BrakingSettings& settings, Matrix trace, Row<double> bearings,
                   Row<double> distances) {
    const double disc = car.length - car.rear_overhang - 0.25 * car.width;  // ahead of the rear axle
    const double margin = settings.margin + 0.25 * car.width;
    const double way = trace[trace.rows - 1][3];
    int step = 0;
    for (int point = 0; point < braking_points; ++point) {
        const double along = point * (way + margin) / (braking_points - 1);
        while (step < trace.rows - 2 && trace[step + 1][3] <= along) ++step;
        const Numbers before = trace[step], after = trace[step + 1];
        const double part =
            after[3] > before[3] ? min((along - before[3]) / (after[3] - before[3]), 1.0) : 1.0;
        double x = before[0] + part * (after[0] - before[0]);
        double y = before[1] + part * (after[1] - before[1]);
        const double heading = before[2] + part * (after[2] - before[2]);
        const double ahead = disc + max(along - way, 0.0);  // the margin is straight on from where the car stops
        x += ahead * fg::cos(heading) - car.lidar_offset;
        y += ahead * fg::sin(heading);
        bearings[point] = fg::atan2(y, x), distances[point] = fg::hypot(x, y);
    }
}

}  // namespace

double safe_speed(const Trajectories& trajectories, Numbers widened, double angle_min, double angle_increment,
                  double speed, double steering_angle) {
    const double share = speed * speed * fg::tan(steering_angle) / (trajectories.wheelbase * trajectories.lateral);
    if (widened.size() == 0) return 0.0;
    const int to_left = nearest_present(share), to_right = nearest_present(-share);
    for (int fast = static_cast<int>(trajectories.count) - 1; fast >= 0; --fast) {
        for (const int side : {1, -1}) {
            const int present = side == 1 ? to_left : to_right;
            for (int turning = 0; turning < braking_turnings; ++turning) {
                const float* const bearings = trajectories.bearings[present][fast][turning];
                const float* const distances = trajectories.distances[present][fast][turning];
                if (is_free(widened, angle_min, angle_increment, side, bearings, distances))
                    return trajectories.speeds[fast];
            }
        }
    }
    return 0.0;
}

void all_trajectories(const Limiter& limiter, const BrakingSettings& settings, Numbers speeds, Table<double> bearings,
                      Table<double> distances) {
    const OwnTable<double> trace(longest_stop + 1, 4);
    const Table<double> rows = trace;
    for (int present = 0; present < braking_presents; ++present) {
        for (int fast = 0; fast < speeds.size(); ++fast) {
            for (int turning = 0; turning < braking_turnings; ++turning) {
                const int steps =
                    stop(limiter, settings, speeds[fast], presents[present], turnings[turning], rows);
                const int row = (present * most_braking_speeds + fast) * braking_turnings + turning;
                spread_points(limiter.car, settings, {rows.data, steps + 1, 4}, bearings[row], distances[row]);
            }
        }
    }
}

}  // namespace fg
