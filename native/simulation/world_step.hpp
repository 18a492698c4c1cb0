// Parts of a physics step of one world other than the tires: moving obstacles, and the floor under each tire.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"
#include "../vehicle/motion.hpp"
#include "../vehicle/mujoco_library.hpp"

namespace fg {

// A row of `car_places`, one for each car of a world; columns as in fg_mujoco/simulation/compiled_tick.py.
struct CarPlaces {
    std::int64_t tires, axles, chassis_contact;  // where in the sensors their readings begin; axles -1: there are none
    std::int64_t first_tire;                     // among the tires with a law of ours; -1: it has none
    std::int64_t mount;                          // where in qpos the pose of the body is that its LiDAR is fixed to
    std::int64_t tree;                           // of its bodies, see SceneArrays; -1: none
    std::int64_t level;                          // whether its LiDAR stays level
};

// The patches of the worlds, and what the tires have on them; all empty where there are none.
struct Floor {
    Matrix patches;                 // (k, 7) of `patch_table`
    Matrix wheels;                  // (4 cars_per_world, 2) of `wheel_positions`
    Cube<double> mu;                // (steps, r, 4) room: what each tire had in each step of a tick
    Row<const std::int32_t> pairs;  // (4 cars_per_world,) of the tires
};

// Sizes of a world's model, and of its steps.
struct Sizes {
    std::int64_t positions;
    std::int64_t dofs;
    std::int64_t readings;
    std::int64_t userdata;
    std::int64_t pairs;
    std::int64_t own_tires;  // whether any car has tires with a law of ours
};

// Return what each tire of a world has on the floor under it (m, 4) [-], and give it to MuJoCo's contacts, too.
Matrix friction_under(const mjModel* model, const mjData* data, std::int64_t world, std::int64_t step,
                      const Sizes& sizes, Row<const CarPlaces> car_places, Row<const Car> cars, Matrix mu,
                      const Floor& floor);

// Put the moving obstacles where they are at the time of the data.
void place_obstacles(mjData* data, Matrix motions);

}  // namespace fg
