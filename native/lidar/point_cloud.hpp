// A z-buffer of arcs: the points of a 3D LiDAR, whose lines sweep over the scene in arcs, in bursts from one place.
#pragma once
#include "links.hpp"
#include "scene.hpp"

namespace fg {

inline constexpr int LINES = 4, COLUMNS = 125, COLUMN_ROOM = 128;  // lines; points of each in a burst; room for them
inline constexpr int SECTORS = 8;                                   // bursts in a turn

// The surfaces of a model; fg_mujoco/lidar/cloud_scene.py says what is in each array.
struct CloudScene {
    Matrix vertices;
    Table<const std::uint16_t> triangles;
    Matrix boxes;
    Table<const std::int32_t> spans;
    Matrix planes;
    Table<const std::int32_t> frames;
    Matrix shapes, spheres, materials;

    // Throw std::invalid_argument unless all fit together and all indices point into the arrays.
    void check_layout() const;
};

// Directions of the points; fg_mujoco/lidar/point_cloud.py says what is in each array.
struct Pattern {
    Matrix columns, elevations;
    std::int64_t cycle;  // steps of a line from one lowest elevation to the next
    double blind;        // [m] nearer than that nothing returns

    void check_layout() const;
};

// Where the LiDAR is fixed on the body of a free joint, and the root of the tree of which it sees nothing.
struct CloudMount {
    std::int64_t qpos, tree;
    Numbers offset_position;
    Matrix offset_rotation;
};

// Write the points of bursts, x, y, z [m] in the LiDAR's frame and intensity; zeros: no return.
//   links: of the bodies of the scene that move but the first ones, which are placed.
//   before, after: qpos, between which all moves evenly; shares: where between them each burst is measured.
//   placed: (bursts, k, 3) [m] of the first bodies that move, which keep the world's axes.
//   first: number of the first burst; out: (bursts, LINES * COLUMNS, 4).
void cast_bursts(const CloudScene& scene, const Pattern& pattern, const CloudMount& mount, Row<const Link> links,
                 Numbers before, Numbers after, Numbers shares, Cube<const double> placed, std::int64_t first,
                 Cube<double> out);

}  // namespace fg
