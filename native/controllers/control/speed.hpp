// Speed laws: how fast the car may go, by what the scan shows and by what the tires hold.
#pragma once
#include "../../core/arrays.hpp"
#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {

// Return the greatest speed [m/s] at which the tires hold the car on the circle of `steering_angle` [rad].
inline double friction_speed(double steering_angle, double mu, double wheelbase, double gravity) {
    const double slope = fg::tan(std::abs(steering_angle));
    return slope > 0.0 ? std::sqrt(gravity * mu * wheelbase / slope) : inf;
}

// Return the greatest steering angle [rad] that the tires hold at `speed` [m/s]: `friction_speed` read back.
inline double friction_steering(double speed, double mu, double wheelbase, double gravity) {
    return fg::atan2(gravity * mu * wheelbase, speed * speed);
}

// Return the share of the way to its set point that a servo of first order comes in a time [s].
inline double share_of_way(double period, double time_constant) { return 1.0 - fg::exp(-period / time_constant); }

// Return a speed [m/s] by the distance straight ahead [m]: 0 below `safe`, `top_speed` beyond `full_speed`.
double distance_ahead_speed(double distance, double safe, double full_speed, double top_speed);

// Return a speed [m/s] by the mean of `ranges` (n,), none longer than the lookahead: slow where it is tight.
double mean_range_speed(Numbers ranges, double lookahead, double gain, double top_speed);

}  // namespace fg
