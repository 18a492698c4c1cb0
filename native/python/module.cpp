// The Python module fg_mujoco._native. Each function checks the types and shapes of its arrays, and runs without the GIL.
#include "lidar.hpp"

namespace nb = nanobind;

NB_MODULE(_native, module) {
    module.attr("INTERFACE") = FG_INTERFACE;  // see CMakeLists.txt
    module.attr("SOURCES") = FG_SOURCES;
    fg::bind_lidar(module);
}
