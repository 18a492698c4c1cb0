// Poses of bodies at the present state of a simulation; fg_mujoco/lidar/body_poses.py says why MuJoCo's do not serve.
#pragma once
#include "../core/arrays.hpp"

namespace fg {

// Of m bodies: what each pose follows from and where that lies, offsets of positions and rotations, the poses.
struct Poses {
    Table<const std::int32_t> sources;
    Matrix offset_positions;
    Cube<const double> offset_rotations;
    Table<double> positions;
    Cube<double> rotations;
};

// Arrays of a mujoco.MjData.
struct State {
    Numbers qpos;
    Matrix mocap_pos, mocap_quat, xpos, xmat;
};

// Write position (3,) and rotation (3, 3), in the world, of what is fixed to a free body, or kept level. The body's
// position is (3,) [m], its quaternion (4,) wxyz; the offsets are in its frame.
void mounted_pose(Numbers body_position, Numbers quaternion, bool level, Numbers offset_position,
                  Matrix offset_rotation, Row<double> position, Table<double> rotation);

// Write the poses of the bodies at a state.
void read_poses(const Poses& poses, const State& state);

}  // namespace fg
