#include "tire_slip.hpp"

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"
#include "tire_patch.hpp"

namespace fg {
namespace {

constexpr double contact_slides = 0.05;   // [m/s] SLIDING_SPEED
constexpr double bristles_slide = 0.010;  // [m/s]
constexpr double least_rolling = 0.05;    // [m/s] a slower wheel of the model `contact` has no slip angle and no ratio

// The quantities of one tire in one step.
struct Place {
    Cube<double> slip;
    int step, tire;

    double& operator[](int quantity) const { return slip[quantity][step][tire]; }
    void clear() const {
        for (int quantity = 0; quantity < slip.length; ++quantity) (*this)[quantity] = nan;
    }
};

// Write what a tire with a law of ours did in a step, from its user data then.
void measure_law(const Tire& tire, const TireState& own, double mu, const Place& slip) {
    if (own.load <= 0.0) {
        slip.clear();
        return;
    }
    const double force_x = own.force_along, force_y = own.force_across;
    const auto [ratio, angle, size] = slips(tire, own.along, own.across);
    const auto [most_x, most_y] = curve_peaks(tire, own.load, mu);
    const double use_x = force_x / most_x, use_y = force_y / most_y;
    slip[quantity::normal_force] = own.load;
    slip[quantity::friction_force] = std::sqrt(force_x * force_x + force_y * force_y);
    slip[quantity::friction_use] = std::sqrt(use_x * use_x + use_y * use_y);
    slip[quantity::force_x] = force_x, slip[quantity::force_y] = force_y;
    slip[quantity::slip_angle] = -angle, slip[quantity::slip_ratio] = -ratio;
    // without a peak there is no past it
    slip[quantity::sliding_speed] = tire.slides ? own.sliding : nan;
    slip[quantity::lateral_speed] = tire.slides ? own.sliding_across : nan;
    const bool slides = tire.holds ? own.sliding > bristles_slide : tire.slides && own.slip_size > 1.0;
    slip[quantity::slides] = slides ? 1.0 : 0.0;
}

// Write what a contact of MuJoCo's did in a step, from its sensors and that of the axle, which may be empty.
void measure_contact(Numbers row, Numbers axle, double grip, const Place& slip) {
    if (row[0] == 0.0) {
        slip.clear();
        return;
    }
    const Numbers normal = row.part(7, 10);
    const double arm_x = row[4] - row[10], arm_y = row[5] - row[11], arm_z = row[6] - row[12];  // centre to the point
    double x = row[13] + row[17] * arm_z - row[18] * arm_y;
    double y = row[14] + row[18] * arm_x - row[16] * arm_z;
    double z = row[15] + row[16] * arm_y - row[17] * arm_x;
    const double into_ground = x * normal[0] + y * normal[1] + z * normal[2];
    x = x - into_ground * normal[0], y = y - into_ground * normal[1], z = z - into_ground * normal[2];
    const double friction = fg::hypot(row[2], row[3]), speed = std::sqrt(x * x + y * y + z * z);
    slip[quantity::sliding_speed] = speed;
    slip[quantity::friction_use] = friction / (grip * row[1]);
    slip[quantity::normal_force] = row[1];
    slip[quantity::friction_force] = friction;
    slip[quantity::slides] = speed > contact_slides ? 1.0 : 0.0;
    if (axle.length == 0) {
        slip[quantity::lateral_speed] = slip[quantity::force_x] = slip[quantity::force_y] = nan;
        slip[quantity::slip_angle] = slip[quantity::slip_ratio] = nan;
        return;
    }
    const double lean = axle[0] * normal[0] + axle[1] * normal[1] + axle[2] * normal[2];
    const double along_axle = x * axle[0] + y * axle[1] + z * axle[2];  // of a velocity along the ground
    slip[quantity::lateral_speed] = std::abs(along_axle) / std::sqrt(max(1.0 - lean * lean, 1e-12));
    // on level ground a contact's frame is z, y, -x, and the sensor turns the tire's force by that
    const double level = fg::hypot(axle[0], axle[1]);
    const double ahead_x = axle[1] / level, ahead_y = -axle[0] / level;
    slip[quantity::force_x] = ahead_x * row[3] + ahead_y * row[2];
    slip[quantity::force_y] = ahead_x * row[2] - ahead_y * row[3];
    const double forward = ahead_x * row[13] + ahead_y * row[14];
    if (std::abs(forward) > least_rolling) {
        slip[quantity::slip_angle] = -fg::atan2(ahead_x * y - ahead_y * x, std::abs(forward));
        slip[quantity::slip_ratio] = -(ahead_x * x + ahead_y * y) / std::abs(forward);
    } else {
        slip[quantity::slip_angle] = slip[quantity::slip_ratio] = nan;
    }
}

}  // namespace

void measure_slip(Matrix records, std::int64_t start, std::int64_t axles, Matrix mu, Row<const Tire> tires,
                  Matrix states, std::int64_t place, Cube<double> slip) {
    for (int step = 0; step < slip.rows; ++step) {
        const Numbers grip = mu[mu.rows > 1 ? step : 0];
        for (int tire = 0; tire < 4; ++tire) {
            const Place at{slip, step, tire};
            if (tires.length > 0) {
                measure_law(tires[tire], tire_states(states[step], place, 4)[tire], grip[tire], at);
                continue;
            }
            const auto first = start + tire * contact_readings;
            const Numbers row = records[step].part(first, first + contact_readings);
            const auto axle = axles < 0 ? Numbers{} : records[step].part(axles + 3 * tire, axles + 3 * (tire + 1));
            measure_contact(row, axle, grip[tire], at);
        }
    }
}

std::int64_t greatest_slip(Cube<const double> slip, Row<double> greatest) {
    for (int i = 0; i < greatest.size(); ++i) greatest[i] = nan;
    std::int64_t sliding_steps = 0;
    for (int step = 0; step < slip.rows; ++step) {
        bool slides = false;
        for (int tire = 0; tire < 4; ++tire) {
            const double speed = slip[quantity::sliding_speed][step][tire];
            const double use = slip[quantity::friction_use][step][tire];
            slides = slides || slip[quantity::slides][step][tire] > 0.0;
            if (!(speed <= greatest[tire]) && !std::isnan(speed)) greatest[tire] = speed;
            if (!(use <= greatest[4 + tire]) && !std::isnan(use)) greatest[4 + tire] = use;
        }
        sliding_steps += slides;
    }
    return sliding_steps;
}

double greatest_lateral_speed(Cube<const double> slip, double so_far) {
    for (int step = 0; step < slip.rows; ++step)
        for (int tire = 0; tire < 4; ++tire) {
            const double speed = slip[quantity::lateral_speed][step][tire];
            if (speed > so_far) so_far = speed;  // nor is NaN
        }
    return so_far;
}

}  // namespace fg
