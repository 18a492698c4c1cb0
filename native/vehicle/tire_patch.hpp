// The force of a tire's contact patch: its deflection, slip and relaxation. tire_patch.py has the model.
#pragma once
#include <array>

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"
#include "tire_rows.hpp"
#include "tires.hpp"

namespace fg {

// Return slip ratio and angle [rad] of deflections [m], positive if braked or drifting left, and their size.
inline std::array<double, 3> slips(const Tire& tire, double along, double across) {
    const double ratio = along / tire.relaxation_length, angle = fg::atan(across / tire.relaxation_length);
    const double share_x = ratio / tire.peak_slip[0], share_y = angle / tire.peak_slip[1];
    return {ratio, angle, std::sqrt(share_x * share_x + share_y * share_y)};
}

// Return the force [N] along the heading and to the left, by slips over those of the peaks, and their size.
inline std::array<double, 2> shared_force(const Tire& tire, double ratio, double angle, double size, double grip) {
    if (size == 0.0) return {0.0, 0.0};
    const double within = tire.holds ? min(size, 1.0) : size;
    const double across = curve_force(tire.law, row(tire.curve[1]), within * tire.peak_slip[1]);
    const double along =
        tire.alike ? across : curve_force(tire.law, row(tire.curve[0]), within * tire.peak_slip[0]);
    const double scale = -grip / size;
    return {along * ratio * scale, across * angle * scale};
}

// Return the force [N] ahead and left of a patch that is deflected [m]; `grip` [N] is of `grip_of`.
std::array<double, 2> patch_force(const Tire& tire, double along, double across, double grip);

// Return the load [N] times what scales the curves of a tire: its load sensitivity, and its lateral peak `mu`.
inline double grip_of(const Tire& tire, double load, double mu) {
    double grip = load * mu / tire.peak[1];
    if (tire.load_sensitivity > 0.0 && load > 0.0) grip *= fg::pow(load / tire.nominal_load, -tire.load_sensitivity);
    return grip;
}

// Return the greatest force of a tire along its heading and across [N]; arguments as in `grip_of`.
std::array<double, 2> curve_peaks(const Tire& tire, double load, double mu);

// Return the deflections of a contact patch after a short step [m], and its force then [N].
//   along, across: deflection before, along the heading and to the left [m].
//   over_x, over_y: velocity of the contact point over the ground, likewise [m/s].
//   forward: that of the wheel, without sign [m/s].
//   timestep: [s].
// These are deflections, forces, size of the slip over that of the peak, and how fast it slides, ahead and to the left
// [m/s].
std::array<double, 7> deflect(const Tire& tire, double along, double across, double over_x, double over_y,
                              double forward, double grip, double timestep);

// Return the share of a deflection left after a short step, and what a velocity adds [s]: exact if it stays.
inline std::array<double, 2> rolled(double forward, double relaxation_length, double timestep) {
    const double way = timestep * forward / relaxation_length;
    if (way < 1e-6) return {1.0 - way, timestep};
    const double left = fg::exp(-way);
    return {left, timestep * (1.0 - left) / way};
}

// Return what damps each metre of deflection, along the heading and across, where it fades with the speed [N/m].
inline std::array<double, 2> damping_of(const Tire& tire, double forward, double timestep) {
    constexpr double rolling = 0.5;  // [m/s] of a wheel: from there on its tire does not damp across the heading
    const double standing = max(1.0 - forward / rolling, 0.0);
    return {tire.damping / timestep, tire.damping * standing / timestep};
}

// Return a force [N] that is no greater than a tire that slides can give.
inline std::array<double, 2> within_peaks(const Tire& tire, double along, double across, double grip) {
    const double share_x = along / tire.peak[0], share_y = across / tire.peak[1];
    const double much = share_x * share_x + share_y * share_y;
    if (much > grip * grip) [[unlikely]] {
        const double down = grip / std::sqrt(much);
        return {along * down, across * down};
    }
    return {along, across};
}

// Do what `deflect` does, for a tire of bristles; `left` and `reach` are of `rolled`, the rest of `damping_of`.
inline std::array<double, 7> bend(const Tire& tire, double along, double across, double over_x, double over_y,
                                  double left, double reach, double slow_x, double slow_y, double grip) {
    double new_along = along * left + reach * over_x, new_across = across * left + reach * over_y;
    const double ratio = new_along / (tire.relaxation_length * tire.peak_slip[0]);
    const double angle = new_across / (tire.relaxation_length * tire.peak_slip[1]);
    const double square = ratio * ratio + angle * angle, size = std::sqrt(square);
    double sliding_x = 0.0, sliding_y = 0.0;
    if (square > 1.0) [[unlikely]] {
        const double beyond = (1.0 - 1.0 / size) / reach;
        sliding_x = new_along * beyond, sliding_y = new_across * beyond;
        new_along = new_along / size, new_across = new_across / size;
    }
    const auto [elastic_x, elastic_y] = shared_force(tire, ratio, angle, size, grip);
    const double damped_x = elastic_x - slow_x * (new_along - along);
    const double damped_y = elastic_y - slow_y * (new_across - across);
    const auto [force_x, force_y] = within_peaks(tire, damped_x, damped_y, grip);
    return {new_along, new_across, force_x, force_y, size, sliding_x, sliding_y};
}

}  // namespace fg
