// The clusters that a scan skips: off the scan plane, out of range, behind the LiDAR, or hidden by nearer surfaces.
// Source: Greene, Hierarchical Z-buffer visibility, SIGGRAPH 1993.
#pragma once
#include "../core/versions.hpp"
#include "scene.hpp"

namespace fg {

inline constexpr int BLOCK = 64;     // beams
inline constexpr double FAR = 1e9;  // [m] of a cluster that is not to be drawn

// Bearing of a point to 2e-6 rad. Source: Hastings, Approximations for digital computers, 1955.
inline double bearing(double x, double y) {
    const double low = min(std::abs(x), std::abs(y)), high = max(std::abs(x), std::abs(y));
    const double q = low / (high + TINY), s = q * q;
    double angle =
        q * (0.99997726 +
             s * (-0.33262347 + s * (0.19354346 + s * (-0.11643287 + s * (0.05265332 + s * -0.01172120)))));
    angle = std::abs(y) > std::abs(x) ? 0.5 * pi - angle : angle;
    angle = x < 0.0 ? pi - angle : angle;
    return y >= 0.0 ? angle : -angle;
}

// Greatest number of beams of a full turn.
inline int whole_turn(const Scene& scene) { return whole(2.0 * pi / scene.angle_increment()); }

// Write how far the box around each cluster is, FAR where the scan plane misses it, and which beams may meet it.
// The plane cuts the box inside the circle of the box's half diagonal about the centre's place in the plane; it is seen
// under asin(radius / distance) to either side, at most ratio + (pi/2 - 1) ratio^3.
FG_VERSIONS inline void survey(const Scene& scene, const Pose& pose, int first, int behind, const Scratch& scratch) {
    const double per_radian = 1.0 / scene.angle_increment(), angle_min = scene.angle_min();
    const Matrix& boxes = scene.boxes;
    const Numbers centre_x = boxes[0].part(first, behind), centre_y = boxes[1].part(first, behind);
    const Numbers centre_z = boxes[2].part(first, behind), half_x = boxes[3].part(first, behind);
    const Numbers half_y = boxes[4].part(first, behind), half_z = boxes[5].part(first, behind);
    const Numbers radius = boxes[6].part(first, behind);
    const Row<double> nearest = scratch.nearest.part(first, behind);
    const Row<std::int32_t> rightmost = scratch.views[0].part(first, behind);
    const Row<std::int32_t> behind_leftmost = scratch.views[1].part(first, behind);
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    FG_INDEPENDENT
    for (int i = 0; i < behind - first; ++i) {
        const double cx = centre_x[i] - ox, cy = centre_y[i] - oy, cz = centre_z[i] - oz;
        const double x = xx * cx + xy * cy + xz * cz;
        const double y = yx * cx + yy * cy + yz * cz;
        const double z = zx * cx + zy * cy + zz * cz;
        const double thickness = std::abs(zx) * half_x[i] + std::abs(zy) * half_y[i] + std::abs(zz) * half_z[i];
        double gap_x = std::abs(cx) - half_x[i], gap_y = std::abs(cy) - half_y[i], gap_z = std::abs(cz) - half_z[i];
        gap_x = gap_x > 0.0 ? gap_x : 0.0;
        gap_y = gap_y > 0.0 ? gap_y : 0.0;
        gap_z = gap_z > 0.0 ? gap_z : 0.0;
        const double distance = std::sqrt(gap_x * gap_x + gap_y * gap_y + gap_z * gap_z);
        const double ratio = radius[i] / (std::sqrt(x * x + y * y) + TINY);
        double spread = (ratio + 0.5708 * ratio * ratio * ratio) * per_radian;
        spread = ratio < 1.0 ? spread : 1e6;
        const double middle = (bearing(x, y) - angle_min) * per_radian;
        nearest[i] = std::abs(z) <= thickness + 1e-9 ? distance : FAR;
        rightmost[i] = whole(middle - spread - 2.0);
        behind_leftmost[i] = whole(middle + spread + 3.0);
    }
}

// Leave some clusters out of a scan.
inline void skip(int first, int behind, const Scratch& scratch) {
    for (int cluster = first; cluster < behind; ++cluster) {
        scratch.nearest[cluster] = FAR;
        scratch.views[0][cluster] = scratch.views[1][cluster] = 0;
    }
}

// Write the clusters in range and in view, near ones first, to views[2]; return how many they are.
inline int sort_by_distance(const Scene& scene, const Scratch& scratch) {
    const Row<double> nearest = scratch.nearest;
    const Row<std::int32_t> rightmost = scratch.views[0], behind_leftmost = scratch.views[1], order = scratch.views[2];
    const Row<std::int32_t> bins = scratch.bins;
    const int beams = scene.beams[0].size(), turn = whole_turn(scene);
    const double range_max = scene.range_max();
    const auto bin_of = [&](int cluster) { return min(whole(nearest[cluster] * (BINS / range_max)), BINS - 1); };
    for (int bin = 0; bin < bins.size(); ++bin) bins[bin] = 0;
    for (int cluster = 0; cluster < nearest.size(); ++cluster) {
        const int right = rightmost[cluster], left = behind_leftmost[cluster];
        const bool in_view = (right < beams && left > 0) || right + turn < beams || left - turn > 0;
        if (nearest[cluster] < range_max && in_view)
            ++bins[bin_of(cluster) + 1];
        else
            nearest[cluster] = FAR;
    }
    for (int bin = 0; bin < BINS; ++bin) bins[bin + 1] += bins[bin];
    const int count = bins[BINS];
    for (int cluster = 0; cluster < nearest.size(); ++cluster)
        if (nearest[cluster] < range_max) order[bins[bin_of(cluster)]++] = cluster;
    return count;
}

// Whether none of some values is below a limit: by blocks, whose values are compared several at a time.
FG_VERSIONS inline bool all_above(Row<double> values, int first, int behind, double limit) {
    for (int start = first; start < behind; start += BLOCK) {
        const int block_end = min(start + BLOCK, behind);
        std::int64_t below = 0;
        for (int i = start; i < block_end; ++i) below += values[i] < limit;
        if (below > 0) return false;
    }
    return true;
}

// Whether `out` [1/m] is nearer than `nearest` [m] in all views `right` to `left` of a cluster.
inline bool is_hidden(int right, int left, double nearest, int turn, Row<double> out) {
    const int beams = out.size();
    const double inverse = (1.0 + 1e-9) / (nearest + TINY);
    return all_above(out, max(right, 0), min(left, beams), inverse) &&
           all_above(out, max(right + turn, 0), beams, inverse) &&  // what goes on beyond straight behind
           all_above(out, 0, min(left - turn, beams), inverse);
}

}  // namespace fg
