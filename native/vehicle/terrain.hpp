// The ground under the wheels: level, or a height field, which is geom 0 of a model that has one, by the name `terrain`.
//
// The surface goes through the heights at the nodes and has a slope that is steady: on each axis a cubic between four
// nodes. Source: Keys, Cubic convolution interpolation for digital image processing, IEEE Trans. ASSP 29 (1981).
#pragma once
#include <array>
#include <cstring>

#include "../core/numbers.hpp"
#include "mujoco_library.hpp"

namespace fg {

// A place of a surface: its height [m] and its normal, of length 1.
struct Surface {
    double height;
    std::array<double, 3> normal;
};

class Terrain {
public:
    Terrain() : heights_(nullptr) {}  // level ground
    // Read the terrain of a model.
    explicit Terrain(const mjModel* model)
        : heights_(is_terrain(model) ? model->hfield_data : nullptr) {
        if (level()) return;
        const int field = model->geom_dataid[0];
        const mjtNum* size = model->hfield_size + 4 * field;
        heights_ += model->hfield_adr[field];
        rows_ = model->hfield_nrow[field], columns_ = model->hfield_ncol[field];
        for (int axis = 0; axis < 2; ++axis) {
            corner_[axis] = model->geom_pos[axis] - size[axis];
            per_metre_[axis] = ((axis == 0 ? columns_ : rows_) - 1) / (2.0 * size[axis]);
        }
        lowest_ = model->geom_pos[2], range_ = size[2];
    }

    bool level() const { return heights_ == nullptr; }

    // Return whether geom 0 is the ground, and no height field of a vehicle's own.
    static bool is_terrain(const mjModel* model) {
        return model->ngeom > 0 && model->geom_type[0] == mjGEOM_HFIELD &&
               std::strcmp(model->names + model->name_geomadr[0], "terrain") == 0;
    }

    // Return the surface at a place [m]; beyond the field it goes on as at its edge.
    Surface at(double x, double y) const {
        const Cubic across(per_metre_[0] * (x - corner_[0]), columns_), up(per_metre_[1] * (y - corner_[1]), rows_);
        double height = 0.0, along_x = 0.0, along_y = 0.0;
        for (int i = 0; i < 4; ++i) {
            const float* row = heights_ + static_cast<std::int64_t>(up.node[i]) * columns_;
            double own = 0.0, slope = 0.0;
            for (int j = 0; j < 4; ++j) {
                own += across.weight[j] * row[across.node[j]];
                slope += across.slope[j] * row[across.node[j]];
            }
            height += up.weight[i] * own, along_x += up.weight[i] * slope, along_y += up.slope[i] * own;
        }
        const double gain_x = along_x * (range_ * per_metre_[0]), gain_y = along_y * (range_ * per_metre_[1]);
        const double size = std::sqrt(1.0 + gain_x * gain_x + gain_y * gain_y);
        return {lowest_ + range_ * height, {-gain_x / size, -gain_y / size, 1.0 / size}};
    }

private:
    // The four nodes about a place on an axis, with their shares of the height, and how these change with the place.
    struct Cubic {
        int node[4];
        double weight[4], slope[4];

        Cubic(double place, int count) {
            place = min(max(place, 0.0), static_cast<double>(count - 1));
            const int first = min(static_cast<int>(place), count - 2);
            const double t = place - first;
            for (int k = 0; k < 4; ++k) node[k] = min(max(first - 1 + k, 0), count - 1);
            weight[0] = t * (-0.5 + t * (1.0 - 0.5 * t)), slope[0] = -0.5 + t * (2.0 - 1.5 * t);
            weight[1] = 1.0 + t * t * (-2.5 + 1.5 * t), slope[1] = t * (-5.0 + 4.5 * t);
            weight[2] = t * (0.5 + t * (2.0 - 1.5 * t)), slope[2] = 0.5 + t * (4.0 - 4.5 * t);
            weight[3] = t * t * (-0.5 + 0.5 * t), slope[3] = t * (-1.0 + 1.5 * t);
        }
    };

    const float* heights_;
    int rows_ = 0, columns_ = 0;
    double corner_[2] = {}, per_metre_[2] = {};  // of the first node [m], nodes a metre
    double lowest_ = 0.0, range_ = 0.0;          // [m]
};

}  // namespace fg
