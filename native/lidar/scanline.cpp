// The plane of the beams, the scan plane, cuts a triangle in a line from one of its edges to another. In the frame of the
// LiDAR, 1 / distance along such a line is linear in the cosine and the sine of the bearing, and so it is for the ground.
// So a surface is drawn into the beams between its ends by two multiplications a beam. Each beam keeps the nearest
// surface and takes one division at the end. Nothing is approximate: the sign of a cross product decides which beam lies
// left of an end, once for all the triangles that share the end, so that no beam slips through between neighbours.
// Clusters of triangles are skipped where the scan plane misses them, out of range, behind the LiDAR, or behind nearer
// surfaces (culling.hpp).
//
// Source: the depth buffer is Catmull's (A subdivision algorithm for computer display of curved surfaces, 1974), leaving
// out clusters by it Greene's (Hierarchical Z-buffer visibility, SIGGRAPH 1993); here in a picture of one row.
#include "scanline.hpp"

#include <utility>

#include "culling.hpp"
#include "porosity.hpp"
#include "round_shapes.hpp"

namespace fg {
namespace {

constexpr double EDGE_ON = 1e-11;   // [rad] that a surface spans, under which its two ends are in one direction
constexpr double PARALLEL = 1e-15;  // mjMINVAL: MuJoCo's rays miss a plane that they approach more slowly
constexpr int NOT_CUT = -2;         // column of an edge that the scan plane does not cut

// Whether the scan plane misses the sphere around what a body carries.
bool is_off_plane(Numbers sphere, Numbers position, Matrix rotation, Numbers body_position, Matrix body_rotation) {
    double height = 0.0;
    for (int i = 0; i < 3; ++i) {
        double away = body_position[i] - position[i];
        for (int j = 0; j < 3; ++j) away += body_rotation[i][j] * sphere[j];
        height += rotation[i][2] * away;
    }
    return std::abs(height) > sphere[3];
}

// Write where the world's frame has the LiDAR: its position, and the rotation into the LiDAR's frame.
void look_from(Numbers position, Matrix rotation, Row<double> pose) {
    for (int i = 0; i < 3; ++i) {
        pose[i] = position[i];
        for (int j = 0; j < 3; ++j) pose[3 + 3 * i + j] = rotation[j][i];
    }
}

// Draw a surface, 1 / distance of which is along_x * cosine + along_y * sine of the bearing, into some beams.
FG_VERSIONS void draw(const Matrix& beams, double along_x, double along_y, int first, int behind, Row<double> out) {
    const Numbers cosine = beams[0], sine = beams[1];
    FG_INDEPENDENT
    for (int beam = first; beam < behind; ++beam) {
        const double inverse = along_x * cosine[beam] + along_y * sine[beam];
        out[beam] = inverse > out[beam] ? inverse : out[beam];
    }
}

// What draws a surface that lets a share of the beams through.
class Porous {
public:
    Porous(const Pose& pose, double porosity) : pose_(pose), porosity_(porosity) {}

    void operator()(const Matrix& beams, double along_x, double along_y, int first, int behind,
                    Row<double> out) const {
        for (int beam = first; beam < behind; ++beam) {
            const double cosine = beams[0][beam], sine = beams[1][beam];
            const double inverse = along_x * cosine + along_y * sine;
            if (inverse > out[beam] && !has_hole(cosine, sine, 1.0 / inverse)) out[beam] = inverse;
        }
    }
    // Whether there is a hole where a beam meets the surface.
    bool has_hole(double cosine, double sine, double distance) const {
        const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose_;
        const double x = distance * cosine, y = distance * sine;
        return is_hole(ox + x * xx + y * yx, oy + x * xy + y * yy, oz + x * xz + y * yz, porosity_);
    }

private:
    const Pose& pose_;
    double porosity_;
};

// Draw the line between two points of the scan plane, whose first beams at or to the left are `a` and `b`.
template <class Draw>
void draw_line(const Matrix& beams, double ax, double ay, int a, double bx, double by, int b, Row<double> out,
               const Draw& draw) {
    const double ex = bx - ax, ey = by - ay;
    const double cross = ax * ey - ay * ex;  // positive where `b` is to the left of `a`
    const bool edge_on = std::abs(cross) <= EDGE_ON * (std::abs(ax) + std::abs(ay)) * (std::abs(ex) + std::abs(ey));
    double along_x, along_y;
    int right, left;
    bool behind;
    if (edge_on && ax * bx + ay * by > 0.0) {
        // Which end is to the left is rounding. What is seen is the nearer end.
        const bool first = ax * ax + ay * ay < bx * bx + by * by;
        const double x = first ? ax : bx, y = first ? ay : by;
        const double inverse = 1.0 / (x * x + y * y);
        along_x = x * inverse, along_y = y * inverse;
        right = min(a, b), left = max(a, b);
        behind = x < 0.0 && (ay >= 0.0) != (by >= 0.0);
        if (behind) std::swap(right, left);
    } else {
        const double inverse = std::copysign(1.0 / max(std::abs(cross), TINY), cross);
        along_x = ey * inverse, along_y = -ex * inverse;
        if (cross > 0.0)
            right = a, left = b, behind = ay >= 0.0 && by < 0.0;
        else
            right = b, left = a, behind = by >= 0.0 && ay < 0.0;
    }
    // From the right end to the left one, or over straight behind.
    draw(beams, along_x, along_y, right, behind ? out.size() : left, out);
    if (behind) draw(beams, along_x, along_y, 0, left, out);
}

// First beam at or to the left of a point, from what may be one too many or too few.
int exact_column(const Matrix& beams, double x, double y, int column) {
    const Numbers cosine = beams[0], sine = beams[1];
    const int count = cosine.size();
    if (0 < column && column <= count && x * sine[column - 1] - y * cosine[column - 1] >= 0.0)
        --column;
    else if (0 <= column && column < count && x * sine[column] - y * cosine[column] < 0.0)
        ++column;
    return min(max(column, 0), count);
}

// Write where the scan plane cuts edges, and the first beam left of that, give or take one; -1, n + 1: beyond.
FG_VERSIONS void cut_edges(const Scene& scene, const Pose& pose, int first, int behind, const Scratch& scratch) {
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    const double per_radian = 1.0 / scene.angle_increment(), angle_min = scene.angle_min();
    const double beyond = scene.beams[0].size() + 1;
    const Matrix& edges = scene.edges;
    const Numbers start_x = edges[0].part(first, behind), start_y = edges[1].part(first, behind);
    const Numbers start_z = edges[2].part(first, behind), end_x = edges[3].part(first, behind);
    const Numbers end_y = edges[4].part(first, behind), end_z = edges[5].part(first, behind);
    const int count = start_x.size();
    const Row<double> cut_x = scratch.cuts[0].part(0, count), cut_y = scratch.cuts[1].part(0, count);
    const Row<std::int32_t> columns = scratch.columns.part(0, count);
    FG_INDEPENDENT
    for (int i = 0; i < count; ++i) {
        const double ax = start_x[i] - ox, ay = start_y[i] - oy, az = start_z[i] - oz;
        const double bx = end_x[i] - ox, by = end_y[i] - oy, bz = end_z[i] - oz;
        const double above = zx * ax + zy * ay + zz * az, other_above = zx * bx + zy * by + zz * bz;
        const double share = above / (above - other_above);
        const double px = ax + share * (bx - ax), py = ay + share * (by - ay), pz = az + share * (bz - az);
        const double x = xx * px + xy * py + xz * pz;
        const double y = yx * px + yy * py + yz * pz;
        double column = std::ceil((bearing(x, y) - angle_min) * per_radian);
        column = column > -1.0 ? column : -1.0;
        column = column < beyond ? column : beyond;
        cut_x[i] = x, cut_y[i] = y;
        columns[i] = (above >= 0.0) != (other_above >= 0.0) ? static_cast<std::int32_t>(column) : NOT_CUT;
    }
}

// Return the share of the beams that pass through a surface.
double porosity_of(double own, const Optics& optics) { return own == as_optics_say ? optics.through_cars : own; }

void draw_cluster(const Scene& scene, int cluster, const Scratch& scratch, Row<double> out, const Optics& optics) {
    const Row<const std::int32_t> span = scene.spans[cluster];
    const int first_edge = span[0], behind_edge = span[1], first_triangle = span[2], behind_triangle = span[3];
    const Pose pose(scratch.poses[span[4]]);
    const double porosity = porosity_of(scene.boxes[7][cluster], optics);
    cut_edges(scene, pose, first_edge, behind_edge, scratch);
    const Row<double> x = scratch.cuts[0], y = scratch.cuts[1];
    const Row<std::int32_t> columns = scratch.columns;
    for (int edge = 0; edge < behind_edge - first_edge; ++edge)
        if (columns[edge] != NOT_CUT) columns[edge] = exact_column(scene.beams, x[edge], y[edge], columns[edge]);
    for (int triangle = first_triangle; triangle < behind_triangle; ++triangle) {
        const Row<const std::uint16_t> corners = scene.triangles[triangle];
        int one = corners[0], other = corners[1];
        if (columns[one] == NOT_CUT) {
            if (columns[other] == NOT_CUT) continue;  // the plane cuts two edges of a triangle or none
            one = corners[2];
        } else if (columns[other] == NOT_CUT) {
            other = corners[2];
        }
        if (columns[one] == columns[other] && (y[one] >= 0.0) == (y[other] >= 0.0)) continue;  // between beams
        const auto draw_by = [&](const auto& draw) {
            draw_line(scene.beams, x[one], y[one], columns[one], x[other], y[other], columns[other], out, draw);
        };
        if (porosity > 0.0) [[unlikely]] draw_by(Porous(pose, porosity));
        else draw_by(draw);
    }
}

// Draw the front of a plane; where it ends is asked of each beam.
FG_VERSIONS void draw_plane(Numbers plane, const Pose& pose, const Matrix& beams, Row<double> out) {
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    const double gx = ox - plane[0], gy = oy - plane[1], gz = oz - plane[2];
    const double height = gx * plane[5] + gy * plane[8] + gz * plane[11];
    if (!(height >= 0.0)) return;
    const double slope_x = xx * plane[5] + xy * plane[8] + xz * plane[11];
    const double slope_y = yx * plane[5] + yy * plane[8] + yz * plane[11];
    if (plane[12] == NO_END && plane[13] == NO_END && height > 1e-9) {
        draw(beams, -slope_x / height, -slope_y / height, 0, out.size(), out);
        return;
    }
    // The place on the plane is start + distance * (slope_x * cosine + slope_y * sine), on each axis.
    const double start_1 = gx * plane[3] + gy * plane[6] + gz * plane[9];
    const double slope_x1 = xx * plane[3] + xy * plane[6] + xz * plane[9];
    const double slope_y1 = yx * plane[3] + yy * plane[6] + yz * plane[9];
    const double start_2 = gx * plane[4] + gy * plane[7] + gz * plane[10];
    const double slope_x2 = xx * plane[4] + xy * plane[7] + xz * plane[10];
    const double slope_y2 = yx * plane[4] + yy * plane[7] + yz * plane[10];
    const Numbers cosines = beams[0], sines = beams[1];
    const double half_1 = plane[12], half_2 = plane[13];
    for (int i = 0; i < out.size(); ++i) {
        const double cosine = cosines[i], sine = sines[i];
        const double approach = -(slope_x * cosine + slope_y * sine);
        const double inverse = approach / max(height, TINY);
        const bool seen = approach > PARALLEL &&
                          std::abs(start_1 * inverse + slope_x1 * cosine + slope_y1 * sine) <= half_1 * inverse &&
                          std::abs(start_2 * inverse + slope_x2 * cosine + slope_y2 * sine) <= half_2 * inverse;
        if (seen && inverse > out[i]) out[i] = inverse;
    }
}

void draw_shape_into(const Scene& scene, Numbers shape, const Pose& pose, int first, int behind, Row<double> out,
                     double porosity) {
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    const Vector p = into_shape(shape, ox - shape[4], oy - shape[5], oz - shape[6]);
    const Vector a = into_shape(shape, xx, xy, xz), b = into_shape(shape, yx, yy, yz);
    const Numbers cosines = scene.beams[0], sines = scene.beams[1];
    for (int beam = first; beam < behind; ++beam) {
        const double cosine = cosines[beam], sine = sines[beam];
        const Vector along{cosine * a.x + sine * b.x, cosine * a.y + sine * b.y, cosine * a.z + sine * b.z};
        const double distance = ray_distance(shape[0], shape[1], shape[2], shape[3], p, along);
        if (!(distance >= 0.0 && distance * out[beam] < 1.0)) continue;
        if (porosity > 0.0 && Porous(pose, porosity).has_hole(cosine, sine, distance)) continue;
        out[beam] = 1.0 / max(distance, TINY);
    }
}

// Draw a round shape into the beams that may meet it, each of which is asked.
void draw_shape(const Scene& scene, Numbers shape, const Pose& pose, Row<double> out, const Optics& optics) {
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    const double cx = shape[4] - ox, cy = shape[5] - oy, cz = shape[6] - oz, radius = shape[16];
    if (std::abs(zx * cx + zy * cy + zz * cz) > radius + 1e-9) return;
    const double x = xx * cx + xy * cy + xz * cz, y = yx * cx + yy * cy + yz * cz;
    const double ratio = radius / (std::sqrt(x * x + y * y) + TINY);
    const double angle = ratio < 1.0 ? ratio + 0.5708 * ratio * ratio * ratio : 1e6 * scene.angle_increment();
    const double middle = (bearing(x, y) - scene.angle_min()) / scene.angle_increment();
    const double spread = angle / scene.angle_increment();
    const int beams = out.size(), turn = whole_turn(scene);
    const int right = whole(middle - spread - 2.0), left = whole(middle + spread + 3.0);
    const double porosity = porosity_of(shape[17], optics);
    draw_shape_into(scene, shape, pose, max(right, 0), min(left, beams), out, porosity);
    if (right + turn < beams)  // what goes on beyond straight behind
        draw_shape_into(scene, shape, pose, max(right + turn, 0), beams, out, porosity);
    if (left - turn > 0) draw_shape_into(scene, shape, pose, 0, min(left - turn, beams), out, porosity);
}

// Let beams that meet a floor at a glancing angle not come back.
void lose_glancing(Numbers plane, const Pose& pose, const Matrix& beams, double range_max, Row<double> out,
                   double least) {
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    const double height = (ox - plane[0]) * plane[5] + (oy - plane[1]) * plane[8] + (oz - plane[2]) * plane[11];
    const double slope_x = xx * plane[5] + xy * plane[8] + xz * plane[11];
    const double slope_y = yx * plane[5] + yy * plane[8] + yz * plane[11];
    for (int beam = 0; beam < out.size(); ++beam) {
        const double approach = -(slope_x * beams[0][beam] + slope_y * beams[1][beam]);
        const bool on_floor = approach > 0.0 && approach >= out[beam] * height * (1.0 - 1e-9);
        if (on_floor && approach < least) out[beam] = (1.0 - 1e-12) / range_max;
    }
}

// Turn 1 / distance [1/m] into readings [m].
FG_VERSIONS void write_readings(double range_min, double range_max, Row<double> out) {
    for (int beam = 0; beam < out.size(); ++beam) {
        double distance = 1.0 / out[beam];
        distance = distance < range_max ? distance : inf;
        out[beam] = distance >= range_min ? distance : -inf;
    }
}

}  // namespace

void scan(const Scene& scene, const Scratch& scratch, Numbers position, Matrix rotation, Matrix moving_positions,
          Cube<const double> moving_rotations, Row<double> out, int own_tree, const Optics& optics) {
    for (int beam = 0; beam < out.size(); ++beam)  // until the end `out` holds 1 / distance; what is farther is not drawn
        out[beam] = (1.0 - 1e-12) / scene.range_max();
    for (int frame = 0; frame < scene.frames.rows; ++frame) {
        const Row<const std::int32_t> parts = scene.frames[frame];
        const int first_cluster = parts[0], behind_cluster = parts[1];
        if (frame == 0) {
            look_from(position, rotation, scratch.poses[0]);
        } else {
            const Numbers at = moving_positions[frame - 1];
            const Matrix turn = moving_rotations[frame - 1];
            if (parts[6] == own_tree || is_off_plane(scene.spheres[frame], position, rotation, at, turn)) {
                skip(first_cluster, behind_cluster, scratch);
                continue;
            }
            look_from_moving(position, rotation, at, turn, scratch.poses[frame]);
        }
        const Pose pose(scratch.poses[frame]);
        for (int plane = parts[2]; plane < parts[3]; ++plane) draw_plane(scene.planes[plane], pose, scene.beams, out);
        for (int shape = parts[4]; shape < parts[5]; ++shape) draw_shape(scene, scene.shapes[shape], pose, out, optics);
        survey(scene, pose, first_cluster, behind_cluster, scratch);
    }
    const int turn = whole_turn(scene);
    const int count = sort_by_distance(scene, scratch);
    for (int place = 0; place < count; ++place) {
        const int cluster = scratch.views[2][place];
        const int right = scratch.views[0][cluster], left = scratch.views[1][cluster];
        if (!is_hidden(right, left, scratch.nearest[cluster], turn, out))
            draw_cluster(scene, cluster, scratch, out, optics);
    }
    if (optics.glancing > 0.0) [[unlikely]]
        for (int plane = scene.frames[0][2]; plane < scene.frames[0][3]; ++plane)
            lose_glancing(scene.planes[plane], Pose(scratch.poses[0]), scene.beams, scene.range_max(), out,
                          optics.glancing);
    write_readings(scene.range_min(), scene.range_max(), out);
}

}  // namespace fg
