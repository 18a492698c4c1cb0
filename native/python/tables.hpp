// What each room adds to the tables that Python looks in: steps of planners (STEPS), layouts of records (RECORDS).
#pragma once
#include <nanobind/nanobind.h>

#include "../controllers/control/steps.hpp"
#include "../core/records.hpp"

namespace fg {

// By name: functions in C of the address of a stage's table, see planner_batch.py.
inline void add_steps(nanobind::module_& module, Row<const NamedStep> steps) {
    nanobind::dict addresses = module.attr("STEPS");
    for (std::int64_t i = 0; i < steps.length; ++i)
        addresses[steps[i].name] = reinterpret_cast<std::intptr_t>(steps[i].call);
}

// By name: size and offsets of the fields [bytes].
template <class Record>
void add_layout(nanobind::module_& module, const char* name) {
    const Layout layout = layout_of<Record>();
    nanobind::dict fields, records = module.attr("RECORDS");
    for (const auto& [field, offset] : layout.fields) fields[field] = offset;
    records[name] = nanobind::make_tuple(layout.size, fields);
}

}  // namespace fg

#define FG_ADD(Record) add_layout<Record>(module, #Record)
