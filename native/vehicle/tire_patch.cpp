#include "tire_patch.hpp"

namespace fg {

std::array<double, 2> curve_peaks(const Tire& tire, double load, double mu) {
    const double grip = grip_of(tire, load, mu);
    return {grip * tire.peak[0], grip * tire.peak[1]};
}

std::array<double, 7> deflect(const Tire& tire, double along, double across, double over_x, double over_y,
                              double forward, double grip, double timestep) {
    const Patches patches({&tire, 1}, all<Four>(forward), timestep);
    const Deflected found = patches.deflect(all<Four>(along), all<Four>(across), all<Four>(over_x), all<Four>(over_y),
                                            all<Four>(grip));
    return {found.along[0], found.across[0],    found.force_x[0],  found.force_y[0],
            found.size[0],  found.sliding_x[0], found.sliding_y[0]};
}

}  // namespace fg
