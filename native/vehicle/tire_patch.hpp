// The force of a tire's contact patch: its deflection, slip and relaxation. tire_patch.py has the model. What has fours
// computes the four wheels of a car at once.
#pragma once
#include <array>

#include "../core/four.hpp"
#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"
#include "tire_rows.hpp"
#include "tires.hpp"

namespace fg {

// Return slip ratio and angle [rad] of deflections [m], positive if braked or drifting left, and their size.
inline std::array<double, 3> slips(const Tire& tire, double along, double across) {
    const double ratio = along / tire.relaxation_length, angle = fg::atan(across / tire.relaxation_length);
    return {ratio, angle, fg::hypot(ratio / tire.peak_slip[0], angle / tire.peak_slip[1])};
}

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

// What `deflect` returns, by wheel.
struct Deflected {
    Four along, across, force_x, force_y, size, sliding_x, sliding_y;
};

// The contact patches of up to four wheels, by wheel; one that there is not is another one's double.
class Patches {
public:
    // `forward` as in `deflect`; it and the timestep stay for some steps.
    FG_INLINE Patches(Row<const Tire> tires, Four forward, double timestep)
        : tires_(tires), forward_(forward), timestep_(timestep) {
        for (int k = 0; k < 4; ++k) {
            const Tire& tire = tires[min(k, tires.size() - 1)];
            vertical_stiffness_[k] = tire.vertical_stiffness, vertical_damping_[k] = tire.vertical_damping;
            per_length_[k] = 1.0 / tire.relaxation_length, damping_[k] = tire.damping;
            for (int axis = 0; axis < 2; ++axis) {
                peak_slip_[axis][k] = tire.peak_slip[axis], per_peak_slip_[axis][k] = 1.0 / tire.peak_slip[axis];
                per_peak_[axis][k] = 1.0 / tire.peak[axis], slope_[axis][k] = tire.slope[axis];
                for (int number = 0; number < magic_formula_numbers; ++number)
                    numbers_[axis][number][k] = tire.curve[axis][number];
            }
            holds_[k] = -(tire.holds != 0), slides_[k] = -(tire.slides != 0);
            all_hold_ = all_hold_ && tire.holds, any_holds_ = any_holds_ || tire.holds;
            alike_ = alike_ && tire.alike, magic_ = magic_ && tire.law == magic_formula;
            sensitive_ = sensitive_ || tire.load_sensitivity > 0.0;
        }
        constexpr double rolling = 0.5;  // [m/s] of a wheel: from there on its tire does not damp across the heading
        const Four standing = max(1.0 - forward / rolling, Four{});
        slow_x_ = damping_ / timestep, slow_y_ = damping_ * standing / timestep;
        const auto [left, reach] = rolled(forward);
        left_ = left, reach_ = reach;
    }

    // Return the load [N] of tires that are pressed by a depth [m] and leave the ground at a speed [m/s].
    FG_INLINE Four load(Four depth, Four speed) const { return vertical_stiffness_ * depth - vertical_damping_ * speed; }

    // Do what `grip_of` does.
    FG_INLINE Four grip(Four load, Four mu) const {
        Four grip = load * mu * per_peak_[1];
        if (sensitive_)
            for (int k = 0; k < tires_.size(); ++k) grip[k] = grip_of(tires_[k], load[k], mu[k]);
        return grip;
    }

    // Do what fg::deflect does.
    FG_INLINE Deflected deflect(Four along, Four across, Four over_x, Four over_y, Four grip) const {
        if (all_hold_) return bend(along, across, over_x, over_y, grip);
        const Deflected slid = slide(along, across, over_x, over_y, grip);
        if (!any_holds_) return slid;
        const Deflected bent = bend(along, across, over_x, over_y, grip);
        return {holds_ ? bent.along : slid.along,     holds_ ? bent.across : slid.across,
                holds_ ? bent.force_x : slid.force_x, holds_ ? bent.force_y : slid.force_y,
                holds_ ? bent.size : slid.size,       holds_ ? bent.sliding_x : slid.sliding_x,
                holds_ ? bent.sliding_y : slid.sliding_y};
    }

private:
    // The force over the load by a slip along an axis.
    FG_INLINE Four curve(int axis, Four slip) const {
        if (magic_) return magic_formula_force(numbers_[axis], slip);
        Four force{};
        for (int k = 0; k < tires_.size(); ++k)
            force[k] = curve_force(tires_[k].law, row(tires_[k].curve[axis]), slip[k]);
        return force;
    }

    // Return the share of a deflection left after a short step, and what a velocity adds [s]: exact if it stays.
    FG_INLINE std::array<Four, 2> rolled(Four forward) const {
        const Four way = forward * (timestep_ * per_length_), left = fg::exp(-way);
        const FourFlags stands = way < 1e-6;
        return {stands ? 1.0 - way : left, stands ? all<Four>(timestep_) : timestep_ * (1.0 - left) / way};
    }

    // Return what `slips` does, over the slips of the peaks.
    FG_INLINE std::array<Four, 3> shares(Four along, Four across) const {
        const Four ratio = along * per_length_ * per_peak_slip_[0];
        const Four angle = fg::atan(across * per_length_) * per_peak_slip_[1];
        return {ratio, angle, root_of(ratio * ratio + angle * angle)};
    }

    // Return the force [N] along the heading and to the left, by slips over those of the peaks, and their size.
    FG_INLINE std::array<Four, 2> shared_force(Four ratio, Four angle, Four size, Four grip) const {
        const Four within = holds_ ? min(size, all<Four>(1.0)) : size;
        const Four across = curve(1, within * peak_slip_[1]);
        const Four along = alike_ ? across : curve(0, within * peak_slip_[0]);
        const Four scale = -grip / size;
        const FourFlags none = size == 0.0;
        return {none ? Four{} : along * ratio * scale, none ? Four{} : across * angle * scale};
    }

    // Return a force [N] that is no greater than a tire that slides can give.
    FG_INLINE std::array<Four, 2> within_peaks(Four along, Four across, Four grip) const {
        const Four share_x = along * per_peak_[0], share_y = across * per_peak_[1];
        const Four much = share_x * share_x + share_y * share_y;
        const FourFlags more = much > grip * grip;
        if (!any(more)) [[likely]] return {along, across};
        const Four down = grip / root_of(much);
        return {more ? along * down : along, more ? across * down : across};
    }

    // Tires of bristles.
    FG_INLINE Deflected bend(Four along, Four across, Four over_x, Four over_y, Four grip) const {
        Four new_along = along * left_ + reach_ * over_x, new_across = across * left_ + reach_ * over_y;
        const Four ratio = new_along * (per_length_ * per_peak_slip_[0]);
        const Four angle = new_across * (per_length_ * per_peak_slip_[1]);
        const Four square = ratio * ratio + angle * angle, size = root_of(square);
        Four sliding_x{}, sliding_y{};
        const FourFlags slides = square > 1.0;
        if (any(slides)) [[unlikely]] {
            const Four beyond = (1.0 - 1.0 / size) / reach_;
            sliding_x = slides ? new_along * beyond : sliding_x, sliding_y = slides ? new_across * beyond : sliding_y;
            new_along = slides ? new_along / size : new_along, new_across = slides ? new_across / size : new_across;
        }
        const auto [elastic_x, elastic_y] = shared_force(ratio, angle, size, grip);
        const Four damped_x = elastic_x - slow_x_ * (new_along - along);
        const Four damped_y = elastic_y - slow_y_ * (new_across - across);
        const auto [force_x, force_y] = within_peaks(damped_x, damped_y, grip);
        return {new_along, new_across, force_x, force_y, size, sliding_x, sliding_y};
    }

    // All others.
    FG_INLINE Deflected slide(Four along, Four across, Four over_x, Four over_y, Four grip) const {
        const FourFlags back = slides_ & (along * over_x + across * over_y < 0.0);
        if (any(back)) {
            const auto [ratio, angle, size] = shares(along, across);
            const FourFlags springs = back & (size > 1.0);
            if (any(springs)) {
                // A tire that slid, and now moves back, springs back by what gives its force, and no more.
                const auto [fx, fy] = shared_force(ratio, angle, size, grip);
                along = springs ? -fx / (grip * slope_[0] * per_length_) : along;
                across = springs ? -fy / (grip * slope_[1] * per_length_) : across;
            }
        }
        // a locked wheel deflects no further than to this slip
        constexpr double locked_slip = 1.0;  // GREATEST_SLIP
        const auto [left, reach] = rolled(max(forward_, root_of(over_x * over_x + over_y * over_y) / locked_slip));
        const Four new_along = along * left + reach * over_x, new_across = across * left + reach * over_y;
        const auto [ratio, angle, size] = shares(new_along, new_across);
        const FourFlags beyond = slides_ & (size > 1.0);
        const Four part = beyond ? 1.0 - 1.0 / size : Four{};
        const auto [shared_x, shared_y] = shared_force(ratio, angle, size, grip);
        const Four damped_x = shared_x - slow_x_ * (new_along - along);
        const Four damped_y = shared_y - slow_y_ * (new_across - across);
        const auto [held_x, held_y] = within_peaks(damped_x, damped_y, grip);
        return {new_along, new_across, slides_ ? held_x : damped_x, slides_ ? held_y : damped_y,
                size,      over_x * part, over_y * part};
    }

    Row<const Tire> tires_;
    Four vertical_stiffness_, vertical_damping_, forward_, per_length_, damping_;
    Four peak_slip_[2], per_peak_slip_[2], per_peak_[2], slope_[2];
    Four numbers_[2][magic_formula_numbers];
    FourFlags holds_, slides_;
    bool all_hold_ = true, any_holds_ = false, alike_ = true, magic_ = true, sensitive_ = false;
    double timestep_;
    Four slow_x_, slow_y_;  // what damps each metre of deflection [N/m], along and across
    Four left_, reach_;     // `rolled` of `forward_`
};

}  // namespace fg
