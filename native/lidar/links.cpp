// Forward kinematics of a tree of links. Source: mj_kinematics of MuJoCo, whose order of the operations is kept.
#include "links.hpp"

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"

namespace fg {
namespace {

enum JointKind { FREE, BALL, SLIDE, HINGE };  // mjtJoint; -1: fixed

struct Vector {
    double x, y, z;
};

Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vector operator*(double factor, Vector a) { return {factor * a.x, factor * a.y, factor * a.z}; }
Vector vector(const double* v) { return {v[0], v[1], v[2]}; }

struct Quaternion {
    double w, x, y, z;
};

Quaternion unit(double w, double x, double y, double z) {
    const double norm = std::sqrt(w * w + x * x + y * y + z * z);
    if (norm < 1e-15) return {1.0, 0.0, 0.0, 0.0};  // mjMINVAL
    return {w / norm, x / norm, y / norm, z / norm};
}

Quaternion operator*(Quaternion p, Quaternion q) {
    return {p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z, p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
            p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x, p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w};
}

// Turn a vector by a unit quaternion.
Vector turned(Quaternion q, Vector v) {
    const double tx = 2.0 * (q.y * v.z - q.z * v.y), ty = 2.0 * (q.z * v.x - q.x * v.z);
    const double tz = 2.0 * (q.x * v.y - q.y * v.x);
    return {v.x + q.w * tx + q.y * tz - q.z * ty, v.y + q.w * ty + q.z * tx - q.x * tz,
            v.z + q.w * tz + q.x * ty - q.y * tx};
}

// Rotation by the joint itself, of a hinge or a ball.
Quaternion joint_rotation(const Link& link, Numbers qpos) {
    if (link.kind == BALL)
        return unit(qpos[link.qpos], qpos[link.qpos + 1], qpos[link.qpos + 2], qpos[link.qpos + 3]);
    const double half = 0.5 * (qpos[link.qpos] - link.qpos0), sine = fg::sin(half);
    return {fg::cos(half), sine * link.axis[0], sine * link.axis[1], sine * link.axis[2]};
}

void write_rotation(Quaternion q, Table<double> rotation) {
    const auto [w, x, y, z] = q;
    rotation[0][0] = w * w + x * x - y * y - z * z;
    rotation[1][1] = w * w - x * x + y * y - z * z;
    rotation[2][2] = w * w - x * x - y * y + z * z;
    rotation[0][1] = 2.0 * (x * y - w * z), rotation[1][0] = 2.0 * (x * y + w * z);
    rotation[0][2] = 2.0 * (x * z + w * y), rotation[2][0] = 2.0 * (x * z - w * y);
    rotation[1][2] = 2.0 * (y * z - w * x), rotation[2][1] = 2.0 * (y * z + w * x);
}

}  // namespace

void place_links(Numbers qpos, Row<const Link> links, Table<double> poses, Table<double> positions,
                 Cube<double> rotations) {
    for (int i = 0; i < links.size(); ++i) {
        const Link& link = links[i];
        Vector position{0.0, 0.0, 0.0};
        Quaternion rotation{1.0, 0.0, 0.0, 0.0};
        if (link.kind == FREE) {
            position = {qpos[link.qpos], qpos[link.qpos + 1], qpos[link.qpos + 2]};
            rotation = unit(qpos[link.qpos + 3], qpos[link.qpos + 4], qpos[link.qpos + 5], qpos[link.qpos + 6]);
        } else {
            if (link.parent >= 0) {
                const Row<double> parent = poses[link.parent];
                position = {parent[0], parent[1], parent[2]};
                rotation = {parent[3], parent[4], parent[5], parent[6]};
            }
            position = position + turned(rotation, vector(link.place));
            rotation = rotation * Quaternion{link.turn[0], link.turn[1], link.turn[2], link.turn[3]};
            if (link.kind == SLIDE) {
                position = position + (qpos[link.qpos] - link.qpos0) * turned(rotation, vector(link.axis));
            } else if (link.kind == HINGE || link.kind == BALL) {
                const Vector before = turned(rotation, vector(link.anchor));
                rotation = rotation * joint_rotation(link, qpos);
                position = position + before - turned(rotation, vector(link.anchor));
            }
            rotation = unit(rotation.w, rotation.x, rotation.y, rotation.z);
        }
        const double pose[7] = {position.x, position.y, position.z, rotation.w, rotation.x, rotation.y, rotation.z};
        for (int k = 0; k < 7; ++k) poses[i][k] = pose[k];
        if (link.frame >= 0) {
            for (int k = 0; k < 3; ++k) positions[link.frame][k] = pose[k];
            write_rotation(rotation, rotations[link.frame]);
        }
    }
}

}  // namespace fg
