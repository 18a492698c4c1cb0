// Counts touches, and stops cars.
#include "contacts.hpp"

#include <algorithm>

namespace fg {
namespace {

// Stop a car of a world: its links and its tires.
void stop(const WorldArrays& worlds, std::int64_t row) {
    const StateLayout& layout = worlds.places.layout;
    const std::int64_t cars_per_world = worlds.car_places.length, car = row % cars_per_world;
    const Row<double> state = worlds.states[row / cars_per_world];
    const auto clear = [&](std::int64_t first, std::int64_t behind) {
        const Row<double> part = state.part(first, behind);
        std::fill_n(part.data, part.length, 0.0);
    };
    const std::int64_t next = car == cars_per_world - 1 ? layout.qvel[1] : layout.qvel[0] + worlds.cars[row + 1].free_dof;
    clear(layout.qvel[0] + worlds.cars[row].free_dof, next);
    const std::int64_t first_tire = worlds.car_places[car].first_tire;
    const std::int64_t tires = layout.userdata[0] + tire_numbers * first_tire;
    if (first_tire >= 0) clear(tires, tires + 4 * tire_numbers);
}

}  // namespace

void take_contacts(const WorldArrays& worlds, std::int64_t first, OnContact how, const Touches& touches) {
    const std::int64_t cars_per_world = worlds.car_places.length;
    for (std::int64_t k = 0; k < worlds.crashed.length; ++k) {
        const std::int64_t row = first + k;
        bool& began = touches.began[row];
        began = false;
        if (!worlds.crashed[k]) continue;
        const double time = worlds.time(k / cars_per_world);
        began = time - touches.touched_at[row] > apart;
        touches.counts[row] += began;
        touches.touched_at[row] = time, worlds.crashed[k] = false;
        if (how == OnContact::stop) stop(worlds, k);
    }
}

void take_all_contacts(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, OnContact how,
                       const Touches& touches) {
    for (std::int64_t k = 0; k < tables.length; ++k) take_contacts(WorldArrays(tables[k]), firsts[k], how, touches);
}

}  // namespace fg
