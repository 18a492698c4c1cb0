// Spheres, capsules, ellipsoids and cylinders as beams meet them: where a ray enters each, in closed form.
// Source: the equations are those of MuJoCo's own rays (mj_ray), so that both agree to rounding: the nearest point ahead
// of the ray on the surface, from inside, too.
#pragma once
#include <utility>

#include "scene.hpp"

namespace fg {

inline constexpr double NUMERICALLY_NONE = 1e-15;  // mjMINVAL: of a ray that only grazes, or runs along a flat side

struct Vector {
    double x, y, z;
};

// Both solutions of a t^2 + 2 b t + c = 0, the lesser first; -1 where there are none.
inline std::pair<double, double> roots(double a, double b, double c) {
    const double under = b * b - a * c;
    if (under < NUMERICALLY_NONE || a < NUMERICALLY_NONE) return {-1.0, -1.0};
    const double root = std::sqrt(under);
    return {(-b - root) / a, (-b + root) / a};
}

// How far a ray from p [m] along v goes, in the frame of a shape of sizes a, b, c [m]; -1: it misses.
inline double ray_distance(double kind, double a, double b, double c, Vector p, Vector v) {
    if (kind == 0.0) {
        const auto [first, second] =
            roots(1.0, p.x * v.x + p.y * v.y + p.z * v.z, p.x * p.x + p.y * p.y + p.z * p.z - a * a);
        return first >= 0.0 ? first : second;
    }
    if (kind == 2.0) {
        const double sx = 1.0 / (a * a), sy = 1.0 / (b * b), sz = 1.0 / (c * c);
        const auto [first, second] = roots(sx * v.x * v.x + sy * v.y * v.y + sz * v.z * v.z,
                                           sx * p.x * v.x + sy * p.y * v.y + sz * p.z * v.z,
                                           sx * p.x * p.x + sy * p.y * p.y + sz * p.z * p.z - 1.0);
        return first >= 0.0 ? first : second;
    }
    double nearest = inf;
    const auto [first, second] =
        roots(v.x * v.x + v.y * v.y, p.x * v.x + p.y * v.y, p.x * p.x + p.y * p.y - a * a);
    const double side = first >= 0.0 ? first : second;
    if (side >= 0.0 && std::abs(p.z + side * v.z) <= b) nearest = side;
    for (const double end : {-1.0, 1.0}) {
        const double away = p.z - end * b;
        if (kind == 1.0) {  // half a sphere
            const auto [near, far] =
                roots(1.0, p.x * v.x + p.y * v.y + away * v.z, p.x * p.x + p.y * p.y + away * away - a * a);
            if (near >= 0.0 && end * (away + near * v.z) >= 0.0) nearest = min(nearest, near);
            if (far >= 0.0 && end * (away + far * v.z) >= 0.0) nearest = min(nearest, far);
        } else if (std::abs(v.z) > NUMERICALLY_NONE) {
            const double flat = -away / v.z;
            const double x = p.x + flat * v.x, y = p.y + flat * v.y;
            if (flat >= 0.0 && x * x + y * y <= a * a) nearest = min(nearest, flat);
        }
    }
    return nearest < inf ? nearest : -1.0;
}

// Turn a vector of the body's frame into a shape's.
inline Vector into_shape(Numbers row, double x, double y, double z) {
    return {row[7] * x + row[10] * y + row[13] * z, row[8] * x + row[11] * y + row[14] * z,
            row[9] * x + row[12] * y + row[15] * z};
}

}  // namespace fg
