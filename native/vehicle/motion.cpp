#include "motion.hpp"

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"

namespace fg {
namespace {

const double least_upright = fg::cos(80.0 * (pi / 180.0));
constexpr double sideslip_speed = 0.1;  // [m/s]

}  // namespace

std::array<double, 3> planar_pose(Numbers qpos, Row<const Car> car) {
    const auto i = car[0].free_qpos;
    const double qw = qpos[i + 3], qx = qpos[i + 4], qy = qpos[i + 5], qz = qpos[i + 6];
    const double heading = fg::atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz));
    return {qpos[i], qpos[i + 1], heading};
}

double uprightness(Numbers qpos, Row<const Car> car) {
    const auto i = car[0].free_qpos;
    return 1.0 - 2.0 * (qpos[i + 4] * qpos[i + 4] + qpos[i + 5] * qpos[i + 5]);
}

bool is_rolled_over(Numbers qpos, Row<const Car> car) { return uprightness(qpos, car) < least_upright; }

double ground_speed(Numbers qpos, Numbers qvel, Row<const Car> car) {
    const double heading = planar_pose(qpos, car)[2];
    const auto i = car[0].free_dof;
    return qvel[i] * fg::cos(heading) + qvel[i + 1] * fg::sin(heading);
}

double surface_speed(Numbers qvel, Row<const Car> car) {
    double total = 0.0;
    const auto [first, end] = car[0].driven;
    for (std::int64_t wheel = first; wheel < end; ++wheel) total += qvel[car[0].wheel_dofs[wheel]];
    return total / static_cast<double>(end - first) * car[0].wheel_radius;
}

void read_odometry(double time, Numbers qpos, Numbers qvel, Numbers sensordata, Row<const Car> car,
                   Row<Odometry> odometry) {
    const Car& constants = car[0];
    Odometry& row = odometry[0];
    row.stamp = time;
    row.speed = surface_speed(qvel, car);
    row.steering_angle = qpos[constants.steering_qpos];
    for (int axis = 0; axis < 3; ++axis) {
        row.angular_velocity[axis] = qvel[constants.free_dof + 3 + axis];
        row.linear_acceleration[axis] = sensordata[constants.accelerometer + axis];
    }
    for (int wheel = 0; wheel < 4; ++wheel)
        row.wheel_speeds[wheel] = qvel[constants.wheel_dofs[wheel]] * constants.wheel_radius;
    const auto pose = planar_pose(qpos, car);
    for (int k = 0; k < 3; ++k) row.pose[k] = pose[k];
}

std::array<double, 2> body_velocity(Numbers qpos, Numbers qvel, Row<const Car> car) {
    const double heading = planar_pose(qpos, car)[2];
    const auto i = car[0].free_dof;
    const double ahead = fg::cos(heading), left = fg::sin(heading);
    return {qvel[i] * ahead + qvel[i + 1] * left, qvel[i + 1] * ahead - qvel[i] * left};
}

void read_motions(Row<const bool> which, std::int64_t cars_per_world, Matrix states, std::int64_t first_qpos,
                  std::int64_t first_qvel, Row<const Car> cars, Table<double> poses, Table<double> velocities) {
    for (int row = 0; row < which.size(); ++row) {
        if (!which[row]) continue;
        const Numbers state = states[row / cars_per_world];
        const Row<const Car> car = cars.part(row, row + 1);
        const Numbers qpos = state.part(first_qpos, state.length), qvel = state.part(first_qvel, state.length);
        const auto pose = planar_pose(qpos, car);
        for (int k = 0; k < 3; ++k) poses[row][k] = pose[k];
        const auto [ahead, left] = body_velocity(qpos, qvel, car);
        velocities[row][0] = ahead, velocities[row][1] = left;
        velocities[row][2] = qvel[car[0].free_dof + 5];
    }
}

std::array<double, 6> point_motion(Numbers qpos, Numbers qvel, double ahead, Row<const Car> car) {
    const auto [x, y, heading] = planar_pose(qpos, car);
    const auto i = car[0].free_dof;
    const double cos = fg::cos(heading), sin = fg::sin(heading);
    const double east = qvel[i], north = qvel[i + 1], yaw_rate = qvel[i + 5];
    const double left = north * cos - east * sin + ahead * yaw_rate;
    return {x + ahead * cos, y + ahead * sin, heading, east * cos + north * sin, left, yaw_rate};
}

double sideslip_angle(double vx, double vy, double yaw_rate, Row<const Car> car) {
    const double left = vy + yaw_rate * car[0].rear_axle_distance;
    if (fg::hypot(vx, left) < sideslip_speed) return nan;
    return fg::atan2(left, vx);
}

void drive(double steering_angle, double speed, Row<const Car> car, Row<double> ctrl) {
    const Car& limits = car[0];
    const double most = limits.max_steering_angle;
    ctrl[limits.steering_ctrl] = min(max(steering_angle, -most), most);
    ctrl[limits.speed_ctrl] = min(max(speed, limits.min_speed), limits.max_speed);
}

}  // namespace fg
