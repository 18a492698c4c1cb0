// Binds native/addons/realcar. Shapes that do not fit together are refused with a ValueError.
#include "../addons/realcar/single_track.hpp"
#include "../addons/realcar/steering_response.hpp"
#include "bindings.hpp"
#include "own_arrays.hpp"
#include "tuple_casters.hpp"

NAMESPACE_BEGIN(NB_NAMESPACE)
NAMESPACE_BEGIN(detail)

template <>
struct type_caster<fg::SimulatedDrive>
    : tuple_caster<fg::SimulatedDrive, fg::Held<const fg::CarTires>, fg::Held<const fg::SingleTrackCar>, double, double,
                   fg::Numbers, fg::Numbers, fg::Numbers, double> {};
template <>
struct type_caster<fg::SteeringTargets> : tuple_caster<fg::SteeringTargets, fg::Numbers, fg::Numbers, fg::Numbers> {};

NAMESPACE_END(detail)
NAMESPACE_END(NB_NAMESPACE)

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

namespace fg {

void bind_realcar(nb::module_& module) {
    module.def("friction_curve",
               [](Numbers slip, Held<const AxleTires> tire) { return to_numpy(friction_curve(slip, tire)); }, "slip"_a,
               "tire"_a);
    module.def("simulate_segments",
               [](const SimulatedDrive& drive, Table<const std::int64_t> segments, Matrix starts, Table<double> out) {
                   const std::int64_t count = drive.steering.length;
                   require(drive.forward_speed.length == count && drive.forward_acceleration.length == count &&
                               out.rows == count && out.columns == 6,
                           "steering, speed and acceleration are not (n,), or out is not (n, 6)");
                   require(segments.columns == 2 && starts.columns == 5 && starts.rows == segments.rows,
                           "segments are not (m, 2), or starts are not (m, 5)");
                   for (std::int64_t i = 0; i < segments.rows; ++i) {
                       require(0 <= segments[i][0] && segments[i][0] < segments[i][1] && segments[i][1] <= count,
                               "a segment is none of the drive");
                   }
                   simulate_segments(drive, segments, starts, out);
               },
               "drive"_a, "segments"_a, "starts"_a, "out"_a, WithoutGil());
    module.def("follow_targets",
               [](const SteeringTargets& of, Numbers time, double lag, double rate, Row<double> out) {
                   require(of.knots.length > 0 && of.targets.length == of.knots.length &&
                               of.slopes.length == of.knots.length && time.length > 0 && out.length == time.length,
                           "knots, targets and slopes are not as many, or time and out");
                   follow_targets(of, time, lag, rate, out);
               },
               "of"_a, "time"_a, "lag"_a, "rate"_a, "out"_a, WithoutGil());
}

}  // namespace fg
