// Physics steps of MuJoCo with tires that have a law of ours. tire_forces.py has how.
// `dofs` are the model's; `gears` (m,) of its cars, `tires` (k,) of those with tires of ours, `own` of one car's tires.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"
#include "mujoco_library.hpp"
#include "tire_rows.hpp"
#include "tire_solve.hpp"

namespace fg {

// Add to MuJoCo's inertia what takes joint damping implicitly, and keep joints that are put where they belong.
void damp_inertia(const mjModel* model, mjData* data, const Inertia& inertia, Row<const Gear> gears, std::int64_t dofs,
                  double timestep);

// Add to the inertia, `share` [s] times, what constraints lack, damping of steerings of MuJoCo's; false: none.
bool damp_steering(const mjModel* model, mjData* data, const Inertia& inertia, Row<const Gear> gears, double share);

// Add the tires' rolling resistance to MuJoCo's passive forces.
void resist_rolling(mjData* data, Row<const Tire> tires, Row<const TireState> own, std::int64_t dofs);

// Add a car's drag to MuJoCo's passive forces: in proportion to the velocity of its centre of gravity.
void resist_air(mjData* data, const Gear& gear, std::int64_t dofs);

// Do a physics step of a model whose cars have tires of ours; not `advance`: only work out its forces and sensors.
//   mu: (m, wheels) [-] peaks.
//   userdata: of `data`, written to.
//   scratch: (SCRATCH,) room.
//   timestep: [s].
//   clear: there is no contact to be found.
//   last: somebody reads the accelerometers of this step.
void step_on_tires(const mjModel* model, mjData* data, const Inertia& inertia, Row<const Gear> gears,
                   Row<const Tire> tires, Matrix mu, Row<double> userdata, Row<double> scratch, std::int64_t dofs,
                   double timestep, bool advance, bool clear, bool last);

// Do a physics step for each row of `records` and `states`; write `readings`, sensordata, and `userdata` there.
void steps_on_tires(const mjModel* model, mjData* data, const Inertia& inertia, Row<const Gear> gears,
                    Row<const Tire> tires, Matrix mu, Row<double> userdata, Row<double> scratch, std::int64_t dofs,
                    double timestep, Numbers readings, Table<double> records, Table<double> states);

// Do a physics step of a model whose cars all stand on MuJoCo's contacts.
void step_on_contacts(const mjModel* model, mjData* data, Row<const Gear> gears, std::int64_t dofs);

// Write the forces that MuJoCo lets the motors push with: what their power gives now; if not `limited`, all.
// Above `power_limit_speed` the acceleration falls as power_limit_speed / speed (f1tenth_gym, CommonRoad). Braking
// keeps the full force. A motor that `push_car` drives is limited there.
void limit_power(const mjModel* model, const mjData* data, Row<const Gear> gears, std::int64_t dofs, bool limited);

// Do MuJoCo's stages of positions and velocities, with their sensors; `clear`: there is no contact to be found.
void begin_step(const mjModel* model, mjData* data, bool clear);

// Do MuJoCo's stages from the acceleration on; `last`: somebody reads the accelerometers of this step.
void end_step(const mjModel* model, mjData* data, bool advance, bool last);

// Move the state by all forces, those of constraints too, with the inertia as it is now.
void advance_damped(const mjModel* model, mjData* data, std::int64_t dofs);

// Do what a car that turns does in a step, of `before` (3,), its velocities along x, y [m/s] and yaw rate [rad/s].
// Forces turn with the car: it speeds up along its mean heading, and not along that of before. It moves over the
// ground by the mean of its velocities before and after, and turns likewise: with the velocity after, a car that
// slides at v comes to rest v h / 2 too soon, and its tires answer to steering late. Not where something else than
// tires stops the car: a contact counts on it.
void place_between(mjData* data, const Gear& gear, std::int64_t dofs, Numbers before, double timestep);

}  // namespace fg
