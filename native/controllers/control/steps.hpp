// The steps of a tick as functions of C: each takes the address of a table of arrays, as planner_batch.py makes them.
#pragma once
#include <cstdint>

#include "../../core/arrays.hpp"

extern "C" {

// Of the table of a batch: take the readings and the odometry of all running worlds.
void fg_see(std::int64_t address) noexcept;

// Of the table of a stage, for all running worlds that have it; see decision.hpp.
void fg_predict(std::int64_t address) noexcept;
void fg_refer_by_gap_finder(std::int64_t address) noexcept;
void fg_begin(std::int64_t address) noexcept;
void fg_guide_reference(std::int64_t address) noexcept;
void fg_drive(std::int64_t address) noexcept;
void fg_drive_held(std::int64_t address) noexcept;
void fg_drive_in_sight(std::int64_t address) noexcept;
void fg_drive_filtered(std::int64_t address) noexcept;

// See lap_raceline.hpp.
void fg_remember(std::int64_t address) noexcept;
}

namespace fg {

// A step, and the name by which Python asks for its address.
struct NamedStep {
    const char* name;
    void (*call)(std::int64_t address) noexcept;
};

// Return all steps.
Row<const NamedStep> steps();

}  // namespace fg
