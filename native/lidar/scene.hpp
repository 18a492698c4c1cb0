// The input of a scan, or of points, and the working arrays of a scan; fg_mujoco/lidar/visible_surfaces.py says what is in each array.
#pragma once
#include "../core/array_table.hpp"
#include "../core/arrays.hpp"
#include "../core/numbers.hpp"

namespace fg {

inline constexpr int BINS = 64;          // of distance, into which a scan sorts the clusters
inline constexpr double NO_END = 1e300;  // [m] half-size of a plane without end
inline constexpr double TINY = 1e-300;   // added to a divisor that may be 0

struct Scene {
    Matrix beams;
    Numbers limits;
    Matrix edges;
    Table<const std::uint16_t> triangles;
    Matrix boxes;
    Table<const std::int32_t> spans;
    Matrix planes;
    Table<const std::int32_t> frames;
    Matrix shapes;
    Matrix spheres;

    double angle_min() const { return limits[0]; }
    double angle_increment() const { return limits[1]; }
    double range_min() const { return limits[2]; }
    double range_max() const { return limits[3]; }

    // Throw std::invalid_argument unless beams and limits fit together.
    void check_beams() const;
    // Throw std::invalid_argument unless all shapes fit together and all indices point into the arrays.
    void check_layout() const;
    // Throw std::invalid_argument unless the material of each surface is one of so many.
    void check_materials(std::int64_t count) const;
};

struct Scratch {
    Table<double> cuts;
    Row<std::int32_t> columns;
    Row<double> nearest;
    Table<std::int32_t> views;
    Row<std::int32_t> bins;
    Table<double> poses;

    // Throw std::invalid_argument unless there is room for the scans of a scene.
    void check_room(const Scene& scene) const;
};

// Return both from the rows of a table of their arrays, in the order of their fields.
inline constexpr int scene_arrays = 10, scratch_arrays = 6;
inline Scene scene_of(Row<const ArrayPlace> rows) {
    return {rows[0].table<const double>(),        rows[1].row<const double>(),   rows[2].table<const double>(),
            rows[3].table<const std::uint16_t>(), rows[4].table<const double>(), rows[5].table<const std::int32_t>(),
            rows[6].table<const double>(),        rows[7].table<const std::int32_t>(),
            rows[8].table<const double>(),        rows[9].table<const double>()};
}
inline Scratch scratch_of(Row<const ArrayPlace> rows) {
    return {rows[0].table<double>(),       rows[1].row<std::int32_t>(), rows[2].row<double>(),
            rows[3].table<std::int32_t>(), rows[4].row<std::int32_t>(), rows[5].table<double>()};
}

// Pose of the LiDAR in a frame: position [m], then the rotation into the LiDAR's frame, row by row.
struct Pose {
    double ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz;

    explicit Pose(Row<double> p)
        : ox(p[0]), oy(p[1]), oz(p[2]), xx(p[3]), xy(p[4]), xz(p[5]), yx(p[6]), yy(p[7]), yz(p[8]), zx(p[9]),
          zy(p[10]), zz(p[11]) {}
};

// Write where a body's frame has the LiDAR, as in Pose.
inline void look_from_moving(Numbers position, Matrix rotation, Numbers body_position, Matrix body_rotation,
                             Row<double> pose) {
    for (int i = 0; i < 3; ++i) {
        pose[i] = 0.0;
        for (int k = 0; k < 3; ++k) pose[i] += body_rotation[k][i] * (position[k] - body_position[k]);
        for (int j = 0; j < 3; ++j) {
            pose[3 + 3 * i + j] = 0.0;
            for (int k = 0; k < 3; ++k) pose[3 + 3 * i + j] += rotation[k][i] * body_rotation[k][j];
        }
    }
}

}  // namespace fg
