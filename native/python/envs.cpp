// Binds native/envs. Shapes that do not fit together are refused with a ValueError; what lies at the addresses of tables
// nobody checks.
#include "../envs/compiled_step.hpp"
#include "../envs/observer.hpp"
#include "../envs/tick_state.hpp"
#include "bindings.hpp"
#include "record_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

namespace fg {
namespace {

bool are_within(Row<const std::int64_t> indices, std::int64_t behind) {
    for (std::int64_t i = 0; i < indices.length; ++i)
        if (indices[i] < 0 || indices[i] >= behind) return false;
    return true;
}

bool has_shape(const Matrix& table, std::int64_t rows, std::int64_t columns) {
    return table.rows == rows && table.columns == columns;
}

bool has_shape(const Cube<double>& cube, std::int64_t length, std::int64_t rows, std::int64_t columns) {
    return cube.length == length && cube.rows == rows && cube.columns == columns;
}

std::int64_t checked_read_actions(Matrix actions, Row<const bool> taken, Matrix limits, double share, Matrix planned,
                                  double slow, Cube<double> targets, Table<double> held_before, Table<double> commands,
                                  Row<std::int64_t> clipped) {
    const std::int64_t count = taken.length;
    require(has_shape(actions, count, 2) && has_shape(limits, 7, 2) && has_shape(held_before, count, 2) &&
                has_shape(commands, count, 2) && clipped.length == count && has_shape(targets, 2, count, 2) &&
                (planned.rows == 0 || has_shape(planned, count, 2)),
            "the arrays of actions are not those of as many cars");
    return read_actions(actions, taken, limits, share, planned, slow, targets, held_before, commands, clipped);
}

void check_rewards(std::int64_t count, std::int64_t names, const Row<double>& rewards, const Cube<double>& terms) {
    require(names >= 4 && rewards.length == count && has_shape(terms, 2, names, count),
            "rewards are not (n,), or terms not (2, 4 or more, n)");
}

void checked_reward_ticks(Row<const bool> driven, Numbers progress, Row<double> before, Row<const bool> crashed,
                          Numbers sliding, Numbers impacts, Numbers weights, double share, bool alone,
                          Row<double> rewards, Cube<double> terms) {
    const std::int64_t count = driven.length;
    check_rewards(count, terms.rows, rewards, terms);
    require(progress.length == count && before.length == count && crashed.length == count &&
                sliding.length == count && impacts.length == count && weights.length == 4,
            "the arrays of a tick are not (n,), or weights are not (4,)");
    reward_ticks(driven, progress, before, crashed, sliding, impacts, weights, share, alone, rewards, terms);
}

void check_parts(const SensorParts& parts, std::int64_t columns) {
    require(are_within(parts.columns, columns) && parts.low.length == parts.columns.length &&
                parts.high.length == parts.columns.length,
            "a column of an observation, or its bounds, are not there");
}

void check_room(const SensorParts& parts, std::int64_t count, const Table<float>& scan, const Table<float>& values) {
    require(scan.rows == count && values.rows == count && values.columns == parts.columns.length &&
                (scan.columns == 0 || scan.columns == parts.beams.length),
            "scan and values are not (n, beams seen) and (n, k)");
}

void checked_read_sensors(std::int64_t stride, Matrix ranges, Matrix odometry, Matrix actions, Matrix planned,
                          Row<const std::int64_t> beams, double range_max, Row<const std::int64_t> columns,
                          Row<const float> low, Row<const float> high, Table<float> scan, Table<float> values) {
    const SensorParts parts{beams, range_max, columns, low, high};
    const std::int64_t count = scan.rows;
    const bool acted = has_shape(actions, count, 2), corrected = has_shape(planned, count, 2);
    require(stride > 0 && ranges.rows >= count * stride && odometry.rows >= count * stride &&
                are_within(beams, ranges.columns),
            "ranges or odometry have not the rows of all cars, or not all beams");
    check_parts(parts, odometry.columns + (acted && corrected ? 4 : acted ? 2 : 0));
    check_room(parts, count, scan, values);
    read_sensors({stride, ranges, odometry, actions, planned}, parts, scan, values);
}

// Check those arrays of a step that are indexed by others.
void check_step(const StepArrays& arrays) {
    const SensorReadings& readings = arrays.readings;
    const std::int64_t count = arrays.driven.length;
    require(readings.stride > 0 && readings.ranges.rows >= count * readings.stride &&
                has_shape(arrays.targets, 2, count, 2) && are_within(arrays.parts.beams, readings.ranges.columns),
            "the arrays of a step are not those of as many cars, or not all beams are there");
    check_rewards(count, arrays.terms.rows, arrays.rewards, arrays.terms);
    check_parts(arrays.parts, readings.odometry.columns + (readings.planned.rows == count ? 4 : 2));
}

void check_actions(const StepArrays& arrays, const Matrix& actions) {
    require(has_shape(actions, arrays.driven.length, 2), "actions are not (n, 2)");
}

void check_frame(Row<const bool> which, const Table<const float>& frame, std::int64_t count, std::int64_t width) {
    require(frame.rows == which.length && count == which.length && width == frame.columns,
            "the arrays of frames are not those of as many cars and columns");
}

void bind_step(nb::module_& module) {
    nb::class_<StepArrays>(module, "StepArrays")
        .def("__init__",
             [](StepArrays* self, std::int64_t table) {
                 new (self) StepArrays(table);
                 check_step(*self);
             },
             "table"_a)
        .def("act",
             [](const StepArrays& arrays, Matrix actions) {
                 check_actions(arrays, actions);
                 return act(arrays, actions);
             },
             "actions"_a)
        .def("note", [](const StepArrays& arrays) { note(arrays, 0, arrays.driven.length); })
        .def("reward", &reward)
        .def("drive_worlds", &drive_worlds, "tables"_a, "firsts"_a, WithoutGil())
        .def("step",
             [](const StepArrays& arrays, Row<const std::int64_t> tables, Row<const std::int64_t> firsts,
                Matrix actions) {
                 check_actions(arrays, actions);
                 return step(arrays, tables, firsts, actions);
             },
             "tables"_a, "firsts"_a, "actions"_a, WithoutGil())
        .def("read",
             [](const StepArrays& arrays, Table<float> scan, Table<float> values) {
                 check_room(arrays.parts, arrays.driven.length, scan, values);
                 read(arrays, scan, values);
             },
             "scan"_a, "values"_a, WithoutGil())
        .def("observe",
             [](const StepArrays& arrays, Row<const std::int64_t> tables, Row<const std::int64_t> firsts,
                Row<const bool> which, Table<float> scan, Table<float> values) {
                 check_room(arrays.parts, arrays.driven.length, scan, values);
                 require(which.length == arrays.driven.length, "which is not (n,)");
                 observe(arrays, tables, firsts, which, scan, values);
             },
             "tables"_a, "firsts"_a, "which"_a, "scan"_a, "values"_a, WithoutGil());
}

void bind_frames(nb::module_& module) {
    module.def("shift",
               [](Row<const bool> which, Row<const bool> fresh, Table<float> frame, Cube<float> delayed,
                  Row<const std::int64_t> delays) {
                   check_frame(which, frame, delayed.length, delayed.columns);
                   require(fresh.length == which.length && delays.length == frame.columns &&
                               are_within(delays, delayed.rows),
                           "a delay is longer than the ring");
                   shift(which, fresh, frame, delayed, delays);
               },
               "which"_a, "fresh"_a, "frame"_a, "delayed"_a, "delays"_a, WithoutGil());
    module.def("scale",
               [](Row<const bool> which, Row<const float> scales, Row<const bool> saturates, Table<float> frame) {
                   check_frame(which, frame, frame.rows, scales.length);
                   require(saturates.length == scales.length, "there are not as many scales as saturates");
                   scale(which, scales, saturates, frame);
               },
               "which"_a, "scales"_a, "saturates"_a, "frame"_a, WithoutGil());
    module.def("remember",
               [](Row<const bool> which, Row<const bool> fresh, Table<const float> frame,
                  Row<const std::int64_t> columns, Cube<float> ring, Row<std::int64_t> last) {
                   check_frame(which, frame, ring.length, frame.columns);
                   require(fresh.length == which.length && last.length == which.length && ring.rows > 0 &&
                               ring.columns == columns.length && are_within(columns, frame.columns) &&
                               are_within(last, ring.rows),
                           "the ring is not (n, places, columns)");
                   remember(which, fresh, frame, columns, ring, last);
               },
               "which"_a, "fresh"_a, "frame"_a, "columns"_a, "ring"_a, "last"_a, WithoutGil());
    module.def("recall",
               [](Cube<const float> ring, Row<const std::int64_t> last, std::int64_t every, Cube<float> found) {
                   require(found.length == ring.length && found.columns == ring.columns && every > 0 &&
                               last.length == ring.length && are_within(last, ring.rows),
                           "ring and found are not (n, places, width) and (n, length, width)");
                   recall(ring, last, every, found);
               },
               "ring"_a, "last"_a, "every"_a, "found"_a, WithoutGil());
}

}  // namespace

void bind_envs(nb::module_& module) {
    bind_step(module);
    bind_frames(module);
    module.def("read_actions", &checked_read_actions, "actions"_a, "taken"_a, "limits"_a, "share"_a, "planned"_a,
               "slow"_a, "targets"_a, "held_before"_a, "commands"_a, "clipped"_a);
    module.def("reward_ticks", &checked_reward_ticks, "driven"_a, "progress"_a, "before"_a, "crashed"_a, "sliding"_a,
               "impacts"_a, "weights"_a, "share"_a, "alone"_a, "rewards"_a, "terms"_a);
    module.def("sum_terms",
               [](Row<const bool> driven, Row<const bool> running, double share, Row<double> rewards,
                  Cube<double> terms) {
                   check_rewards(driven.length, running.length, rewards, terms);
                   return sum_terms(driven, running, share, rewards, terms);
               },
               "driven"_a, "running"_a, "share"_a, "rewards"_a, "terms"_a);
    module.def("read_sensors", &checked_read_sensors, "stride"_a, "ranges"_a, "odometry"_a, "actions"_a, "planned"_a,
               "beams"_a, "range_max"_a, "columns"_a, "low"_a, "high"_a, "scan"_a, "values"_a, WithoutGil());
    module.def("take_contacts",
               [](Row<const std::int64_t> tables, Row<const std::int64_t> firsts, std::int64_t how,
                  Row<std::int64_t> counts, Row<double> touched_at, Row<bool> began) {
                   require(counts.length == began.length && touched_at.length == began.length,
                           "counts, touched_at and began are not (r,)");
                   take_all_contacts(tables, firsts, static_cast<OnContact>(how), {counts, touched_at, began});
               },
               "tables"_a, "firsts"_a, "how"_a, "counts"_a, "touched_at"_a, "began"_a);
    module.def("note_judged", &note_judged, "table"_a, "driven"_a, "substeps"_a);
    module.def("note_slips", &note_slips, "table"_a, "driven"_a);
    module.def("heading_errors",
               [](Matrix poses, Numbers places, Matrix table, Row<double> errors) {
                   require(poses.columns == 3 && places.length == poses.rows && errors.length == poses.rows &&
                               table.rows >= 5 && table.columns > 0,
                           "poses, places and errors are not (n, 3), (n,) and (n,), or table is none of a course");
                   heading_errors(poses, places, table, errors);
               },
               "poses"_a, "places"_a, "table"_a, "errors"_a);
}

}  // namespace fg
