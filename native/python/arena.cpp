// Binds native/addons/arena.
#include "../addons/arena/drivable.hpp"
#include "bindings.hpp"
#include "own_arrays.hpp"
#include "record_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace fg {
namespace {

auto checked_lap(Matrix walls, Held<const DrivablePose> start, Matrix table, double length) {
    require(walls.rows > 0 && walls.columns == 4 && (table.rows == 6 || table.rows == 10) && table.columns > 0,
            "walls are not (m, 4), or the table of the course is neither (6, n) nor (10, n)");
    std::vector<DrivablePose> poses;
    {
        const nb::gil_scoped_release released;
        poses = drivable_lap(walls, start, table, length);
    }
    const auto count = static_cast<std::int64_t>(poses.size());
    auto* const numbers = reinterpret_cast<double*>(poses.data());
    return owned(std::move(poses), numbers, std::array{count, std::int64_t{3}});
}

}  // namespace

void bind_arena(nb::module_& module) {
    module.attr("DRIVABLE_MARGIN") = drivable_margin;
    module.attr("DRIVABLE_STEP") = drivable_step;
    module.def("drivable_lap", &checked_lap, "walls"_a, "start"_a, "table"_a, "length"_a);
}

}  // namespace fg
