// Tables of arrays as the records of worlds: the tables are made by controllers/control/planner_batch.py.
#include "stages.hpp"

#include "../../core/numbers.hpp"
#include "../perception/scan_filters.hpp"

namespace fg {
namespace {

constexpr int batch_arrays = 12, stage_arrays = 3;

// Return the arrays of a batch whose table is at an address.
BatchArrays batch_at(std::int64_t address) {
    const Row<const ArrayPlace> places = table_at(address, batch_arrays);
    return {places[0].row<const ScanGeometry>(),
            places[1].table<const double>(),
            places[2].row<const Odometry>(),
            places[3].row<const bool>(),
            places[4].row<TickRecord>(),
            places[5].table<const double>(),
            places[6].row<const Trajectories>(),
            places[7].table<double>(),
            places[8].table<double>(),
            places[9].table<double>(),
            places[10].table<double>(),
            places[11].table<double>()};
}

}  // namespace

void call_all(Table<const std::int64_t> calls) {
    for (std::int64_t i = 0; i < calls.rows; ++i)
        reinterpret_cast<void (*)(std::int64_t)>(calls[i][0])(calls[i][1]);
}

StageArrays stage_at(std::int64_t address) {
    const Row<const ArrayPlace> places = table_at(address, stage_arrays);
    return {batch_at(places[0].address), places[1].row<const bool>(), places[2]};
}

Tick tick_of(const BatchArrays& batch, std::int64_t world) {
    TickRecord& tick = batch.ticks[world];
    const Driver& driver = tick.driver;
    const std::int64_t end = min(driver.line_end, batch.lines.rows), first = min(driver.line_first, end);
    return {tick.geometry,
            tick.odometry,
            batch.ranges[world],
            batch.ranges_without_cars[world],
            batch.ranges_without_movers[world],
            tick.driver,
            {batch.lines.data + first * batch.lines.columns, end - first, batch.lines.columns},
            batch.trajectories[driver.trajectories],
            tick.reference,
            tick.memory,
            batch.debug,
            batch.commands[world],
            tick};
}

void see_at(std::int64_t address) {
    const BatchArrays batch = batch_at(address);
    const ScanGeometry& geometry = batch.geometry[0];
    for (std::int64_t world = 0; world < batch.running.length; ++world) {
        if (!batch.running[world]) continue;
        write_valid_ranges(batch.ranges[world], batch.measured[world], geometry.range_max);
        TickRecord& tick = batch.ticks[world];
        tick.geometry = geometry, tick.odometry = batch.odometry[world], tick.decided = false;
        tick.odometry.angular_velocity[2] = yaw_rate_on_arc(tick.driver.limiter.slip, tick.driver.car, tick.odometry);
    }
}

void for_each_world(std::int64_t address, void (*step)(const Tick&)) {
    const StageArrays stage = stage_at(address);
    for (std::int64_t world = 0; world < stage.active.length; ++world)
        if (stage.calls(world)) step(tick_of(stage.batch, world));
}

}  // namespace fg
