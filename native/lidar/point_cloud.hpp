// A z-buffer of arcs: the points of a 3D LiDAR, whose lines sweep over the scene in arcs, in bursts from one place.
#pragma once
#include "links.hpp"
#include "scene.hpp"

namespace fg {

inline constexpr int LINES = 4, COLUMNS = 125, COLUMN_ROOM = 128;  // lines; points of each in a burst; room for them
inline constexpr int SECTORS = 8;                                   // bursts in a turn

// Where the LiDAR is fixed on the body of a free joint, and the root of the tree of which it sees nothing.
struct CloudMount {
    std::int64_t qpos, tree;
    Numbers offset_position;
    Matrix offset_rotation;
};

// Write the points of bursts, x, y, z [m] in the LiDAR's frame and intensity; zeros: no return.
//   scene: of vertices in place of edges, and of (2, LINES * COLUMN_ROOM) bearings from the burst's middle, line by line.
//   elevations: (2, cycle + COLUMN_ROOM) tangents and secants of a line's steps from its lowest to the next.
//   materials: (m, 2) intensity of a return, and distance within which there is one [m].
//   links: of the bodies of the scene that move but the first ones, which are placed.
//   before, after: qpos, between which all moves evenly; shares: where between them each burst is measured.
//   placed: (bursts, k, 3) [m] of the first bodies that move, which keep the world's axes.
//   first: number of the first burst; out: (bursts, LINES * COLUMNS, 4).
void cast_bursts(const Scene& scene, Matrix elevations, Matrix materials, const CloudMount& mount,
                 Row<const Link> links, Numbers before, Numbers after, Numbers shares, Cube<const double> placed,
                 std::int64_t first, Cube<double> out);

}  // namespace fg
