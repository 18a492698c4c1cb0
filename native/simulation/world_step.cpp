// A world whose cars all stand on MuJoCo's contacts is stepped by mj_step. Where any car has tires of ours, MuJoCo's
// stages are called one after the other, and the tires' forces are put in between (vehicle/tire_forces.cpp).
#include "world_step.hpp"

#include "../course/moving_obstacles.hpp"
#include "../vehicle/friction_patches.hpp"

namespace fg {
namespace {

template <class T>
Table<T> part(Table<T> table, std::int64_t first, std::int64_t behind) {
    return {table.data + first * table.columns, behind - first, table.columns};
}

}  // namespace

Matrix friction_under(const mjModel* model, const mjData* data, std::int64_t world, std::int64_t step,
                      const Sizes& sizes, Row<const CarPlaces> car_places, Row<const Car> cars, Matrix mu,
                      const Floor& floor) {
    const std::int64_t first = world * car_places.length, behind = first + car_places.length;
    if (floor.patches.rows == 0) return part(mu, first, behind);
    const Table<double> all_under = part(floor.mu[step], first, behind);
    const Row<double> friction{model->pair_friction, 5 * sizes.pairs};
    const Numbers qpos{data->qpos, sizes.positions};
    for (std::int64_t car = 0; car < car_places.length; ++car) {
        const std::int64_t row = first + car;
        const Row<double> under = all_under[car];
        const auto [x, y, heading] = planar_pose(qpos, cars.part(row, row + 1));
        look_at_floor(x, y, heading, part(floor.wheels, 4 * car, 4 * (car + 1)), floor.patches, mu[row], under);
        for (int tire = 0; tire < 4; ++tire) {
            const std::int64_t pair = floor.pairs[4 * car + tire];
            friction[5 * pair] = friction[5 * pair + 1] = under[tire];
        }
    }
    return all_under;
}

void place_obstacles(mjData* data, Matrix motions) {
    const Table<double> positions{data->mocap_pos, motions.rows, 3};
    for (std::int64_t k = 0; k < motions.rows; ++k) {
        const auto [x, y] = obstacle_position(motions[k], data->time);
        positions[k][0] = x, positions[k][1] = y, positions[k][2] = 0.0;
    }
}

}  // namespace fg
