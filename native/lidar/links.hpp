// Poses of the bodies of a kinematic tree from the positions of its joints alone, as mj_kinematics calculates them.
#pragma once
#include "../core/arrays.hpp"

namespace fg {

// A body with one joint at most; fg_mujoco/lidar/body_poses.py describes the fields.
struct Link {
    std::int64_t parent, kind, qpos;
    double qpos0;
    double place[3], turn[4], axis[3], anchor[3];
    std::int64_t frame;
};
static_assert(sizeof(Link) == 18 * 8);

// Write where the bodies of `links` (n,) are: positions (bodies, 3) [m], rotations (bodies, 3, 3). `poses` (n, 7) is room.
void place_links(Numbers qpos, Row<const Link> links, Table<double> poses, Table<double> positions,
                 Cube<double> rotations);

}  // namespace fg
