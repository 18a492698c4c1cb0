// A burst of points leaves one place within an eighth of a turn: four arcs of 125 columns, whose elevations change along
// them. Triangles are drawn into the arcs as scanline.cpp draws them into a scan: of the columns and elevations that a
// triangle may cover, each asks the signs of three triple products whether it meets it. Edges are taken from the lesser
// vertex to the greater in the order of their coordinates, so that two triangles at an edge ask the same and no point
// slips through. 1 / distance over the ground is linear in the direction; each point keeps the nearest surface.
//
// Source: the depth buffer is Catmull's, leaving out clusters by it Greene's; see scanline.cpp.
#include "point_cloud.hpp"

#include <algorithm>
#include <vector>

#include "../core/transcendental.hpp"
#include "body_poses.hpp"
#include "culling.hpp"
#include "porosity.hpp"
#include "round_shapes.hpp"

namespace fg {
namespace {

constexpr double STEP = 2.0 * pi / (SECTORS * COLUMNS);  // [rad] between columns
constexpr double HALF_TURN = 0.5 * SECTORS * COLUMNS;    // in columns
constexpr double SLACK = 1e-2;                           // of a column, above the error of `bearing`
constexpr double NOTHING = 1e-9;                         // [1/m] of a point that meets nothing yet
constexpr int LANES = 4;
constexpr int LEFT = 256, RIGHT = 512, SIDES = LEFT | RIGHT;  // of the sector, that a vertex is beyond
constexpr double AHEAD = 0.9238795325112867, ASIDE = 0.3826834323650898;  // cosine and sine of half a sector, pi / 8
constexpr double WIDE = ASIDE + 1e-2, AHEAD_AT_MOST = AHEAD - 1e-2;  // of a wider one, above what columns are off

FG_INLINE Four load(const double* from) { return Four{from[0], from[1], from[2], from[3]}; }
FG_INLINE void store(double* to, Four values) {
    for (int i = 0; i < LANES; ++i) to[i] = values[i];
}

// The points of one line in a burst: directions (cosine, sine, tangent) ahead of the burst's middle, and what they meet.
struct Arc {
    const double *cosine, *sine, *tangent, *secant;
    double low, high, longest;  // of tangents and of secants
    bool turns;                 // whether the elevation does not go one way
    alignas(32) double inverse[COLUMN_ROOM], material[COLUMN_ROOM];

    // Of the elevations from a step on.
    void begin(Matrix bearings, Matrix elevations, int line, std::int64_t step) {
        cosine = &bearings[0][line * COLUMN_ROOM], sine = &bearings[1][line * COLUMN_ROOM];
        const double *tangents = elevations[0].data, *secants = elevations[1].data;
        const std::int64_t last = step + COLUMNS - 1, cycle = elevations.columns - COLUMN_ROOM, half = cycle / 2;
        tangent = tangents + step, secant = secants + step;
        low = min(tangents[step], tangents[last]), high = max(tangents[step], tangents[last]);
        longest = max(secants[step], secants[last]);
        turns = (step <= half && half <= last) || last >= cycle;
        if (turns) {
            const std::int64_t end = last >= cycle ? 0 : half;
            low = min(low, min(tangents[end], tangents[end + 1])), high = max(high, max(tangents[end], tangents[end + 1]));
            longest = max(longest, max(secants[end], secants[end + 1]));
        }
        for (int i = 0; i < COLUMN_ROOM; ++i) inverse[i] = NOTHING, material[i] = 0.0;
    }
};

// The columns of a line between two bearings, in columns of line 0.
struct Part {
    int first, last;

    Part(double right, double left, int line) {
        const double offset = static_cast<double>(line) / LINES;
        first = max(whole(std::ceil(right - offset - SLACK)), 0);
        last = min(whole(std::floor(left - offset + SLACK)), COLUMNS - 1);
    }
};

// The columns and the tangents of what may be met of something around a centre, in the frame of a burst.
struct View {
    double right, left, least, most;

    View(double x, double y, double radius, double least, double most) : least(least), most(most) {
        const double ratio = radius / (std::sqrt(x * x + y * y) + TINY);
        const double spread = (ratio + 0.5708 * ratio * ratio * ratio) / STEP;
        const double middle = bearing(x, y) / STEP + 0.5 * COLUMNS;
        const bool around = !(ratio < 1.0) || std::abs(y) < -x * 1e-3;
        right = around ? 0.0 : middle - spread - 1.0, left = around ? COLUMNS : middle + spread + 1.0;
    }
};

// Whether all within a radius of a place is outside of the sector of a burst.
FG_INLINE bool is_outside(double x, double y, double radius) { return std::abs(y) * AHEAD - x * WIDE > 1.01 * radius; }

// The tangents of an arc within columns; none of them: least above most.
struct Slopes {
    double least = inf, most = -inf;

    Slopes(const Arc& arc, const Part& part) {
        if (part.first > part.last) return;
        const double a = arc.tangent[part.first], b = arc.tangent[part.last];
        least = arc.turns ? arc.low : min(a, b), most = arc.turns ? arc.high : max(a, b);
    }
    bool meet(double low, double high) const { return low <= most && high >= least; }
};

// A cluster that may be met, and how near it comes [m].
struct Candidate {
    int cluster, frame;
    double nearest;
    View view;
};

// What of a triangle is in the sector of a burst: columns and tangents; nothing where `least` is above `most`.
struct Extent {
    double right = COLUMNS, left = 0.0, least = inf, most = -inf;

    void add(double slope, double column) {
        right = min(right, column), left = max(left, column), least = min(least, slope), most = max(most, slope);
    }
};

struct Drawing {
    const Scene& scene;
    Arc* arcs;
    Row<double> x, y, z, slope, column;  // of the vertices of a cluster; slopes are tangents of elevations
    Row<std::int32_t> in_view;          // triangles
    Row<std::int32_t> outside;          // bits: below the arc of each line, above it; left and right of the sector

    void draw_plane(Numbers plane, const Pose& pose) const;
    void draw_shape(Numbers shape, const Pose& pose) const;
    void draw_cluster(int cluster, const View& view, const Pose& pose) const;
    bool is_hidden(const View& view, double nearest) const;
    Extent clip(const std::uint16_t* corners) const;
};

// Whether all points that may meet a cluster have met something nearer than `nearest` [m].
FG_VERSIONS bool Drawing::is_hidden(const View& view, double nearest) const {
    for (int line = 0; line < LINES; ++line) {
        const Arc& arc = arcs[line];
        const Part part(view.right, view.left, line);
        if (!Slopes(arc, part).meet(view.least, view.most)) continue;
        const double limit = arc.longest * (1.0 + 1e-9) / (nearest + TINY);
        bool farther = false;
        for (int i = part.first; i <= part.last; ++i) farther |= arc.inverse[i] < limit;
        if (farther) return false;
    }
    return true;
}

Extent Drawing::clip(const std::uint16_t* corners) const {
    Extent found;
    bool to_left = false, to_right = false;
    double low = inf, high = -inf;
    for (int i = 0; i < 3; ++i) {
        const int p = corners[i], q = corners[i == 2 ? 0 : i + 1];
        const double turn = x[p] * y[q] - y[p] * x[q];
        to_left |= turn > 0.0, to_right |= turn < 0.0;
        low = min(low, z[p]), high = max(high, z[p]);
        if (!(outside[p] & SIDES)) found.add(slope[p], column[p]);
        for (const int side : {LEFT, RIGHT}) {
            if (!((outside[p] ^ outside[q]) & side)) continue;
            const double sign = side == LEFT ? AHEAD : -AHEAD;
            const double beyond = sign * y[p] - WIDE * x[p], share = beyond / (beyond - (sign * y[q] - WIDE * x[q]));
            const double cx = x[p] + share * (x[q] - x[p]), cy = y[p] + share * (y[q] - y[p]);
            const double cz = z[p] + share * (z[q] - z[p]);
            if (cx >= 0.0) found.add(cz / (std::sqrt(cx * cx + cy * cy) + TINY), side == LEFT ? COLUMNS : 0.0);
        }
    }
    if (!(to_left && to_right)) {  // it is above or below the LiDAR
        found.right = 0.0, found.left = COLUMNS;
        if (low < 0.0) found.least = -inf;
        if (high > 0.0) found.most = inf;
    }
    return found;
}

// Keep a surface in a point if it is nearer, and has no hole there.
void meet(Arc& arc, int i, double inverse, double material, double porosity, const Pose& pose) {
    if (!(inverse > arc.inverse[i])) return;
    if (porosity > 0.0) {
        const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
        const double x = arc.cosine[i] / inverse, y = arc.sine[i] / inverse, z = arc.tangent[i] / inverse;
        if (is_hole(ox + x * xx + y * yx + z * zx, oy + x * xy + y * yy + z * zy, oz + x * xz + y * yz + z * zz,
                    porosity))
            return;
    }
    arc.inverse[i] = inverse, arc.material[i] = material;
}

// Draw the front of a plane.
FG_VERSIONS void Drawing::draw_plane(Numbers plane, const Pose& pose) const {
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    const double gx = ox - plane[0], gy = oy - plane[1], gz = oz - plane[2];
    double start[3], slope_x[3], slope_y[3], slope_z[3];  // along the plane's axes
    for (int k = 0; k < 3; ++k) {
        const double nx = plane[3 + k], ny = plane[6 + k], nz = plane[9 + k];
        start[k] = gx * nx + gy * ny + gz * nz;
        slope_x[k] = xx * nx + xy * ny + xz * nz;
        slope_y[k] = yx * nx + yy * ny + yz * nz;
        slope_z[k] = zx * nx + zy * ny + zz * nz;
    }
    if (!(start[2] >= 0.0)) return;
    const double per_height = 1.0 / max(start[2], TINY);
    for (int line = 0; line < LINES; ++line) {
        Arc& arc = arcs[line];
        for (int at = 0; at < COLUMN_ROOM; at += LANES) {
            const Four c = load(arc.cosine + at), s = load(arc.sine + at), t = load(arc.tangent + at);
            const Four approach = -(slope_x[2] * c + slope_y[2] * s + slope_z[2] * t);
            const Four inverse = approach * per_height, old = load(arc.inverse + at);
            const Four along = start[0] * inverse + slope_x[0] * c + slope_y[0] * s + slope_z[0] * t;
            const Four aside = start[1] * inverse + slope_x[1] * c + slope_y[1] * s + slope_z[1] * t;
            const FourFlags met = (approach > NUMERICALLY_NONE) & (inverse > old) &
                                  (size_of(along) <= plane[12] * inverse) & (size_of(aside) <= plane[13] * inverse);
            store(arc.inverse + at, met ? inverse : old);
            store(arc.material + at, met ? Four{} + plane[14] : load(arc.material + at));
        }
    }
}

// Draw a round shape into the points that may meet it, each of which is asked.
FG_VERSIONS void Drawing::draw_shape(Numbers shape, const Pose& pose) const {
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    const double cx = shape[4] - ox, cy = shape[5] - oy, cz = shape[6] - oz, radius = shape[16] + 1e-9;
    const double x = xx * cx + xy * cy + xz * cz, y = yx * cx + yy * cy + yz * cz, z = zx * cx + zy * cy + zz * cz;
    if (is_outside(x, y, radius)) return;
    const double away = std::sqrt(x * x + y * y), near = max(away - radius, TINY), far = away + radius;
    const double low = z - radius, high = z + radius;
    const View view(x, y, radius, low / (low < 0.0 ? near : far), high / (high > 0.0 ? near : far));
    const Vector p = into_shape(shape, -cx, -cy, -cz);
    const Vector a = into_shape(shape, xx, xy, xz), b = into_shape(shape, yx, yy, yz), u = into_shape(shape, zx, zy, zz);
    for (int line = 0; line < LINES; ++line) {
        Arc& arc = arcs[line];
        const Part part(view.right, view.left, line);
        for (int i = part.first; i <= part.last; ++i) {
            const double t = arc.tangent[i];
            if (t < view.least || t > view.most) continue;
            const double cosine = 1.0 / arc.secant[i], c = cosine * arc.cosine[i], s = cosine * arc.sine[i];
            const Vector along{c * a.x + s * b.x + cosine * t * u.x, c * a.y + s * b.y + cosine * t * u.y,
                               c * a.z + s * b.z + cosine * t * u.z};
            const double distance = ray_distance(shape[0], shape[1], shape[2], shape[3], p, along);
            if (distance >= 0.0)
                meet(arc, i, arc.secant[i] / max(distance, TINY), shape[18], max(shape[17], 0.0), pose);
        }
    }
}

FG_VERSIONS void Drawing::draw_cluster(int cluster, const View& view, const Pose& pose) const {
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    const Row<const std::int32_t> span = scene.spans[cluster];
    const double porosity = max(scene.boxes[7][cluster], 0.0), material = scene.boxes[8][cluster];
    const double *vx = &scene.edges[0][span[0]], *vy = &scene.edges[1][span[0]], *vz = &scene.edges[2][span[0]];
    double *px = x.data, *py = y.data, *pz = z.data, *pt = slope.data, *pc = column.data;
    std::int32_t* sides = outside.data;
    const int count = span[1] - span[0];
    // What is below a plane through the sector is below the arc above it, and so above.
    double floor[LINES], ceiling[LINES];
    for (int line = 0; line < LINES; ++line) {
        const Slopes own(arcs[line], Part(view.right, view.left, line));
        const double low = min(own.least, 1e9), high = max(own.most, -1e9);
        floor[line] = low > 0.0 ? low : low / AHEAD_AT_MOST, ceiling[line] = high < 0.0 ? high : high / AHEAD_AT_MOST;
    }
    FG_INDEPENDENT
    for (int i = 0; i < count; ++i) {
        const double ax = vx[i] - ox, ay = vy[i] - oy, az = vz[i] - oz;
        const double bx = xx * ax + xy * ay + xz * az, by = yx * ax + yy * ay + yz * az;
        const double bz = zx * ax + zy * ay + zz * az;
        px[i] = bx, py[i] = by, pz[i] = bz;
        double bits = by * AHEAD - bx * WIDE > 0.0 ? static_cast<double>(LEFT) : 0.0;
        bits += -by * AHEAD - bx * WIDE > 0.0 ? static_cast<double>(RIGHT) : 0.0;
        for (int line = 0; line < LINES; ++line) {
            bits += bz < floor[line] * bx - 1e-9 ? static_cast<double>(1 << line) : 0.0;
            bits += bz > ceiling[line] * bx + 1e-9 ? static_cast<double>(16 << line) : 0.0;
        }
        sides[i] = static_cast<std::int32_t>(bits);
    }
    int left_over = 0;
    for (int triangle = span[2]; triangle < span[3]; ++triangle) {  // without branches, which would be guessed wrong
        const std::uint16_t* corner = scene.triangles[triangle].data;
        const int out = sides[corner[0]] & sides[corner[1]] & sides[corner[2]];
        in_view[left_over] = triangle;
        left_over += ((out & SIDES) == 0) & (((out | out >> 4) & 15) != 15);
    }
    if (left_over == 0) return;
    FG_INDEPENDENT
    for (int i = 0; i < count; ++i) {
        pt[i] = pz[i] / (std::sqrt(px[i] * px[i] + py[i] * py[i]) + TINY);
        pc[i] = bearing(px[i], py[i]) * (1.0 / STEP) + 0.5 * COLUMNS;
    }
    for (int at = 0; at < left_over; ++at) {
        const std::uint16_t* corner = scene.triangles[in_view[at]].data;  // in the order of their coordinates
        const int i = corner[0], j = corner[1], k = corner[2];
        double right = min(min(pc[i], pc[j]), pc[k]), left = max(max(pc[i], pc[j]), pc[k]);
        double least = min(min(pt[i], pt[j]), pt[k]), most = max(max(pt[i], pt[j]), pt[k]);
        if ((sides[i] | sides[j] | sides[k]) & SIDES) {
            const Extent part = clip(corner);
            if (part.least > part.most) continue;
            right = part.right, left = part.left, least = part.least, most = part.most;
        }
        // Between two bearings an edge is higher than its ends by 1 / cosine of half their difference at most.
        const double bend = 1.0 + 0.14 * STEP * STEP * (left - right) * (left - right);
        least = (least < 0.0 ? least * bend : least) - 1e-9, most = (most > 0.0 ? most * bend : most) + 1e-9;
        double n[4][3];
        bool ready = false;
        for (int line = 0; line < LINES; ++line) {
            Arc& arc = arcs[line];
            if (least > arc.high || most < arc.low) continue;
            const Part part(right, left, line);
            if (!Slopes(arc, part).meet(least, most)) continue;
            if (!ready) {
                const double a[3] = {px[i], py[i], pz[i]}, b[3] = {px[j], py[j], pz[j]}, c[3] = {px[k], py[k], pz[k]};
                const double ab[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
                const double ac[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
                for (int m = 0; m < 3; ++m) {
                    const int o = m == 2 ? 0 : m + 1, q = m == 0 ? 2 : m - 1;
                    n[0][m] = a[o] * b[q] - a[q] * b[o];
                    n[1][m] = b[o] * c[q] - b[q] * c[o];
                    n[2][m] = a[q] * c[o] - a[o] * c[q];  // from c to a: that from a to c, with the other sign
                    n[3][m] = ab[o] * ac[q] - ab[q] * ac[o];
                }
                const double volume = a[0] * n[3][0] + a[1] * n[3][1] + a[2] * n[3][2];
                if (volume == 0.0) break;  // edge-on
                for (int m = 0; m < 3; ++m) {
                    for (int side = 0; side < 3; ++side) n[side][m] = volume < 0.0 ? -n[side][m] : n[side][m];
                    n[3][m] /= volume;
                }
                ready = true;
            }
            for (int at = part.first / LANES * LANES; at <= part.last; at += LANES) {
                const Four c = load(arc.cosine + at), s = load(arc.sine + at), t = load(arc.tangent + at);
                const Four one = n[0][0] * c + n[0][1] * s + n[0][2] * t;
                const Four two = n[1][0] * c + n[1][1] * s + n[1][2] * t;
                const Four three = n[2][0] * c + n[2][1] * s + n[2][2] * t;
                const Four inverse = n[3][0] * c + n[3][1] * s + n[3][2] * t, old = load(arc.inverse + at);
                const FourFlags met = (one >= 0.0) & (two >= 0.0) & (three >= 0.0) & (inverse > old);
                if (!any(met)) continue;
                if (porosity > 0.0) [[unlikely]] {
                    for (int lane = 0; lane < LANES; ++lane)
                        if (met[lane]) meet(arc, at + lane, inverse[lane], material, porosity, pose);
                    continue;
                }
                store(arc.inverse + at, met ? inverse : old);
                store(arc.material + at, met ? Four{} + material : load(arc.material + at));
            }
        }
    }
}

// Write the points of a line, LINES rows apart; the burst looks to a bearing of this cosine and sine.
FG_VERSIONS void write_points(Matrix materials, double blind, const Arc& arc, double ahead, double aside,
                              double* points) {
    double x[COLUMN_ROOM], y[COLUMN_ROOM], z[COLUMN_ROOM], distance[COLUMN_ROOM];
    for (int i = 0; i < COLUMN_ROOM; ++i) {
        const double away = 1.0 / arc.inverse[i], c = away * arc.cosine[i], s = away * arc.sine[i];
        x[i] = ahead * c - aside * s, y[i] = aside * c + ahead * s, z[i] = away * arc.tangent[i];
        distance[i] = away * arc.secant[i];
    }
    for (int i = 0; i < COLUMNS; ++i, points += 4 * LINES) {
        const Numbers material = materials[static_cast<int>(arc.material[i])];
        const bool returns = distance[i] < material[1] && distance[i] >= blind;
        points[0] = returns ? x[i] : 0.0, points[1] = returns ? y[i] : 0.0;
        points[2] = returns ? z[i] : 0.0, points[3] = returns ? material[0] : 0.0;
    }
}

// Write how near each of some clusters comes [m], between which tangents, and where; what is outside is at FAR.
FG_VERSIONS void survey_clusters(const Scene& scene, const Pose& pose, int first, int behind, Table<double> views) {
    const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
    const Matrix& boxes = scene.boxes;
    const double *px = boxes[0].data, *py = boxes[1].data, *pz = boxes[2].data, *hx = boxes[3].data;
    const double *hy = boxes[4].data, *hz = boxes[5].data, *radii = boxes[6].data;
    double *nears = views[0].data, *lows = views[1].data, *highs = views[2].data;
    double *ahead = views[3].data, *aside = views[4].data;
    FG_INDEPENDENT
    for (int i = first; i < behind; ++i) {
        const double cx = px[i] - ox, cy = py[i] - oy, cz = pz[i] - oz, radius = radii[i];
        const double x = xx * cx + xy * cy + xz * cz, y = yx * cx + yy * cy + yz * cz, z = zx * cx + zy * cy + zz * cz;
        double gx = std::abs(cx) - hx[i], gy = std::abs(cy) - hy[i], gz = std::abs(cz) - hz[i];
        gx = gx > 0.0 ? gx : 0.0, gy = gy > 0.0 ? gy : 0.0, gz = gz > 0.0 ? gz : 0.0;
        const double nearest = std::sqrt(gx * gx + gy * gy + gz * gz), away = std::sqrt(x * x + y * y);
        const double half = std::abs(zx) * hx[i] + std::abs(zy) * hy[i] + std::abs(zz) * hz[i] + 1e-9;
        const double low = z - half, high = z + half, tall = std::abs(z) + half;
        double near = nearest * nearest - tall * tall;  // over the ground
        near = std::sqrt(near > 0.0 ? near : 0.0);
        near = near > away - radius ? near : away - radius;
        near = near > 1e-9 ? near - 1e-9 : TINY;
        nears[i] = std::abs(y) * AHEAD - x * WIDE > 1.01 * radius ? FAR : nearest;
        ahead[i] = x, aside[i] = y;
        lows[i] = low / (low < 0.0 ? near : away + radius);
        highs[i] = high / (high > 0.0 ? near : away + radius);
    }
}

}  // namespace

void cast_bursts(const Scene& scene, Matrix elevations, Matrix materials, const CloudMount& mount,
                 Row<const Link> links, Numbers before, Numbers after, Numbers shares, Cube<const double> placed,
                 std::int64_t first, Cube<double> out) {
    const std::int64_t cycle = elevations.columns - COLUMN_ROOM;
    const int moving = scene.frames.rows - 1, fixed = placed.rows;
    std::int64_t longest = 0, most = 1;  // of vertices and triangles of a cluster
    for (std::int64_t i = 0; i < scene.spans.rows; ++i) {
        const Row<const std::int32_t> span = scene.spans[i];
        longest = max(longest, std::int64_t{span[1] - span[0]}), most = max(most, std::int64_t{span[3] - span[2]} + 1);
    }
    OwnRow<double> qpos(after.length);
    OwnTable<double> room(5, longest), poses(scene.frames.rows, 12), link_poses(links.length, 7);
    OwnTable<double> positions(moving + 1, 3), rotations(moving + 1, 9);  // of the world, and of all bodies that move
    for (int body = 0; body <= fixed; ++body)
        for (int k = 0; k < 3; ++k) rotations[body][4 * k] = 1.0;
    double* const linked_positions = &positions[0][0] + 3 * (1 + fixed);
    double* const linked_rotations = &rotations[0][0] + 9 * (1 + fixed);
    OwnTable<double> views(5, scene.spans.rows);
    OwnRow<std::int32_t> in_view(most), outside(longest);
    std::vector<Candidate> found;
    Arc arcs[LINES];
    const Drawing drawing{scene, arcs, room[0], room[1], room[2], room[3], room[4], in_view, outside};
    for (std::int64_t burst = 0; burst < shares.length; ++burst) {
        for (std::int64_t i = 0; i < after.length; ++i) qpos[i] = before[i] + shares[burst] * (after[i] - before[i]);
        // The pose of the LiDAR, turned to the middle of the sector, and those of all bodies that move.
        double place[3], turned[9], turn[9];
        const Row<const double> joint = Row<const double>(qpos).part(mount.qpos, mount.qpos + 7);
        mounted_pose(joint.part(0, 3), joint.part(3, 7), false, mount.offset_position, mount.offset_rotation,
                     {place, 3}, {turned, 3, 3});
        const std::int64_t number = first + burst, sector = number % SECTORS;
        const double angle = 2.0 * pi * (static_cast<double>(sector) + 0.5) / SECTORS;
        const double ahead = fg::cos(angle), aside = fg::sin(angle);
        for (int i = 0; i < 3; ++i) {
            turn[3 * i] = ahead * turned[3 * i] + aside * turned[3 * i + 1];
            turn[3 * i + 1] = ahead * turned[3 * i + 1] - aside * turned[3 * i];
            turn[3 * i + 2] = turned[3 * i + 2];
        }
        for (int body = 0; body < fixed; ++body)
            for (int k = 0; k < 3; ++k) positions[1 + body][k] = placed[burst][body][k];
        place_links(qpos, links, link_poses, {linked_positions, moving - fixed, 3},
                    {linked_rotations, moving - fixed, 3, 3});
        for (int line = 0; line < LINES; ++line)
            arcs[line].begin(scene.beams, elevations, line, (number * COLUMNS + line * cycle / LINES) % cycle);
        found.clear();
        for (int frame = 0; frame <= moving; ++frame) {
            const Row<const std::int32_t> parts = scene.frames[frame];
            if (frame > 0 && parts[6] == mount.tree) continue;
            look_from_moving({place, 3}, {turn, 3, 3}, positions[frame], {&rotations[frame][0], 3, 3}, poses[frame]);
            const Pose pose(poses[frame]);
            const auto [ox, oy, oz, xx, xy, xz, yx, yy, yz, zx, zy, zz] = pose;
            const Numbers sphere = scene.spheres[frame];
            if (sphere[3] < NO_END) {
                const double cx = sphere[0] - ox, cy = sphere[1] - oy, cz = sphere[2] - oz, r = sphere[3];
                if (is_outside(xx * cx + xy * cy + xz * cz, yx * cx + yy * cy + yz * cz, r)) continue;
            }
            for (int i = parts[2]; i < parts[3]; ++i) drawing.draw_plane(scene.planes[i], pose);
            for (int i = parts[4]; i < parts[5]; ++i) drawing.draw_shape(scene.shapes[i], pose);
            survey_clusters(scene, pose, parts[0], parts[1], views);
            for (int i = parts[0]; i < parts[1]; ++i) {
                if (views[0][i] >= scene.range_max()) continue;
                bool met = false;
                for (const Arc& arc : arcs) met |= views[1][i] <= arc.high && views[2][i] >= arc.low;
                if (met)
                    found.push_back({i, frame, views[0][i],
                                          {views[3][i], views[4][i], scene.boxes[6][i], views[1][i], views[2][i]}});
            }
        }
        std::sort(found.begin(), found.end(), [](const Candidate& a, const Candidate& b) {
            return a.nearest < b.nearest || (a.nearest == b.nearest && a.cluster < b.cluster);
        });
        for (const Candidate& each : found)
            if (!drawing.is_hidden(each.view, each.nearest))
                drawing.draw_cluster(each.cluster, each.view, Pose(poses[each.frame]));
        for (int line = 0; line < LINES; ++line)
            write_points(materials, scene.range_min(), arcs[line], ahead, aside, &out[burst][line][0]);
    }
}

}  // namespace fg
