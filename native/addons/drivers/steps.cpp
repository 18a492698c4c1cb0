#include "steps.hpp"

#include "../../controllers/control/stages.hpp"
#include "line_mpc.hpp"
#include "line_trackers.hpp"
#include "overtaker.hpp"
#include "pure_pursuit.hpp"

extern "C" {

static void fg_pure_pursuit(std::int64_t address) noexcept { fg::for_each_world(address, fg::refer_along_line); }
static void fg_track_by_stanley(std::int64_t address) noexcept { fg::for_each_world(address, fg::track_by_stanley); }
static void fg_track_by_lqr(std::int64_t address) noexcept { fg::for_each_world(address, fg::track_by_lqr); }
static void fg_track_by_map(std::int64_t address) noexcept { fg::for_each_world(address, fg::track_by_map); }
static void fg_track_by_mpc(std::int64_t address) noexcept { fg::for_each_world<fg::Mpc>(address, fg::track_by_mpc); }
static void fg_overtake(std::int64_t address) noexcept { fg::for_each_world<fg::OvertakerState>(address, fg::overtake); }
}

namespace fg {

Row<const NamedStep> driver_steps() {
    static constexpr NamedStep named[] = {
        {"pure_pursuit", fg_pure_pursuit},
        {"track_by_stanley", fg_track_by_stanley},
        {"track_by_lqr", fg_track_by_lqr},
        {"track_by_map", fg_track_by_map},
        {"track_by_mpc", fg_track_by_mpc},
        {"overtake", fg_overtake},
    };
    return row(named);
}

}  // namespace fg
