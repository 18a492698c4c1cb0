// MuJoCo's batch calls `step_world`, and what MuJoCo raises in there leaves it by a jump: nothing that is called from
// there owns memory while MuJoCo functions run. In a build with FG_CHECK_BOUNDS an index out of range ends the process
// there, because no exception may pass through MuJoCo.
#include "compiled_tick.hpp"

#include <algorithm>
#include <mujoco/mjbatch.h>

#include "../core/numbers.hpp"
#include "../course/moving_obstacles.hpp"
#include "../lidar/body_poses.hpp"
#include "../lidar/scanline.hpp"
#include "../vehicle/tire_forces.hpp"
#include "../vehicle/tire_slip.hpp"
#include "clock.hpp"
#include "pieces.hpp"
#include "termination.hpp"

namespace fg {
namespace {

// The rows of a table, in the order of NAMES.
enum {
    PLACES, RUNNING, STATES, SENSORS, CARS, TIMERS, ODOMETRY, TELEMETRY, OFFSET_POSITIONS, OFFSET_ROTATIONS, MOTIONS,
    BEAMS,  // and the other arrays of a Scene
    CUTS = BEAMS + scene_arrays,  // and the other arrays of a Scratch
    RANGES = CUTS + scratch_arrays, OPTICS, COMMANDS, TIMES, RECORDS, IDS, STATUS, FAILED, MU, SLIP, CRASHED, STATISTICS, REASONS, WARNINGS, LAP_TIMES,
    STANDING_SINCE, COURSE_TABLE, TIRES, TIRE_STATES, PATCHES, WHEELS, FLOOR_MU, PAIRS, CAR_PLACES, LINKS, TOUCH_PLACES,
    TOUCHED_AT, SIZES, SPAN, ROW_COUNTS, ROW_STARTS, INERTIA_COLUMNS, GEARS, SCRATCH,
    DISTANCES, CORNER, BODIES, STATE_NUMBERS, ALONE, COPIES, PIECES, ARRAYS
};

// The rows of a table in which ticks are kept, in the order of KEPT.
enum { KEPT_TICKS, KEPT_TELEMETRY, KEPT_STATES, KEPT_CONTROLS, KEPT_ARRAYS };

constexpr std::int64_t most_turns = 64;  // in which worlds do their ticks: each looks through all for those that run
constexpr int state_parts = mjSTATE_INTEGRATION;

template <class T>
T& record(const ArrayPlace& place) {
    return *reinterpret_cast<T*>(place.address);
}

// The records that whole rows of a table are.
template <class T>
Row<T> records_of(const ArrayPlace& place) {
    return {reinterpret_cast<T*>(place.address), place.lengths[0]};
}

Floor floor_of(Row<const ArrayPlace> table) {
    return {
        table[PATCHES].table<const double>(), table[WHEELS].table<const double>(), table[FLOOR_MU].cube<double>(),
        table[PAIRS].row<const std::int32_t>(),
    };
}

// Where the bodies are that the LiDARs see moving: obstacles, then links of cars.
class MovingBodies {
public:
    explicit MovingBodies(const WorldArrays& worlds)
        : worlds_(worlds), count_(worlds.scene.frames.rows - 1), positions_(count_, 3), rotations_(count_, 9),
          poses_(worlds.links.length, 7) {
        for (std::int64_t k = 0; k < worlds.motions.rows; ++k)
            for (int axis = 0; axis < 3; ++axis) rotations_[k][4 * axis] = 1.0;
    }

    Matrix positions() const { return positions_; }
    Cube<const double> rotations() const { return rotations_from(0); }

    void place(std::int64_t world) const {
        const Matrix motions = worlds_.motions;
        for (std::int64_t k = 0; k < motions.rows; ++k) {
            const auto [x, y] = obstacle_position(motions[k], worlds_.time(world));
            positions_[k][0] = x, positions_[k][1] = y;
        }
        if (worlds_.links.length > 0) {
            const Table<double> all = positions_, linked{all.data + 3 * motions.rows, count_ - motions.rows, 3};
            place_links(worlds_.qpos(world), worlds_.links, poses_, linked, rotations_from(motions.rows));
        }
    }

private:
    Cube<double> rotations_from(std::int64_t first) const {
        const Table<double> all = rotations_;
        return {all.data + 9 * first, count_ - first, 3, 3};
    }

    const WorldArrays& worlds_;
    std::int64_t count_;
    OwnTable<double> positions_, rotations_, poses_;
};

// Do the physics steps of `span` in a world; return where they ended: `alone` where a car may touch something.
std::int64_t do_steps(const mjModel* model, mjData* data, std::int64_t world, const WorldArrays& worlds, bool alone) {
    const Sizes& sizes = worlds.sizes;
    const StepSpan& span = worlds.span;
    const std::int64_t cars_per_world = worlds.car_places.length;
    const Row<double> userdata{data->userdata, sizes.userdata};
    const Numbers readings{data->sensordata, sizes.readings};
    for (std::int64_t step = span.first; step < span.end; ++step) {
        place_obstacles(data, worlds.motions);
        const Matrix under =
            friction_under(model, data, world, step, sizes, worlds.car_places, worlds.cars, worlds.mu, worlds.floor);
        if (!sizes.own_tires) {
            step_on_contacts(model, data, worlds.gears, sizes.dofs);
        } else {
            const Row<const Car> own = worlds.cars.part(world * cars_per_world, (world + 1) * cars_per_world);
            const bool clear = touches_nothing({data->qpos, sizes.positions}, own, worlds.ground, Terrain(model));
            if (alone && !clear) return step;
            step_on_tires(model, data, worlds.inertia, worlds.gears, worlds.tires, under, userdata, worlds.scratch,
                          sizes.dofs, worlds.times.timestep, span.advance != 0, clear, step == span.end - 1);
        }
        if (span.advance) rub(data, worlds.pieces, worlds.times.timestep);
        const Row<double> sensors = worlds.sensors[world], record = worlds.records[world][step];
        for (std::int64_t k = 0; k < sizes.readings; ++k) sensors[k] = record[k] = readings[k];
        const Row<double> tire_states = worlds.tire_states[world][step];
        for (std::int64_t k = 0; k < sizes.userdata; ++k) tire_states[k] = userdata[k];
    }
    place_obstacles(data, worlds.motions);
    return span.end;
}

// Do the physics steps of `span` in a world, for MuJoCo's batch; `arrays` are WorldArrays.
void step_world(const mjModel* model, mjData* data, int state, void* arrays) {
    const WorldArrays& worlds = *static_cast<const WorldArrays*>(arrays);
    do_steps(model, data, state - worlds.places.first_state, worlds, false);
}

// Return whether MuJoCo has met a bad state since the data were reset.
bool has_warned(const mjData* data) {
    bool warned = false;
    for (int kind = mjWARN_BADQPOS; kind <= mjWARN_BADQACC; ++kind) warned = warned || data->warning[kind].number > 0;
    return warned;
}

// Do the steps of `span` in CarsAlone while the cars touch nothing, none in a bad state; return as `do_steps`.
std::int64_t step_alone(const WorldArrays& worlds, std::int64_t world) {
    const auto [model, data] = *worlds.alone;
    const std::int64_t first = worlds.span.first, cars_per_world = worlds.places.cars_per_world;
    const Row<const Car> cars = worlds.cars.part(world * cars_per_world, (world + 1) * cars_per_world);
    if (!touches_nothing(worlds.qpos(world), cars, worlds.ground)) return first;
    for (std::int64_t k = 0; k < worlds.copies.length; ++k) {
        const FieldCopy& field = worlds.copies[k];
        std::copy_n(reinterpret_cast<const double*>(field.from + world * field.apart), field.count, field.to);
    }
    double* const state = worlds.states[world].data;
    mujoco.mj_setState(model, data, state, state_parts);
    const std::int64_t end = do_steps(model, data, world, worlds, true);
    if (has_warned(data)) {
        mujoco.mj_resetData(model, data);
        return first;
    }
    mujoco.mj_getState(model, data, state, state_parts);
    return end;
}

// Return whether a contact sensor found anything in any of the rows of `records` (steps, nsensordata).
bool any_touch(Matrix records, std::int64_t sensor) {
    for (std::int64_t step = 0; step < records.rows; ++step)
        if (records[step][sensor] > 0.0) return true;
    return false;
}

// Note which other cars a car touched in a tick; return whether its chassis touched anything else.
//   records: (steps, nsensordata) of the tick.
//   touch_places: (cars,) where those with each other car are.
//   touched_at: (cars,) when it last touched each of them [s], -inf: not yet; `time` [s] is written to it.
bool book_touches(Matrix records, std::int64_t car, std::int64_t chassis_contact, Row<const std::int64_t> touch_places,
                  double time, Row<double> touched_at, Statistics& statistics) {
    for (std::int64_t other = 0; other < touch_places.length; ++other) {
        if (other == car || !any_touch(records, touch_places[other])) continue;
        if (time - touched_at[other] > apart) statistics.touches += 1;
        touched_at[other] = time;
    }
    for (std::int64_t step = 0; step < records.rows; ++step) {
        double count = records[step][chassis_contact];
        for (std::int64_t other = 0; other < touch_places.length; ++other)
            if (other != car) count -= records[step][touch_places[other]];
        if (count > 0.0) return true;
    }
    return false;
}

// Book a tick's steps for a car, by its row.
void book_car(const WorldArrays& worlds, std::int64_t world, std::int64_t row) {
    const std::int64_t cars_per_world = worlds.places.cars_per_world, car = row - world * cars_per_world;
    const CarPlaces& own = worlds.car_places[car];
    const double time = worlds.time(world);
    const Matrix records = worlds.records[world];
    TelemetryRow& telemetry = worlds.telemetry[row];
    Statistics& statistics = worlds.statistics[row];
    end_motion(time, worlds.qpos(world), worlds.qvel(world), worlds.cars.part(row, row + 1), telemetry);
    worlds.failed[row] = worlds.failed[row] || worlds.status[world] != 0;
    const bool races = worlds.running[row] || cars_per_world == 1;
    const bool touched_wall = cars_per_world == 1 ? any_touch(records, own.chassis_contact)
                                                  : book_touches(records, car, own.chassis_contact,
                                                                 worlds.touch_places[car], time, worlds.touched_at[row],
                                                                 statistics);
    worlds.crashed[row] = worlds.crashed[row] || (touched_wall && races);
    const bool has_tires = own.first_tire >= 0;
    const Row<const Tire> tires = has_tires ? worlds.tires.part(own.first_tire, own.first_tire + 4) : Row<const Tire>{};
    const std::int64_t first_number = has_tires ? tire_numbers * own.first_tire : 0;
    const bool on_patches = worlds.floor.patches.rows > 0;
    const OwnTable<double> had(on_patches ? worlds.floor.mu.length : 0, 4);
    for (std::int64_t step = 0; step < Table<double>(had).rows; ++step)
        for (int tire = 0; tire < 4; ++tire) had[step][tire] = worlds.floor.mu[step][row][tire];
    const Matrix mu = on_patches ? Matrix(had) : Matrix{worlds.mu[row].data, 1, 4};
    measure_slip(records, own.tires, own.axles, mu, tires, worlds.tire_states[world], first_number, worlds.slip);
    end_row(telemetry, worlds.slip);
    if (races) add_row(worlds.statistics, row, telemetry, worlds.slip);
}

// Write the numbers of the worlds in which any car runs into `ids` (n,), and return how many there are.
std::int64_t worlds_to_drive(Row<const bool> running, std::int64_t cars_per_world, Row<std::int32_t> ids) {
    std::int64_t count = 0;
    for (std::int64_t world = 0; world < running.length / cars_per_world; ++world) {
        bool runs = false;
        for (std::int64_t row = world * cars_per_world; row < (world + 1) * cars_per_world; ++row)
            runs = runs || running[row];
        if (runs) ids[count++] = static_cast<std::int32_t>(world);
    }
    return count;
}

bool is_command(Numbers command) { return std::isfinite(command[0]) && std::isfinite(command[1]); }

// Keep the tick that world 0 was driven for, in a table of KEPT with room for it; none: in one of empty arrays.
void keep(const WorldArrays& worlds, Row<const ArrayPlace> kept) {
    const Row<std::int64_t> ticks = kept[KEPT_TICKS].row<std::int64_t>();
    if (ticks.length == 0) return;
    const std::int64_t tick = ticks[0];
    const Cube<double> telemetry = kept[KEPT_TELEMETRY].cube<double>();
    const Numbers state = worlds.states[0], controls = worlds.ctrl(0);
    const double* const first = &worlds.telemetry[0].time;
    std::copy_n(first, telemetry.rows * telemetry.columns, telemetry[tick].data);
    std::copy_n(state.data, state.length, kept[KEPT_STATES].table<double>()[tick + 1].data);
    std::copy_n(controls.data, controls.length, kept[KEPT_CONTROLS].table<double>()[tick].data);
    ticks[0] = tick + 1;
}

// Read the odometry of the cars `which` (r,), and write what their LiDARs measure, where scans are drawn.
void sense(const WorldArrays& worlds, Row<const bool> which) {
    read(worlds, which);
    if (worlds.scene.beams.rows == 0) return;
    const std::int64_t cars_per_world = worlds.places.cars_per_world, first_qpos = worlds.places.layout.qpos[0];
    const MovingBodies moving(worlds);
    double position[3], rotation[3][3];
    std::int64_t placed = -1;
    for (std::int64_t row = 0; row < which.length; ++row) {
        if (!which[row]) continue;
        const std::int64_t world = row / cars_per_world, car = row - world * cars_per_world;
        if (world != placed) moving.place(world);
        placed = world;
        const CarPlaces& own = worlds.car_places[car];
        const Numbers state = worlds.states[world];
        const std::int64_t first = first_qpos + own.mount;
        mounted_pose(state.part(first, first + 3), state.part(first + 3, first + 7), own.level != 0,
                     worlds.offset_positions[car], worlds.offset_rotations[car], fg::row(position), table(rotation));
        scan(worlds.scene, worlds.scene_scratch, fg::row(position), table(rotation), moving.positions(),
             moving.rotations(), worlds.ranges[row], static_cast<int>(own.tree), worlds.optics[row]);
    }
}

// Sense, decide, drive, judge; return how it ended. `goes_on`: who has no number waits; else nobody is driven.
TickEnd tick(const WorldArrays& worlds, Table<const std::int64_t> calls, double limit, Row<const ArrayPlace> kept,
             double& took, Row<bool> waiting, bool goes_on) {
    const Row<bool> running = worlds.running;
    TickEnd how = TickEnd::driven;
    sense(worlds, running);
    const double began = seconds();
    took = -began;
    for (std::int64_t place = 0; place < calls.rows; ++place)
        reinterpret_cast<void (*)(std::int64_t)>(calls[place][0])(calls[place][1]);
    took = seconds() - began;
    if (took > limit) return TickEnd::late;
    for (std::int64_t row = 0; row < running.length; ++row)
        if (running[row] && !is_command(worlds.commands[row]))
            running[row] = !goes_on, waiting[row] = goes_on, how = TickEnd::no_numbers;
    if (how != TickEnd::driven && !goes_on) return how;
    drive(worlds);
    end_failed(worlds);
    if (how == TickEnd::driven) keep(worlds, kept);
    judge(worlds);
    return how;
}

bool any(Row<const bool> flags) {
    const bool* const end = flags.data + flags.length;
    return std::find(flags.data, end, true) != end;
}

// The views of several tables, and the rows of their cars.
template <class Work>
void each_table(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, const Work& work) {
    for (std::int64_t k = 0; k < tables.length; ++k) {
        const WorldArrays worlds(tables[k]);
        work(worlds, firsts[k], firsts[k] + cars_of(worlds));
    }
}

template <class T>
Table<T> part(Table<T> table, std::int64_t first, std::int64_t behind) {
    return {table.data + first * table.columns, behind - first, table.columns};
}

}  // namespace

WorldArrays::WorldArrays(std::int64_t address) : WorldArrays(table_at(address, ARRAYS)) {}

WorldArrays::WorldArrays(Row<const ArrayPlace> table)
    : places(record<const WorldPlaces>(table[PLACES])),
      running(table[RUNNING].row<bool>()),
      states(table[STATES].table<double>()),
      sensors(table[SENSORS].table<double>()),
      cars(table[CARS].row<const Car>()),
      timers(table[TIMERS].row<LapTimer>()),
      odometry(table[ODOMETRY].row<Odometry>()),
      telemetry(records_of<TelemetryRow>(table[TELEMETRY])),
      offset_positions(table[OFFSET_POSITIONS].table<const double>()),
      offset_rotations(table[OFFSET_ROTATIONS].cube<const double>()),
      motions(table[MOTIONS].table<const double>()),
      scene(scene_of(table.part(BEAMS, CUTS))),
      scene_scratch(scratch_of(table.part(CUTS, RANGES))),
      ranges(table[RANGES].table<double>()),
      optics(records_of<const Optics>(table[OPTICS])),
      commands(table[COMMANDS].table<const double>()),
      times(record<const CourseNumbers>(table[TIMES])),
      records(table[RECORDS].cube<double>()),
      ids(table[IDS].row<std::int32_t>()),
      status(table[STATUS].row<const std::int32_t>()),
      failed(table[FAILED].row<bool>()),
      mu(table[MU].table<const double>()),
      slip(table[SLIP].cube<double>()),
      crashed(table[CRASHED].row<bool>()),
      statistics(table[STATISTICS].row<Statistics>()),
      reasons(table[REASONS].row<std::int64_t>()),
      warnings(table[WARNINGS].table<const std::int32_t>()),
      lap_times(table[LAP_TIMES].table<double>()),
      standing_since(table[STANDING_SINCE].row<double>()),
      course_table(table[COURSE_TABLE].table<const double>()),
      tires(table[TIRES].row<const Tire>()),
      tire_states(table[TIRE_STATES].cube<double>()),
      floor(floor_of(table)),
      car_places(records_of<const CarPlaces>(table[CAR_PLACES])),
      links(table[LINKS].row<const Link>()),
      touch_places(table[TOUCH_PLACES].table<const std::int64_t>()),
      touched_at(table[TOUCHED_AT].table<double>()),
      sizes(record<const Sizes>(table[SIZES])),
      span(record<StepSpan>(table[SPAN])),
      inertia{table[ROW_COUNTS].row<const std::int32_t>(), table[ROW_STARTS].row<const std::int32_t>(),
              table[INERTIA_COLUMNS].row<const std::int32_t>()},
      gears(table[GEARS].row<const Gear>()),
      scratch(table[SCRATCH].row<double>()),
      ground{table[DISTANCES].table<const double>(), table[CORNER].row<const double>(),
             table[BODIES].table<const double>()},
      state_numbers(table[STATE_NUMBERS].row<std::int32_t>()),
      alone(table[ALONE].lengths[0] > 0 ? &record<const CarsAlone>(table[ALONE]) : nullptr),
      copies(records_of<const FieldCopy>(table[COPIES])),
      pieces(table[PIECES].table<const double>()) {}

void read(const WorldArrays& worlds, Row<const bool> which) {
    for (std::int64_t row = 0; row < which.length; ++row) {
        if (!which[row]) continue;
        const std::int64_t world = row / worlds.places.cars_per_world;
        const Row<const Car> car = worlds.cars.part(row, row + 1);
        const double time = worlds.time(world);
        const Numbers qpos = worlds.qpos(world), qvel = worlds.qvel(world);
        read_odometry(time, qpos, qvel, worlds.sensors[world], car, worlds.odometry.part(row, row + 1));
        begin_row(time, qpos, qvel, car, worlds.timers, row, worlds.telemetry[row]);
    }
}

void begin_steps(const WorldArrays& worlds, std::int64_t count, std::int64_t first, std::int64_t end, bool advance) {
    worlds.span = {first, end, advance, count};
}

void step(const WorldArrays& worlds) {
    StepSpan& span = worlds.span;
    const auto [first, end, advance, count] = span;
    const Row<std::int32_t> ids = worlds.ids, states = worlds.state_numbers;
    const auto first_state = static_cast<std::int32_t>(worlds.places.first_state);
    const auto apply = [&](std::int64_t together) {
        mujoco.mjb_apply(worlds.places.batch, states.data, static_cast<int>(together), step_world,
                         const_cast<WorldArrays*>(&worlds), 1);
    };
    if (!(advance && worlds.alone)) {
        for (std::int64_t place = 0; place < count; ++place) states[place] = ids[place] + first_state;
        if (first < end) apply(count);
        return;
    }
    for (std::int64_t place = 0; place < count; ++place) {
        span.first = first, states[0] = ids[place] + first_state;
        span.first = step_alone(worlds, ids[place]);
        if (span.first < end) apply(1);
    }
}

void book(const WorldArrays& worlds, std::int64_t count) {
    const std::int64_t cars_per_world = worlds.places.cars_per_world;
    for (std::int64_t place = 0; place < count; ++place) {
        const std::int64_t world = worlds.ids[place];
        for (std::int64_t row = world * cars_per_world; row < (world + 1) * cars_per_world; ++row)
            book_car(worlds, world, row);
    }
}

void hold(const WorldArrays& worlds, std::int64_t count) {
    const std::int64_t cars_per_world = worlds.places.cars_per_world;
    for (std::int64_t place = 0; place < count; ++place) {
        const std::int64_t world = worlds.ids[place];
        for (std::int64_t row = world * cars_per_world; row < (world + 1) * cars_per_world; ++row) {
            const Numbers command = worlds.commands[row];
            drive(command[0], command[1], worlds.cars.part(row, row + 1), worlds.ctrl(world));
            for (int part = 0; part < 2; ++part)
                worlds.telemetry[row].command[part] = min(max(command[part], -greatest_command), greatest_command);
        }
    }
}

void drive(const WorldArrays& worlds) {
    const std::int64_t count = worlds_to_drive(worlds.running, worlds.places.cars_per_world, worlds.ids);
    hold(worlds, count);
    if (count == 0) return;
    begin_steps(worlds, count, 0, worlds.records.rows, true);
    step(worlds);
    book(worlds, count);
}

void judge(const WorldArrays& worlds) {
    if (worlds.course_table.rows == 0) return;
    const CourseNumbers& times = worlds.times;
    judge_cars(worlds.running, worlds.reasons, worlds.places.cars_per_world, worlds.states, worlds.places.layout,
               worlds.cars, worlds.warnings, worlds.crashed, worlds.timers, worlds.lap_times, worlds.standing_since,
               worlds.course_table, times.length, times.modulus, times.stop_time, worlds.places.laps, times.last_time);
}

void end_failed(const WorldArrays& worlds) {
    for (std::int64_t row = 0; row < worlds.running.length; ++row)
        if (worlds.running[row] && worlds.failed[row])
            worlds.running[row] = false, worlds.reasons[row] = reason::failed;
}

void read_all(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, Row<const bool> which) {
    each_table(tables, firsts, [&](const WorldArrays& worlds, std::int64_t first, std::int64_t behind) {
        read(worlds, which.part(first, behind));
    });
}

void sense_all(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, Row<const bool> which) {
    each_table(tables, firsts, [&](const WorldArrays& worlds, std::int64_t first, std::int64_t behind) {
        sense(worlds, which.part(first, behind));
    });
}

void drive_all(Row<const std::int64_t> tables) {
    for (std::int64_t k = 0; k < tables.length; ++k) drive(WorldArrays(tables[k]));
}

void judge_all(Row<const std::int64_t> tables) {
    for (std::int64_t k = 0; k < tables.length; ++k) judge(WorldArrays(tables[k]));
}

void read_times(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, Row<double> times) {
    each_table(tables, firsts, [&](const WorldArrays& worlds, std::int64_t first, std::int64_t) {
        first /= worlds.places.cars_per_world;
        for (std::int64_t world = 0; world < worlds.states.rows; ++world) times[first + world] = worlds.time(world);
    });
}

void read_motions_all(Row<const std::int64_t> tables, Row<const std::int64_t> firsts, Row<const bool> which,
                      Table<double> poses, Table<double> velocities) {
    each_table(tables, firsts, [&](const WorldArrays& worlds, std::int64_t first, std::int64_t behind) {
        const StateLayout& layout = worlds.places.layout;
        read_motions(which.part(first, behind), worlds.places.cars_per_world, worlds.states, layout.qpos[0],
                     layout.qvel[0], worlds.cars, part(poses, first, behind), part(velocities, first, behind));
    });
}

std::pair<TickEnd, std::int64_t> ticks(const WorldArrays& worlds, Table<const std::int64_t> calls, double limit,
                                       std::int64_t kept, Row<double> took, Row<bool> waiting) {
    const Row<bool> running = worlds.running;
    const Row<const ArrayPlace> kept_table = table_at(kept, KEPT_ARRAYS);
    const bool several = took.length > 1;
    const std::int64_t together = several ? max(running.length / most_turns, std::int64_t{1}) : running.length;
    TickEnd how = TickEnd::driven;
    std::int64_t count = 0;
    for (std::int64_t row = 0; row < running.length; ++row) waiting[row] = running[row], running[row] = false;
    for (std::int64_t first = 0; first < running.length; first += together) {
        const std::int64_t end = min(first + together, running.length);
        for (std::int64_t row = first; row < end; ++row) running[row] = waiting[row], waiting[row] = false;
        count = 0;
        while (count < took.length && how != TickEnd::late && any(running.part(first, end))) {
            how = std::max(how, tick(worlds, calls, limit, kept_table, took[count], waiting, several));
            ++count;
        }
        for (std::int64_t row = first; row < end; ++row)
            waiting[row] = running[row] || waiting[row], running[row] = false;
    }
    for (std::int64_t row = 0; row < running.length; ++row) running[row] = waiting[row], waiting[row] = false;
    return {how, count};
}

}  // namespace fg
