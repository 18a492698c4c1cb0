// Binds native/addons/gym2d.
#include "../addons/gym2d/ray_cast.hpp"

#include <nanobind/stl/array.h>

#include "bindings.hpp"
#include "record_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace fg {

void bind_gym2d(nb::module_& module) {
    module.def("ray_cast",
               [](std::array<double, 3> pose, Row<double> scan, Numbers scan_angles, Matrix vertices) {
                   require(scan_angles.length == scan.length && vertices.rows == 4 && vertices.columns == 2,
                           "there are not as many angles as readings, or corners are not (4, 2)");
                   ray_cast(pose, scan, scan_angles, vertices);
               },
               "pose"_a, "scan"_a, "scan_angles"_a, "vertices"_a, nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace fg
