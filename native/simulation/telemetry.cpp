// Of each row the first numbers are written when a tick begins, the others when its steps are done.
#include "telemetry.hpp"

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"
#include "../course/modulo.hpp"
#include "../vehicle/tire_slip.hpp"

namespace fg {

void begin_row(double time, Numbers qpos, Numbers qvel, Row<const Car> car, Row<const LapTimer> timers, std::int64_t i,
               TelemetryRow& row) {
    const LapTimer& timer = timers[i];
    row.time = time;
    row.lap = static_cast<double>(timer.laps_completed + 1), row.progress = timer.progress, row.offset = timer.offset;
    const auto [x, y, heading] = planar_pose(qpos, car);
    row.x = x, row.y = y, row.heading = heading;
    row.speed = ground_speed(qpos, qvel, car);
    row.yaw_rate = qvel[car[0].free_dof + 5], row.steering_angle = qpos[car[0].steering_qpos];
    const auto [vx, vy] = body_velocity(qpos, qvel, car);
    row.vx = vx, row.vy = vy, row.sideslip = sideslip_angle(vx, vy, row.yaw_rate, car);
}

void end_motion(double time, Numbers qpos, Numbers qvel, Row<const Car> car, TelemetryRow& row) {
    const double lever = car[0].rear_axle_distance;
    const auto [vx, vy] = body_velocity(qpos, qvel, car);
    const double heading = planar_pose(qpos, car)[2];
    const double half = 0.5 * (modulo(heading - row.heading + pi, 2.0 * pi) - pi);  // of the turn in the tick
    const double ahead = fg::cos(half), left = fg::sin(half);
    // Both velocities of the centre of gravity in the axes half-way: the one turns back by half, the other on.
    const double x0 = row.vx, y0 = row.vy + row.yaw_rate * lever;
    const double x1 = vx, y1 = vy + qvel[car[0].free_dof + 5] * lever;
    const double lasted = time - row.time;
    if (!(lasted > 0.0)) {  // MuJoCo has reset an unstable state by itself
        row.ax = row.ay = nan;
        return;
    }
    row.ax = ((x1 - x0) * ahead - (y1 + y0) * left) / lasted;
    row.ay = ((y1 - y0) * ahead + (x1 + x0) * left) / lasted;
}

void end_row(TelemetryRow& row, Cube<const double> slip) {
    double greatest[8];
    row.sliding_steps = static_cast<double>(greatest_slip(slip, fg::row(greatest)));
    row.steps = static_cast<double>(slip.rows);
    for (int tire = 0; tire < 4; ++tire) {
        row.slide[tire] = greatest[tire], row.friction_utilisation[tire] = greatest[4 + tire];
        row.load[tire] = slip[quantity::normal_force][0][tire];
        row.force_x[tire] = slip[quantity::force_x][0][tire];
        row.force_y[tire] = slip[quantity::force_y][0][tire];
        row.slip_angle[tire] = slip[quantity::slip_angle][0][tire];
        row.slip_ratio[tire] = slip[quantity::slip_ratio][0][tire];
    }
}

void add_row(Row<Statistics> statistics, std::int64_t i, const TelemetryRow& row, Cube<const double> slip) {
    Statistics& so_far = statistics[i];
    so_far.ticks += 1;
    so_far.steps += slip.rows;
    so_far.sliding_steps += whole(row.sliding_steps);
    for (int tire = 0; tire < 4; ++tire) {
        if (row.slide[tire] > so_far.max_slide)
            so_far.max_slide = row.slide[tire];
        else if (std::isnan(row.slide[tire]) && slip[quantity::normal_force][0][tire] > 0.0)  // on the ground, no peak
            so_far.max_slide = so_far.max_lateral_slide = nan;
    }
    so_far.max_lateral_slide = greatest_lateral_speed(slip, so_far.max_lateral_slide);
    so_far.speed_sum += std::abs(row.speed);
    so_far.max_speed = max(so_far.max_speed, std::abs(row.speed));
}

}  // namespace fg
