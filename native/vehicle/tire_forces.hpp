// Physics steps of MuJoCo with tires that have a law of ours. tire_forces.py has how.
// `dofs` are the model's; `gears` (m,) of its cars, `tires` (k,) of those with tires of ours, `own` of one car's tires.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"
#include "mujoco_library.hpp"
#include "tire_rows.hpp"
#include "tire_solve.hpp"

namespace fg {

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

}  // namespace fg
