// Binds native/vehicle. Shapes that do not fit together are refused with a ValueError; indices in records, which
// Python reads off a compiled model, and addresses of a model and its data are believed.
#include <nanobind/stl/tuple.h>

#include <tuple>

#include "../vehicle/friction_patches.hpp"
#include "../vehicle/motion.hpp"
#include "../vehicle/terrain.hpp"
#include "../vehicle/tire_forces.hpp"
#include "../vehicle/tire_patch.hpp"
#include "../vehicle/tire_slip.hpp"
#include "bindings.hpp"
#include "record_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

namespace fg {
namespace {

constexpr int law_numbers = std::extent_v<decltype(Tire::curve), 1>;

// A function that returns a tuple in place of an array, which would become a list.
template <std::size_t Count, class... Arguments>
auto tupled(std::array<double, Count> (*function)(Arguments...)) {
    return [function](Arguments... arguments) { return std::tuple_cat(function(arguments...)); };
}

void bind_motion(nb::module_& module) {
    module.def("planar_pose", tupled(&planar_pose), "qpos"_a, "car"_a);
    module.def("uprightness", &uprightness, "qpos"_a, "car"_a);
    module.def("is_rolled_over", &is_rolled_over, "qpos"_a, "car"_a);
    module.def("speed_ahead", &ground_speed, "qpos"_a, "qvel"_a, "car"_a);
    module.def("surface_speed", &surface_speed, "qvel"_a, "car"_a);
    module.def("read_odometry", &read_odometry, "time"_a, "qpos"_a, "qvel"_a, "sensordata"_a, "car"_a, "odometry"_a);
    module.def("body_velocity", tupled(&body_velocity), "qpos"_a, "qvel"_a, "car"_a);
    module.def("point_motion", tupled(&point_motion), "qpos"_a, "qvel"_a, "ahead"_a, "car"_a);
    module.def("sideslip_angle", &sideslip_angle, "vx"_a, "vy"_a, "yaw_rate"_a, "car"_a);
    module.def("drive_car", &drive, "steering_angle"_a, "speed"_a, "car"_a, "ctrl"_a);
    module.def("look_at_floor",
               [](double x, double y, double heading, Matrix wheels, Matrix patches, Numbers mu, Row<double> under) {
                   require(wheels.rows == 4 && wheels.columns == 2 && patches.columns == 7 && mu.length == 4 &&
                               under.length == 4,
                           "wheels, patches, mu and under are not (4, 2), (n, 7), (4,) and (4,)");
                   look_at_floor(x, y, heading, wheels, patches, mu, under);
               },
               "x"_a, "y"_a, "heading"_a, "wheels"_a, "patches"_a, "mu"_a, "under"_a);
}

void bind_tires(nb::module_& module) {
    module.def("curve_force",
               [](std::int64_t law, Numbers numbers, double slip) {
                   require(numbers.length == law_numbers, "numbers is not (NUMBERS,)");
                   return curve_force(law, numbers, slip);
               },
               "law"_a, "numbers"_a, "slip"_a);
    module.def("sampled_force",
               [](Numbers numbers, double slip) {
                   require(numbers.length == law_numbers, "numbers is not (NUMBERS,)");
                   return sampled_force(numbers, slip);
               },
               "numbers"_a, "slip"_a);
    module.def("grip_of", [](Held<const Tire> tire, double load, double mu) { return grip_of(tire, load, mu); },
               "tire"_a, "load"_a, "mu"_a);
    module.def("curve_peaks",
               [](Held<const Tire> tire, double load, double mu) {
                   return std::tuple_cat(curve_peaks(tire, load, mu));
               },
               "tire"_a, "load"_a, "mu"_a);
    module.def("deflect",
               [](Held<const Tire> tire, double along, double across, double over_x, double over_y, double forward,
                  double grip, double timestep) {
                   return std::tuple_cat(deflect(tire, along, across, over_x, over_y, forward, grip, timestep));
               },
               "tire"_a, "along"_a, "across"_a, "over_x"_a, "over_y"_a, "forward"_a, "grip"_a, "timestep"_a);
    module.def("measure_slip",
               [](Matrix records, std::int64_t start, std::int64_t axles, Matrix mu, Row<const Tire> tires,
                  Matrix states, std::int64_t place, Cube<double> slip) {
                   const auto steps = slip.rows;
                   require(slip.length == quantity::count && slip.columns == 4, "slip is not (QUANTITIES, steps, 4)");
                   require(mu.columns == 4 && (mu.rows == 1 || mu.rows >= steps), "mu is not (1, 4) or (steps, 4)");
                   if (tires.length > 0)
                       require(tires.length == 4 && states.rows >= steps && place >= 0 &&
                                   place + 4 * tire_numbers <= states.columns,
                               "the tires are not four, or their states are not in those of the steps");
                   else
                       require(records.rows >= steps && start >= 0 &&
                                   start + 4 * contact_readings <= records.columns && axles + 12 <= records.columns,
                               "the tires' readings are not in the records of the steps");
                   measure_slip(records, start, axles, mu, tires, states, place, slip);
               },
               "records"_a, "start"_a, "axles"_a, "mu"_a, "tires"_a, "states"_a, "place"_a, "slip"_a, WithoutGil());
}

// A model and its data, by their addresses.
struct Stepped {
    mjModel* model;
    mjData* data;

    Stepped(std::uintptr_t of_model, std::uintptr_t of_data)
        : model(reinterpret_cast<mjModel*>(of_model)), data(reinterpret_cast<mjData*>(of_data)) {}

    void step(Row<const Gear> gears, Row<const Tire> tires, Matrix mu, bool advance) const {
        check(gears, mu);
        step_on_tires(model, data, inertia_of(model), gears, tires, mu, {data->userdata, model->nuserdata},
                      OwnRow<double>(scratch_numbers), model->nv, model->opt.timestep, advance, false, true);
    }
    void steps(Row<const Gear> gears, Row<const Tire> tires, Matrix mu, Table<double> records,
               Table<double> states) const {
        check(gears, mu);
        require(records.rows == states.rows && records.columns <= model->nsensordata &&
                    states.columns <= model->nuserdata,
                "the records and states are not (steps, sensordata) and (steps, userdata)");
        steps_on_tires(model, data, inertia_of(model), gears, tires, mu, {data->userdata, model->nuserdata},
                       OwnRow<double>(scratch_numbers), model->nv, model->opt.timestep,
                       {data->sensordata, model->nsensordata}, records, states);
    }
    void check(Row<const Gear> gears, Matrix mu) const {
        require(mu.rows == gears.length && mu.columns == 4, "gears and mu are not (m,) and (m, 4)");
    }
};

void bind_steps(nb::module_& module) {
    module.def("step_on_tires",
               [](std::uintptr_t model, std::uintptr_t data, Row<const Gear> gears, Row<const Tire> tires, Matrix mu,
                  bool advance) { Stepped(model, data).step(gears, tires, mu, advance); },
               "model"_a, "data"_a, "gears"_a, "tires"_a, "mu"_a, "advance"_a, WithoutGil());
    module.def("steps_on_tires",
               [](std::uintptr_t model, std::uintptr_t data, Row<const Gear> gears, Row<const Tire> tires, Matrix mu,
                  Table<double> records, Table<double> states) {
                   Stepped(model, data).steps(gears, tires, mu, records, states);
               },
               "model"_a, "data"_a, "gears"_a, "tires"_a, "mu"_a, "records"_a, "states"_a, WithoutGil());
    module.def("surface_at",
               [](std::uintptr_t model, double x, double y) {
                   const Terrain terrain(reinterpret_cast<const mjModel*>(model));
                   const Surface found = terrain.level() ? Surface{0.0, {0.0, 0.0, 1.0}} : terrain.at(x, y);
                   return std::tuple(found.height, found.normal[0], found.normal[1], found.normal[2]);
               },
               "model"_a, "x"_a, "y"_a);
    module.def("step_on_contacts",
               [](std::uintptr_t model, std::uintptr_t data, Row<const Gear> gears) {
                   const Stepped of(model, data);
                   step_on_contacts(of.model, of.data, gears, of.model->nv);
               },
               "model"_a, "data"_a, "gears"_a, WithoutGil());
}

}  // namespace

void bind_vehicle(nb::module_& module) {
    bind_motion(module);
    bind_tires(module);
    bind_steps(module);
}

}  // namespace fg
