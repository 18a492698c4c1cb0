// Calls of planners, by the addresses of functions in C and a number each: the steps of native/controllers, and what is
// in Python, called by `call_python`.
#include "../controllers/control/stages.hpp"
#include "bindings.hpp"
#include "casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace fg {
namespace {

// Call what can be called in Python, by the address of the object. What it raises goes on through the callers.
void call_python(std::int64_t object) {
    const nb::gil_scoped_acquire with_gil;
    nb::handle(reinterpret_cast<PyObject*>(object))();
}

}  // namespace

void bind_calls(nb::module_& module) {
    module.attr("CALL_PYTHON") = reinterpret_cast<std::intptr_t>(&call_python);
    module.def("call_all",
               [](Table<const std::int64_t> calls) {
                   require(calls.columns == 2, "calls are not (k, 2)");
                   call_all(calls);
               },
               "calls"_a, nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace fg
