// How the angle of the front wheels follows the commands of a drive; see addons/realcar/identification/steering_response.py.
#pragma once
#include "../../core/arrays.hpp"

namespace fg {

// Targets of the angle of the front wheels: at each knot [s] one, from where it has a constant slope to the next one.
struct SteeringTargets {
    Numbers knots, targets, slopes;
};

// Write the angle at each time [s], exact whenever the targets change, with a lag [s] and a greatest rate [rad/s].
void follow_targets(const SteeringTargets& of, Numbers time, double lag, double rate, Row<double> out);

}  // namespace fg
