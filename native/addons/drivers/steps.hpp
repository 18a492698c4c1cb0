// The steps of these drivers as functions of C, see controllers/control/steps.hpp.
#pragma once
#include "../../controllers/control/steps.hpp"

namespace fg {

// Return all of them: pure pursuit, its trackers, the overtaker.
Row<const NamedStep> driver_steps();

}  // namespace fg
