// Nothing is to be found where all cars are further from what is solid, and from each other, than they reach, and stand
// over the ground.
#include "clear_ground.hpp"

#include <array>

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double reach = 1.0;    // [m] greatest distance that is measured
constexpr double cell = 0.25;    // [m]
constexpr double same = 1e-10;   // [m^2] square of the distance of two corners that are one
constexpr double upright = 0.8;  // [-] cosine of a car's tilt, up to which the corners of its hull are lowest

struct Span {
    std::int64_t first, behind;
};

struct Point {
    double x, y;
};

// A row of `bodies` [m].
struct Body {
    double middle[3], half_side[3];     // of the hull
    double radius;                      // of a ball around the car
    double ball_distance, ball_radius;  // of three balls around it: of the outer ones from the middle one, and of each

    explicit Body(Numbers b)
        : middle{b[0], b[1], b[2]}, half_side{b[3], b[4], b[5]}, radius(b[6]), ball_distance(b[7]), ball_radius(b[8]) {}
};

// Return which of `count` cells in a row reach from `low` to `high` [m].
Span cells(double low, double high, std::int64_t count) {
    return {max(std::int64_t{whole(low / cell)}, std::int64_t{0}), min(std::int64_t{whole(high / cell)} + 2, count)};
}

// Return where a point of a car is, of which the place from its base is given [m].
std::array<double, 3> placed(Numbers qpos, std::int64_t q, double a, double b, double c) {
    const double w = qpos[q + 3], x = qpos[q + 4], y = qpos[q + 5], z = qpos[q + 6];
    const double forward = a * (1.0 - 2.0 * (y * y + z * z)) + 2.0 * (b * (x * y - w * z) + c * (x * z + w * y));
    const double left = b * (1.0 - 2.0 * (x * x + z * z)) + 2.0 * (a * (x * y + w * z) + c * (y * z - w * x));
    const double up = c * (1.0 - 2.0 * (x * x + y * y)) + 2.0 * (a * (x * z - w * y) + b * (y * z + w * x));
    return {qpos[q] + forward, qpos[q + 1] + left, qpos[q + 2] + up};
}

// Return the position from above of a point so far ahead of the middle of a car's hull [m].
Point place(Numbers qpos, std::int64_t q, const Body& body, double along) {
    const auto [x, y, z] = placed(qpos, q, body.middle[0] + along, body.middle[1], body.middle[2]);
    return {x, y};
}

// Return at least how far a point is from what stands [m], by the best of four cells around it; NaN: no point.
double distance(const ClearGround& clear, Point point) {
    const double across = (point.x - clear.corner[0]) / cell, up = (point.y - clear.corner[1]) / cell;
    if (!(std::abs(across) < 1e9 && std::abs(up) < 1e9)) return nan;
    const auto column = static_cast<std::int64_t>(std::floor(across)), row = static_cast<std::int64_t>(std::floor(up));
    double nearest = 0.0;
    for (std::int64_t i = row; i < row + 2; ++i)
        for (std::int64_t j = column; j < column + 2; ++j) {
            const bool within = 0 <= i && i < clear.distances.rows && 0 <= j && j < clear.distances.columns;
            const double known = within ? clear.distances[i][j] : reach;
            const double off_x = across - static_cast<double>(j), off_y = up - static_cast<double>(i);
            nearest = max(nearest, known - cell * std::sqrt(off_x * off_x + off_y * off_y));
        }
    return nearest;
}

// Return whether the underside of a car's hull is over the terrain, at its corners and half way along its sides.
bool is_over(const Terrain& terrain, Numbers qpos, std::int64_t q, const Body& body) {
    constexpr double bulge = 0.02;  // [m] of ground between two of these places: of a radius of 1 m or more
    for (const double ahead : {-1.0, 0.0, 1.0})
        for (const double left : {-1.0, 1.0}) {
            const auto [x, y, z] = placed(qpos, q, body.middle[0] + ahead * body.half_side[0],
                                          body.middle[1] + left * body.half_side[1],
                                          body.middle[2] - body.half_side[2]);
            if (!(z > terrain.at(x, y).height + bulge)) return false;
        }
    return true;
}

// Return whether a car, whose middle is `here`, is clear of what stands.
bool is_clear(Numbers qpos, std::int64_t q, const Body& body, Point here, const ClearGround& clear) {
    const double away = distance(clear, here);
    if (away > body.radius) return true;
    return away > body.ball_radius &&
           distance(clear, place(qpos, q, body, -body.ball_distance)) > body.ball_radius &&
           distance(clear, place(qpos, q, body, body.ball_distance)) > body.ball_radius;
}

}  // namespace

void outline(Table<const float> vertices, Row<const std::int32_t> starts, Row<const std::int64_t> ends, Matrix places,
             Matrix turns, Table<double> points) {
    std::int64_t first = 0;
    for (std::int64_t prism = 0; prism < ends.length; ++prism) {
        const std::int64_t end = ends[prism];
        const double w = turns[prism][0], x = turns[prism][1], y = turns[prism][2], z = turns[prism][3];
        double middle_x = 0.0, middle_y = 0.0;
        for (std::int64_t k = first; k < end; ++k) {
            const Row<const float> vertex = vertices[starts[prism] + k - first];
            const double a = vertex[0], b = vertex[1], c = vertex[2];
            points[k][0] = places[prism][0] + a * (1.0 - 2.0 * (y * y + z * z)) +
                           2.0 * (b * (x * y - w * z) + c * (x * z + w * y));
            points[k][1] = places[prism][1] + b * (1.0 - 2.0 * (x * x + z * z)) +
                           2.0 * (a * (x * y + w * z) + c * (y * z - w * x));
            middle_x += points[k][0] / static_cast<double>(end - first);
            middle_y += points[k][1] / static_cast<double>(end - first);
        }
        const auto angle_of = [&](std::int64_t k) {
            return fg::atan2(points[k][1] - middle_y, points[k][0] - middle_x);
        };
        for (std::int64_t k = first + 1; k < end; ++k) {
            const double own_x = points[k][0], own_y = points[k][1], angle = angle_of(k);
            std::int64_t at = k;
            for (; at > first && angle_of(at - 1) > angle; --at)
                points[at][0] = points[at - 1][0], points[at][1] = points[at - 1][1];
            points[at][0] = own_x, points[at][1] = own_y;
        }
        first = end;
    }
}

void fill(Matrix points, Row<const std::int64_t> ends, Numbers corner, Table<double> distances) {
    std::int64_t first = 0;
    for (std::int64_t outline = 0; outline < ends.length; ++outline) {
        const std::int64_t end = ends[outline];
        double low_x = points[first][0], high_x = low_x, low_y = points[first][1], high_y = low_y;
        for (std::int64_t k = first; k < end; ++k) {
            low_x = min(low_x, points[k][0]), high_x = max(high_x, points[k][0]);
            low_y = min(low_y, points[k][1]), high_y = max(high_y, points[k][1]);
        }
        const Span rows = cells(low_y - reach - corner[1], high_y + reach - corner[1], distances.rows);
        const Span columns = cells(low_x - reach - corner[0], high_x + reach - corner[0], distances.columns);
        for (std::int64_t row = rows.first; row < rows.behind; ++row) {
            const double y = corner[1] + static_cast<double>(row) * cell;
            for (std::int64_t column = columns.first; column < columns.behind; ++column) {
                const double x = corner[0] + static_cast<double>(column) * cell;
                double& known = distances[row][column];
                double nearest = known * known;
                bool inside = true;
                for (std::int64_t k = first; k < end; ++k) {
                    const std::int64_t following = k + 1 < end ? k + 1 : first;
                    const double ax = points[k][0], ay = points[k][1];
                    const double along_x = points[following][0] - ax, along_y = points[following][1] - ay;
                    const double square = along_x * along_x + along_y * along_y;
                    if (square < same) continue;  // two corners, one above the other
                    inside = inside && along_x * (y - ay) - along_y * (x - ax) >= 0.0;
                    const double share = min(max((along_x * (x - ax) + along_y * (y - ay)) / square, 0.0), 1.0);
                    const double off_x = x - ax - share * along_x, off_y = y - ay - share * along_y;
                    nearest = min(nearest, off_x * off_x + off_y * off_y);
                }
                known = inside ? 0.0 : std::sqrt(nearest);
            }
        }
        first = end;
    }
}

bool touches_nothing(Numbers qpos, Row<const Car> cars, const ClearGround& clear, const Terrain& terrain) {
    if (clear.distances.rows == 0 || clear.distances.columns == 0) return false;
    for (std::int64_t car = 0; car < cars.length; ++car) {
        const std::int64_t q = cars[car].free_qpos;
        const Body body(clear.bodies[car]);
        const double w = qpos[q + 3], x = qpos[q + 4], y = qpos[q + 5], z = qpos[q + 6];
        const double up_x = 2.0 * (x * z - w * y), up_y = 2.0 * (y * z + w * x), up_z = 1.0 - 2.0 * (x * x + y * y);
        const double middle = qpos[q + 2] + body.middle[0] * up_x + body.middle[1] * up_y + body.middle[2] * up_z;
        const double lowest = middle - body.half_side[0] * std::abs(up_x) - body.half_side[1] * std::abs(up_y) -
                              body.half_side[2] * std::abs(up_z);
        if (!(up_z > upright)) return false;  // nor is NaN
        if (terrain.level() ? !(lowest > 0.0) : !is_over(terrain, qpos, q, body)) return false;
        const Point here = place(qpos, q, body, 0.0);
        if (!is_clear(qpos, q, body, here, clear)) return false;
        for (std::int64_t other = 0; other < car; ++other) {
            const Body other_body(clear.bodies[other]);
            const Point there = place(qpos, cars[other].free_qpos, other_body, 0.0);
            const double radii = body.radius + other_body.radius, off_x = here.x - there.x, off_y = here.y - there.y;
            if (!(off_x * off_x + off_y * off_y > radii * radii)) return false;
        }
    }
    return true;
}

}  // namespace fg
