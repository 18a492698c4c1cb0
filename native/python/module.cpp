// The Python module fg_mujoco._native. Each function checks the types and shapes of its arrays, and runs without the GIL.
#include "bindings.hpp"

namespace nb = nanobind;

NB_MODULE(_native, module) {
    nb::set_leak_warnings(false);  // scenes and planners that are kept for the next race live as long as the process
    module.attr("INTERFACE") = FG_INTERFACE;  // see CMakeLists.txt
    module.attr("SOURCES") = FG_SOURCES;
    fg::bind_records(module);
    fg::bind_calls(module);
    fg::bind_course(module);
    fg::bind_lidar(module);
    fg::bind_perception(module);
    fg::bind_predictions(module);
    fg::bind_controllers(module);
    fg::bind_safety(module);
    fg::bind_vehicle(module);
    fg::bind_simulation(module);
    fg::bind_transcendental(module);
    fg::bind_drivers(module);
    fg::bind_racing_drivers(module);
    fg::bind_envs(module);
    fg::bind_arena(module);
    fg::bind_gym2d(module);
    fg::bind_realcar(module);
}
