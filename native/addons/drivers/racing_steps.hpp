// The steps of drivers among other cars as functions of C, see controllers/control/steps.hpp.
#pragma once
#include "../../controllers/control/steps.hpp"
#include "../../core/arrays.hpp"

extern "C" {

// See overtaker.hpp.
void fg_overtake(std::int64_t address) noexcept;
}

namespace fg {

// Return all of them.
Row<const NamedStep> racing_steps();

}  // namespace fg
