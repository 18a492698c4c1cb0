// A planner's goal as a reference.
#include "driving.hpp"

#include "../../core/numbers.hpp"
#include "speed.hpp"
#include "steering.hpp"

namespace fg {

void refer_to_goal(TickRecord& tick, Numbers filtered, double bearing, double distance) {
    const DrivingSettings& settings = tick.driver.settings;
    const CarParameters& car = tick.driver.car;
    double steering_angle;
    if (settings.steering == steering_by_bearing) {
        steering_angle = saturate(bearing, car.max_steering_angle);
    } else {
        const double reach =
            min(distance, max(settings.pursuit_distance, settings.pursuit_time * tick.odometry.speed));
        steering_angle = pursue(bearing, reach, car.lidar_offset, car.wheelbase);
    }
    refer(tick, filtered, steering_angle, tick.driver.max_speed, bearing, distance);
}

void refer(TickRecord& tick, Numbers filtered, double steering_angle, double speed, double bearing, double distance) {
    const Driver& driver = tick.driver;
    Reference& reference = tick.reference;
    reference.steering_angle = steering_angle, reference.bearing = bearing, reference.distance = distance;
    reference.speed = reference.own_speed = min(speed, driver.max_speed);
    reference.limit = inf, reference.lane_points = 0, reference.plan = 0;
    if (std::isnan(bearing)) {
        reference.steering_angle = nan;
    } else if (driver.mean_range) {
        const DrivingSettings& settings = driver.settings;
        const ScanGeometry& geometry = tick.geometry;
        const int goal = whole(std::nearbyint((bearing - geometry.angle_min) / geometry.angle_increment));
        const int half = whole(std::nearbyint(0.5 * settings.front_width / geometry.angle_increment));
        const int behind = min(max(goal + half + 1, 0), filtered.size());
        const Numbers front = filtered.part(min(max(goal - half, 0), behind), behind);
        const double by_mean =
            mean_range_speed(front, settings.lookahead, settings.mean_range_gain, driver.max_speed);
        reference.speed = min(reference.speed, by_mean);
    }
}

}  // namespace fg
