// Random numbers, those of numpy's default generator bit for bit.
#pragma once
#include "../core/arrays.hpp"

namespace fg {

// Layers under the normal density, (256,) each, as fg_mujoco/lidar/ziggurat.csv has them.
struct Ziggurat {
    Row<const std::int64_t> limits;
    Numbers widths, heights;
};

// Draw numbers from 0 to 1, as Generator.random. `state` (4,): halves of the state, halves of the increment.
void draw_shares(Row<std::int64_t> state, Row<double> out);

// Draw standard normal numbers, as Generator.standard_normal.
void draw_normals(Row<std::int64_t> state, const Ziggurat& ziggurat, Row<double> out);

}  // namespace fg
