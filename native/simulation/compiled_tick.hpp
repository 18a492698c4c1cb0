// A tick and its parts, of the arrays of some worlds: what the cars sense, how they are driven, and what becomes of it.
// Arrays have one row a car: the cars of world 0, then those of world 1, and so on (r,). A state has one row a world
// (n,). Python hands the arrays over in a table (fg_mujoco/native_arrays.py), by its address;
// fg_mujoco/simulation/compiled_tick.py says more of them.
#pragma once
#include <cstdint>
#include <utility>

#include "../core/array_table.hpp"
#include "../course/lap_timer.hpp"
#include "../lidar/links.hpp"
#include "../lidar/scanline.hpp"
#include "../vehicle/mujoco_library.hpp"
#include "../vehicle/tire_solve.hpp"
#include "clear_ground.hpp"
#include "physics.hpp"
#include "telemetry.hpp"
#include "world_step.hpp"

namespace fg {

// The array `places`.
struct WorldPlaces {
    std::int64_t cars_per_world;
    mjBatch* batch;
    std::int64_t laps;
    std::int64_t first_state;  // the number in the batch of the first world's state
    StateLayout layout;
};
static_assert(sizeof(WorldPlaces) == 15 * 8);

// The array `times`.
struct CourseNumbers {
    double timestep;         // [s]
    double length, modulus;  // [m] of the course
    double stop_time;        // [s]
    double last_time;        // [s] half a tick before the time limit
};

// The array `span`: which steps of a tick `step` does, in how many worlds of `ids`; if not `advance` only forces.
struct StepSpan {
    std::int64_t first, end, advance, count;
};

// The array `alone`, see fg_mujoco/simulation/cars_alone.py.
struct CarsAlone {
    const mjModel* model;
    mjData* data;
};

// A row of `copies`: `count` numbers go from `from`, that of world 0, to `to`; worlds are `apart` [bytes].
struct FieldCopy {
    double* to;
    const char* from;
    std::int64_t count, apart;
};

// The arrays of some worlds: those of Python's NAMES, where `scene`, `scene_scratch`, `floor`, `inertia` and `ground`
// are several of them, and `course_table` is `table`.
struct WorldArrays {
    // Take the views from a table of the arrays of NAMES.
    explicit WorldArrays(std::int64_t address);

    const WorldPlaces& places;
    Row<bool> running;
    Table<double> states, sensors;
    Row<const Car> cars;
    Row<LapTimer> timers;
    Row<Odometry> odometry;
    Row<TelemetryRow> telemetry;
    Matrix offset_positions;
    Cube<const double> offset_rotations;
    Matrix motions;
    Scene scene;
    Scratch scene_scratch;
    Table<double> ranges;
    Row<const Optics> optics;
    Matrix commands;
    const CourseNumbers& times;
    Cube<double> records;
    Row<std::int32_t> ids;
    Row<const std::int32_t> status;
    Row<bool> failed;
    Matrix mu;
    Cube<double> slip;
    Row<bool> crashed;
    Row<Statistics> statistics;
    Row<std::int64_t> reasons;
    Table<const std::int32_t> warnings;
    Table<double> lap_times;
    Row<double> standing_since;
    Matrix course_table;
    Row<const Tire> tires;
    Cube<double> tire_states;
    Floor floor;
    Row<const CarPlaces> car_places;
    Row<const Link> links;
    Table<const std::int64_t> touch_places;
    Table<double> touched_at;
    const Sizes& sizes;
    StepSpan& span;
    Inertia inertia;
    Row<const Gear> gears;
    Row<double> scratch;
    ClearGround ground;
    Row<std::int32_t> state_numbers;
    const CarsAlone* alone;  // null: there is none
    Row<const FieldCopy> copies;
    Matrix pieces;  // (k, 5) of walls that can be pushed, see pieces.hpp

    // The part of the state of a world that its positions, velocities or controls are.
    Row<double> qpos(std::int64_t world) const { return part(world, places.layout.qpos); }
    Row<double> qvel(std::int64_t world) const { return part(world, places.layout.qvel); }
    Row<double> ctrl(std::int64_t world) const { return part(world, places.layout.ctrl); }
    double time(std::int64_t world) const { return states[world][places.layout.time]; }

private:
    explicit WorldArrays(Row<const ArrayPlace> table);

    Row<double> part(std::int64_t world, const std::array<std::int64_t, 2>& span) const {
        return states[world].part(span[0], span[1]);
    }
};

// Time without touching each other after which two cars touch anew [s].
constexpr double apart = 0.5;

// How whole ticks end: driven, or not: after a decision over its limit, or because a command is no number.
enum class TickEnd : std::int64_t { driven, late, no_numbers };

// Write the odometry of the cars `which` (r,), and the first columns of their rows of telemetry.
void read(const WorldArrays& worlds, Row<const bool> which);

// Let `step` do steps `first` up to `end` of a tick in the first `count` worlds of `ids`.
void begin_steps(const WorldArrays& worlds, std::int64_t count, std::int64_t first, std::int64_t end, bool advance);

// Do the physics steps of `span`.
void step(const WorldArrays& worlds);

// Note failures, touches, telemetry and statistics of a tick's steps in the first `count` worlds of `ids`.
void book(const WorldArrays& worlds, std::int64_t count);

// Write the commands of all cars of the first `count` worlds of `ids` to their actuators, and to the telemetry.
void hold(const WorldArrays& worlds, std::int64_t count);

// Hold the commands for a tick in worlds where any car races, and write what tires and chassis did meanwhile.
void drive(const WorldArrays& worlds);

// Time the laps of the cars that race and end what is over, see `judge_cars`; without a course there are none.
void judge(const WorldArrays& worlds);

// End the races of the cars whose engine has failed.
void end_failed(const WorldArrays& worlds);

// Return how many cars the worlds have.
inline std::int64_t cars_of(const WorldArrays& worlds) { return worlds.running.length; }

// The same for each of several tables, by their addresses; `firsts` are the first rows of their cars in `which`.
void read_all(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, Row<const bool> which);
void sense_all(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, Row<const bool> which);
void drive_all(Row<const std::int64_t> tables);
void judge_all(Row<const std::int64_t> tables);

// Write the time of each world (n,) of several tables [s]; `firsts` as in `read_all`.
void read_times(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, Row<double> times);

// Do `read_motions` for each of several tables, as `read_all`; all arrays have the rows of `which`.
void read_motions_all(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, Row<const bool> which,
                      Table<double> poses, Table<double> velocities);

// Do several ticks of worlds of one car; return how the worst of them ended, and how many the last world did.
// A world does all its ticks before the next one, so that what it remembers stays near the processor. A car whose
// command is no number is not driven, and does none of the ticks that follow. A single tick all worlds do together, and
// none is driven then.
//   calls: (k, 2) of the planners: addresses of functions, `void (*)(std::int64_t)`, and what they are called with.
//   limit: of a decision [s].
//   kept: address of a table of KEPT; for more than a tick, of one world.
//   took: (k,) [s] of each decision of the last world, written to; of one that raises, less the time of its beginning.
//   waiting: (r,) false; where a decision raises, the cars that run and are not marked as running are left there.
std::pair<TickEnd, std::int64_t> ticks(const WorldArrays& worlds, Table<const std::int64_t> calls, double limit,
                                       std::int64_t kept, Row<double> took, Row<bool> waiting);

}  // namespace fg
