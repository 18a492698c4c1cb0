// Poses of what is fixed to a free body or a mocap body follow from the state; others are read off mj_kinematics' results.
#include "body_poses.hpp"

#include <stdexcept>

#include "../core/numbers.hpp"

namespace fg {
namespace {

enum Source { FREE_JOINT, MOCAP, KINEMATICS, LEVEL };  // as in body_poses.py
constexpr double LEAST_NORM = 1e-15;  // mjMINVAL: MuJoCo takes shorter quaternions for no rotation

}  // namespace

void mounted_pose(Numbers body_position, Numbers quaternion, bool level, Numbers offset_position,
                  Matrix offset_rotation, Row<double> position, Table<double> rotation) {
    double w = quaternion[0], x = quaternion[1], y = quaternion[2], z = quaternion[3];
    if (level) x = y = 0.0;
    double norm = std::sqrt(w * w + x * x + y * y + z * z);
    if (norm < LEAST_NORM) w = 1.0, x = y = z = 0.0, norm = 1.0;
    w /= norm, x /= norm, y /= norm, z /= norm;
    const double turn[3][3] = {
        {w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)},
        {2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)},
        {2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z},
    };
    for (int i = 0; i < 3; ++i) {
        const auto [a, b, c] = turn[i];
        position[i] = body_position[i] + (a * offset_position[0] + b * offset_position[1] + c * offset_position[2]);
        for (int j = 0; j < 3; ++j)
            rotation[i][j] = a * offset_rotation[0][j] + b * offset_rotation[1][j] + c * offset_rotation[2][j];
    }
}

void read_poses(const Poses& poses, const State& state) {
    for (std::int64_t i = 0; i < poses.sources.rows; ++i) {
        const int kind = poses.sources[i][0], place = poses.sources[i][1];
        if (kind == KINEMATICS) {
            for (int j = 0; j < 3; ++j) {
                poses.positions[i][j] = state.xpos[place][j];
                for (int k = 0; k < 3; ++k) poses.rotations[i][j][k] = state.xmat[place][3 * j + k];
            }
            continue;
        }
        const bool mocap = kind == MOCAP;
        const Numbers position = mocap ? state.mocap_pos[place] : state.qpos.part(place, place + 3);
        const Numbers quaternion = mocap ? state.mocap_quat[place] : state.qpos.part(place + 3, place + 7);
        mounted_pose(position, quaternion, kind == LEVEL, poses.offset_positions[i], poses.offset_rotations[i],
                     poses.positions[i], poses.rotations[i]);
    }
}

}  // namespace fg
