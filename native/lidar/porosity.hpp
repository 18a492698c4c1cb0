// Where the holes of a porous surface are.
#pragma once
#include <cmath>
#include <cstdint>

namespace fg {

// Whether a porous surface has a hole at a place in the frame of its body [m], by cells of 2 cm: a share of them has one.
inline bool is_hole(double x, double y, double z, double porosity) {
    constexpr double cells = 50.0;  // a metre
    std::uint64_t hash = 0;
    for (const double place : {x + 0.00731, y + 0.00377, z + 0.00519}) {  // not along the coordinates of walls
        hash ^= static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(cells * place)));
        hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9u;  // splitmix64
        hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebu;
        hash ^= hash >> 31;
    }
    return static_cast<double>(hash >> 11) * 0x1p-53 < porosity;
}

}  // namespace fg
