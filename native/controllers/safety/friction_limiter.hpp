// The friction limiter: the command nearest to a reference command that the tires can follow without sliding.
#pragma once
#include <array>

#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"
#include "../control/planner_settings.hpp"
#include "../control/slip.hpp"

namespace fg {

// Shares of the tires' grip that may be used, and how fast they may build up.
struct FrictionLimiterSettings {
    double lateral_use;  // share of mu g, in cornering
    double lateral_use_in_braking;  // share of lateral_use while the car is too fast for the reference steering angle
    double least_lateral_use;  // share of lateral_use while the car is too fast by `overspeed`
    double overspeed;  // [m/s] see least_lateral_use
    double turn_in_use;  // share of what cornering leaves, for turning the wheels in or out
    double most_left;  // what cornering leaves counts as at most this share of mu g; 2 is all that there can be
    double braking_use;  // share of the greatest braking that locks no axle
    double accelerating_use;  // share of the greatest accelerating that spins no wheel
    double load_transfer_time;  // [s] in which the car pitches to within 4 % of where it stays, on its springs
    double speed_response;  // [s] a reference speed is approached at (reference - speed) / speed_response
    double steering_response;  // [s] the servo turns at (command - angle) / steering_response: 1.1 of lag and delay
};
FG_RECORD(FrictionLimiterSettings, lateral_use, lateral_use_in_braking, least_lateral_use, overspeed, turn_in_use,
          most_left, braking_use, accelerating_use, load_transfer_time, speed_response, steering_response);

inline constexpr int limiter_shares = 257;  // of a table over what cornering leaves

// Type of the row that `limited` reads.
struct Limiter {
    FrictionLimiterSettings settings;
    CarParameters car;
    double mu;  // that cornering may use, see 7 above
    double lateral;  // [m/s^2] these six: see FrictionLimiter
    double braking;  // [m/s^2]
    double accelerating;  // [m/s^2]
    double yaw_lag;  // [m]
    double level[4];  // mu, lateral, braking, accelerating on level ground, see `feel_ground`
    double shares[2][limiter_shares];  // of braking, accelerating: see `longitudinal_share`
    Slip slip;  // angles that the tires need
};
FG_RECORD(Limiter, settings, car, mu, lateral, braking, accelerating, yaw_lag, level, shares, slip);

// Type of what a limiter keeps from one tick to the next; zero at the beginning.
struct LimiterMemory {
    double acceleration;  // [m/s^2] that was last commanded
    double lateral_use;  // share of the lateral grip that was used then
    double curvature;  // [1/m] of the path that the car is on; of tires that need slip angles, see slip
};
FG_RECORD(LimiterMemory, acceleration, lateral_use, curvature);

// What the IMU says of the ground; zero: it is level.
struct FeltGround {
    double load;  // [-] more than the weight, over it
    double bank;  // [-] acceleration to the left over g that the ground gives
    double twist;  // [rad/m] roll along the way
};
FG_RECORD(FeltGround, load, bank, twist);

// Set a limiter to what the tires hold on the ground that the IMU feels.
void feel_ground(Limiter& limiter, FeltGround& felt, const Odometry& odometry, double period);

// Write the acceleration over g at each share of a limiter; `axles` are numbers of the front and of the rear one.
void find_held(Matrix axles, double mu, double moved, bool soft, bool shaft, Row<double> found);

// Return the share of straight-line braking or accelerating that is left at a share of the lateral grip, see 4.
inline double longitudinal_share(const Limiter& limiter, double lateral_use, bool braking) {
    const double position = std::sqrt(1.0 - min(max(lateral_use, 0.0), 1.0)) * (limiter_shares - 1);
    const int at = max(min(whole(position), limiter_shares - 2), 0);
    const double* const shares = limiter.shares[braking ? 0 : 1];
    return shares[at] + (position - at) * (shares[at + 1] - shares[at]);
}

// Return a share of braking, or what is stable of it, see `stable_braking`; a fifth of it at least.
double stable_share(const Limiter& limiter, double share, double lateral_use, double speed);

// Return the command nearest to the reference that the tires hold: steering angle [rad] and speed [m/s].
std::array<double, 2> limited(const Limiter& limiter, LimiterMemory& memory, std::array<double, 2> reference,
                              double least_lateral_use, std::array<double, 2> present, double period, bool planned);

// Return the steering angle [rad] and the speed [m/s] that limits 1 and 2 leave of a reference.
std::array<double, 2> held_on_circle(const Limiter& limiter, double steering_angle, double speed, double now,
                                     double least_lateral_use);

}  // namespace fg
