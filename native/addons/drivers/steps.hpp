// The steps of these drivers as functions of C, see controllers/control/steps.hpp.
#pragma once
#include "../../controllers/control/steps.hpp"

namespace fg {

// Return pure pursuit and its trackers.
Row<const NamedStep> driver_steps();

}  // namespace fg
