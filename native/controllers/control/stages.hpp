// Stages: what stands between a planner's reference and the car's command, for many worlds.
#pragma once
#include <cstdint>

#include "../../core/array_table.hpp"
#include "../../core/arrays.hpp"
#include "../../core/records.hpp"
#include "../../messages.hpp"
#include "../perception/scan_geometry.hpp"
#include "../safety/braking_trajectories.hpp"
#include "driving.hpp"

namespace fg {

// Type of the record of a stage, or of a planner, that keeps nothing.
struct NoMemory {
    std::int8_t unused;
};
FG_RECORD(NoMemory, unused);

// What a stage knows of one world in one tick, and what it writes to.
struct Tick {
    ScanGeometry& geometry;  // of the scan; it and `odometry` are in the velocity frame (slip) from `guide` on, for a
    Odometry& odometry;      // car whose tires need slip angles
    Row<double> ranges;      // readings (n,) [m], without NaN or inf
    Row<double> ranges_without_cars;    // the same for guidance: a planner that sees other cars has taken them out
    Row<double> ranges_without_movers;  // the same without what moves; undefined where memory.predictions has no rows
    Driver& driver;                     // the planner's car, settings and limits
    Matrix line;                        // the planner's line through the map (points, columns); no points without a map
    const Trajectories& trajectories;   // its braking trajectories; undefined for a planner without `sight`
    Reference& reference;               // written to
    DrivingMemory& memory;              // what driving keeps from tick to tick, written to
    Table<double> debug;                // (4, beams) [m] for pictures, as IntermediateScans; written to
    Row<double> command;                // (2,) steering angle [rad] and speed [m/s], written to
    TickRecord& record;                 // with the records above; who writes the command sets `record.decided`
};

// The arrays of a batch of n worlds, in the order of its table.
struct BatchArrays {
    Row<const ScanGeometry> geometry;  // (1,)
    Matrix measured;                   // (n, beams) [m]
    Row<const Odometry> odometry;      // (n,)
    Row<const bool> running;           // (n,)
    Row<TickRecord> ticks;             // (n,)
    Matrix lines;                      // (points, columns) of the lines through the map, of all planners
    Row<const Trajectories> trajectories;  // (tables,) of all planners
    Table<double> ranges;                  // (n, beams) [m]; this and the following as in Tick
    Table<double> ranges_without_cars;
    Table<double> ranges_without_movers;
    Table<double> debug;
    Table<double> commands;
};

// Call functions by their addresses (k, 2): each address of a function of C, and the number that it is called with.
void call_all(Table<const std::int64_t> calls);

// The arrays of one stage, in the order of its table: those of its batch, the worlds that have the stage, its states.
struct StageArrays {
    BatchArrays batch;
    Row<const bool> active;  // (n,)
    ArrayPlace states;       // (n,) of the stage's own type

    bool calls(std::int64_t world) const { return batch.running[world] && active[world]; }
};

// Return the arrays of a stage whose table is at an address.
StageArrays stage_at(std::int64_t address);

// Return a tick of a world.
Tick tick_of(const BatchArrays& batch, std::int64_t world);

// Take the readings and the odometry of all running worlds, from the arrays of the batch's table at an address.
void see_at(std::int64_t address);

// Call a step for all running worlds that have its stage, whose table is at an address.
void for_each_world(std::int64_t address, void (*step)(const Tick&));

// The same of a step with a state, which it keeps from tick to tick in each world; zero at the beginning.
template <class State> void for_each_world(std::int64_t address, void (*step)(const Tick&, State&)) {
    const StageArrays stage = stage_at(address);
    const Row<State> states = stage.states.row<State>();
    for (std::int64_t world = 0; world < stage.active.length; ++world)
        if (stage.calls(world)) step(tick_of(stage.batch, world), states[world]);
}

}  // namespace fg
