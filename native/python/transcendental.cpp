// Binds native/core/transcendental.hpp for arrays, and names the functions as numpy does.
#include "../core/transcendental.hpp"
#include "bindings.hpp"
#include "casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace fg {
namespace {

template <double (*Function)(double)>
void bind_of_one(nb::module_& module, const char* name) {
    module.def(name,
               [](Numbers x, Row<double> out) {
                   require(x.length == out.length, "x and out are not of one length");
                   for (int i = 0; i < x.size(); ++i) out[i] = Function(x[i]);
               },
               "x"_a, "out"_a, nb::call_guard<nb::gil_scoped_release>());
}

template <double (*Function)(double, double)>
void bind_of_two(nb::module_& module, const char* name) {
    module.def(name,
               [](Numbers one, Numbers other, Row<double> out) {
                   require(one.length == out.length && other.length == out.length, "the rows are not of one length");
                   for (int i = 0; i < out.size(); ++i) out[i] = Function(one[i], other[i]);
               },
               "one"_a, "other"_a, "out"_a, nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace

void bind_transcendental(nb::module_& module) {
    bind_of_one<&fg::sin>(module, "sin");
    bind_of_one<&fg::cos>(module, "cos");
    bind_of_one<&fg::tan>(module, "tan");
    bind_of_one<&fg::asin>(module, "arcsin");
    bind_of_one<&fg::acos>(module, "arccos");
    bind_of_one<&fg::exp>(module, "exp");
    bind_of_two<&fg::atan2>(module, "arctan2");
    bind_of_two<&fg::hypot>(module, "hypot");
}

}  // namespace fg
