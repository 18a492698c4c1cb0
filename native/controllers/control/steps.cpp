// The steps of a tick as functions of C. An index out of range in a build with FG_CHECK_BOUNDS ends the process.
#include "steps.hpp"

#include "../gap_finder.hpp"
#include "../safety/lap_raceline.hpp"
#include "decision.hpp"
#include "stages.hpp"

extern "C" {

void fg_see(std::int64_t address) noexcept { fg::see_at(address); }
void fg_predict(std::int64_t address) noexcept { fg::for_each_world(address, fg::predict); }
void fg_feel_ground(std::int64_t address) noexcept { fg::for_each_world<fg::FeltGround>(address, fg::feel_ground); }
void fg_refer_by_gap_finder(std::int64_t address) noexcept {
    fg::for_each_world<fg::PlannerState<fg::GapFinderSettings>>(address, fg::refer_by_gap_finder);
}
void fg_begin(std::int64_t address) noexcept { fg::for_each_world(address, fg::begin); }
void fg_guide_reference(std::int64_t address) noexcept { fg::for_each_world(address, fg::guide_reference); }
void fg_drive(std::int64_t address) noexcept { fg::for_each_world(address, fg::drive); }
void fg_drive_held(std::int64_t address) noexcept { fg::for_each_world(address, fg::drive_held); }
void fg_drive_in_sight(std::int64_t address) noexcept { fg::for_each_world(address, fg::drive_in_sight); }
void fg_drive_filtered(std::int64_t address) noexcept { fg::for_each_world(address, fg::drive_filtered); }
void fg_remember(std::int64_t address) noexcept { fg::for_each_world<fg::Remembered>(address, fg::remember); }
}

namespace fg {

Row<const NamedStep> steps() {
    static constexpr NamedStep named[] = {
        {"see", fg_see},
        {"predict", fg_predict},
        {"feel_ground", fg_feel_ground},
        {"refer_by_gap_finder", fg_refer_by_gap_finder},
        {"begin", fg_begin},
        {"guide_reference", fg_guide_reference},
        {"drive", fg_drive},
        {"drive_held", fg_drive_held},
        {"drive_in_sight", fg_drive_in_sight},
        {"drive_filtered", fg_drive_filtered},
        {"remember", fg_remember},
    };
    return row(named);
}

}  // namespace fg
