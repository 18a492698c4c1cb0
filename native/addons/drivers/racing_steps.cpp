// The steps of drivers among other cars as functions of C.
#include "racing_steps.hpp"

#include "../../controllers/control/stages.hpp"
#include "overtaker.hpp"

extern "C" {

void fg_overtake(std::int64_t address) noexcept { fg::for_each_world<fg::OvertakerState>(address, fg::overtake); }
}

namespace fg {

Row<const NamedStep> racing_steps() {
    static constexpr NamedStep named[] = {{"overtake", fg_overtake}};
    return row(named);
}

}  // namespace fg
