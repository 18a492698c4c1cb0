#include "tire_patch.hpp"

namespace fg {
namespace {

constexpr double locked_slip = 1.0;  // GREATEST_SLIP

}  // namespace

std::array<double, 2> patch_force(const Tire& tire, double along, double across, double grip) {
    const auto [ratio, angle, size] = slips(tire, along, across);
    return shared_force(tire, ratio / tire.peak_slip[0], angle / tire.peak_slip[1], size, grip);
}

std::array<double, 2> curve_peaks(const Tire& tire, double load, double mu) {
    const double grip = grip_of(tire, load, mu);
    return {grip * tire.peak[0], grip * tire.peak[1]};
}

std::array<double, 7> deflect(const Tire& tire, double along, double across, double over_x, double over_y,
                              double forward, double grip, double timestep) {
    const double sigma = tire.relaxation_length;
    const auto [slow_x, slow_y] = damping_of(tire, forward, timestep);
    if (tire.holds) {
        const auto [left, reach] = rolled(forward, sigma, timestep);
        return bend(tire, along, across, over_x, over_y, left, reach, slow_x, slow_y, grip);
    }
    if (tire.slides && along * over_x + across * over_y < 0.0 && slips(tire, along, across)[2] > 1.0) {
        // A tire that slid, and now moves back, springs back by what gives its force, and no more.
        const auto [force_x, force_y] = patch_force(tire, along, across, grip);
        along = -force_x * sigma / (grip * tire.slope[0]), across = -force_y * sigma / (grip * tire.slope[1]);
    }
    // a locked wheel deflects no further than to this slip
    const double roll = max(forward, std::sqrt(over_x * over_x + over_y * over_y) / locked_slip);
    const auto [left, reach] = rolled(roll, sigma, timestep);
    const double new_along = along * left + reach * over_x, new_across = across * left + reach * over_y;
    const auto [ratio, angle, size] = slips(tire, new_along, new_across);
    double sliding_x = 0.0, sliding_y = 0.0;
    if (tire.slides && size > 1.0) sliding_x = over_x * (1.0 - 1.0 / size), sliding_y = over_y * (1.0 - 1.0 / size);
    auto force = shared_force(tire, ratio / tire.peak_slip[0], angle / tire.peak_slip[1], size, grip);
    force = {force[0] - slow_x * (new_along - along), force[1] - slow_y * (new_across - across)};
    if (tire.slides) force = within_peaks(tire, force[0], force[1], grip);
    return {new_along, new_across, force[0], force[1], size, sliding_x, sliding_y};
}

}  // namespace fg
