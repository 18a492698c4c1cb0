// Touches of walls and obstacles that do not end an episode: the car stops there, or goes on as it comes off.
#pragma once
#include <cstdint>

#include "../simulation/compiled_tick.hpp"

namespace fg {

// What the touch of a wall does: numbers in ON_CONTACT of fg_mujoco/envs/contacts.py.
enum class OnContact : std::int64_t { end, stop, goes_on };

// The touches of all cars (r,), as the Contacts of Python keep them.
struct Touches {
    Row<std::int64_t> counts;
    Row<double> touched_at;  // [s]
    Row<bool> began;
};

// Count new touches of cars whose rows begin at `first`, stop them, and let them race on.
void take_contacts(const WorldArrays& worlds, std::int64_t first, OnContact how, const Touches& touches);

// The same for each of several tables; `firsts` are the first rows of their cars.
void take_all_contacts(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, OnContact how,
                       const Touches& touches);

}  // namespace fg
