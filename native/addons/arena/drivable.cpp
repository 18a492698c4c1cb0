#include "drivable.hpp"

#include <algorithm>
#include <cmath>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../../course/modulo.hpp"
#include "../../course/projection.hpp"

namespace fg {
namespace {

// of the bundled vehicle `f1tenth` [m]: over all, rear axle to rear bumper, and of the rear axle at full steering
constexpr double car_length = 0.58, car_width = 0.31, rear_overhang = 0.11855, turning_radius = 0.7416;

constexpr int curvatures = 5;        // from full lock to the right to full lock to the left
constexpr double cell = 0.05;        // [m] of the cells of position; a step always leaves one
constexpr int headings = 72;         // cells of heading in a turn
constexpr double spacing = 0.02;     // [m] of the grid of distances
constexpr int circles = 6;           // that cover the footprint, in a row along it
constexpr double most_behind = 0.8;  // [m] behind its greatest progress: less than on a full circle
const double aligned = fg::cos(pi / 4.0);  // of the angle between the last heading and the centreline

// Distances of the nodes of a grid to the nearest wall [m].
struct Field {
    double low_x, low_y;  // [m] of its first node
    std::int64_t columns, rows;
    std::vector<double> distances;
};

struct Node {
    DrivablePose pose;
    std::int64_t before;        // index of the node before, -1 for none
    double progress, greatest;  // [m] of the node, and the greatest so far
};

std::int64_t rounded(double value) { return whole(std::nearbyint(value)); }

// Return the distance of each node of a grid to the nearest wall, where it is within reach; else inf. [m]
Field distances_to(Matrix walls, double reach) {
    double low_x = inf, low_y = inf, high_x = -inf, high_y = -inf;
    for (std::int64_t k = 0; k < walls.rows; ++k) {
        const Numbers wall = walls[k];
        low_x = min(low_x, min(wall[0], wall[2])), low_y = min(low_y, min(wall[1], wall[3]));
        high_x = max(high_x, max(wall[0], wall[2])), high_y = max(high_y, max(wall[1], wall[3]));
    }
    low_x -= 1.0, low_y -= 1.0;
    Field field{low_x, low_y, whole(std::ceil((high_x + 1.0 - low_x) / spacing)),
                whole(std::ceil((high_y + 1.0 - low_y) / spacing)), {}};
    field.distances.assign(field.columns * field.rows, inf);
    const auto first = [&](double a, double b) { return whole((min(a, b) - reach) / spacing); };
    const auto behind = [&](double a, double b) { return whole((max(a, b) + reach) / spacing) + 2; };
    for (std::int64_t k = 0; k < walls.rows; ++k) {
        const double ax = walls[k][0] - low_x, ay = walls[k][1] - low_y;
        const double bx = walls[k][2] - low_x, by = walls[k][3] - low_y;
        const double along_x = bx - ax, along_y = by - ay, squared = along_x * along_x + along_y * along_y;
        for (int i = first(ax, bx); i < behind(ax, bx); ++i) {
            for (int j = first(ay, by); j < behind(ay, by); ++j) {
                const double x = i * spacing - ax, y = j * spacing - ay;
                const double share = min(max((x * along_x + y * along_y) / squared, 0.0), 1.0);
                double& least = field.distances[i * field.rows + j];
                least = min(least, fg::hypot(x - share * along_x, y - share * along_y));
            }
        }
    }
    return field;
}

class Search {
public:
    explicit Search(Matrix walls)
        : field_(distances_to(walls, radius_ + 2.0 * spacing)),
          columns_(whole(field_.columns * spacing / cell) + 1), rows_(whole(field_.rows * spacing / cell) + 1),
          seen_(columns_ * rows_ * headings) {}

    std::vector<DrivablePose> lap(const DrivablePose& start, Matrix table, double length);

private:
    bool is_free(const DrivablePose& pose) const;
    bool is_new(const DrivablePose& pose, std::int64_t& place) const;

    // Of the circles [m]; the last term is the error of the grid.
    const double along_ = car_length / circles;
    const double radius_ = fg::hypot(0.5 * along_, 0.5 * car_width) + drivable_margin + std::sqrt(0.5) * spacing;
    const Field field_;
    const std::int64_t columns_, rows_;
    std::vector<bool> seen_;
};

// Tell whether all circles of the footprint are clear of the walls at a pose.
bool Search::is_free(const DrivablePose& pose) const {
    const double cos = fg::cos(pose.heading), sin = fg::sin(pose.heading);
    for (int circle = 0; circle < circles; ++circle) {
        const double middle = along_ * (circle + 0.5) - rear_overhang;
        const std::int64_t i = rounded((pose.x + middle * cos - field_.low_x) / spacing);
        const std::int64_t j = rounded((pose.y + middle * sin - field_.low_y) / spacing);
        if (i < 0 || j < 0 || i >= field_.columns || j >= field_.rows) return false;
        if (field_.distances[i * field_.rows + j] < radius_) return false;
    }
    return true;
}

// Tell whether no pose in the same cell was kept; writes its place.
bool Search::is_new(const DrivablePose& pose, std::int64_t& place) const {
    const int i = whole((pose.x - field_.low_x) / cell), j = whole((pose.y - field_.low_y) / cell);
    const auto k = rounded(pose.heading / (2.0 * pi) * headings) % headings;
    place = (i * rows_ + j) * headings + (k < 0 ? k + headings : k);
    return 0 <= i && i < columns_ && 0 <= j && j < rows_ && !seen_[place];
}

// Return the pose after a step on an arc.
DrivablePose stepped(const DrivablePose& from, double curvature) {
    const double half_turn = 0.5 * curvature * drivable_step;
    const double chord = half_turn == 0.0 ? drivable_step : drivable_step * fg::sin(half_turn) / half_turn;
    return {from.x + chord * fg::cos(from.heading + half_turn), from.y + chord * fg::sin(from.heading + half_turn),
            from.heading + 2.0 * half_turn};
}

// Return the poses from the first node to the last.
std::vector<DrivablePose> way(const std::vector<Node>& nodes) {
    std::vector<DrivablePose> poses;
    for (auto node = static_cast<std::int64_t>(nodes.size()) - 1; node >= 0; node = nodes[node].before) {
        poses.push_back(nodes[node].pose);
    }
    std::reverse(poses.begin(), poses.end());
    return poses;
}

// Return the poses of a lap. Depth first, and straight on before all else.
std::vector<DrivablePose> Search::lap(const DrivablePose& start, Matrix table, double length) {
    if (!is_free(start)) return {};
    std::vector<Node> nodes{{start, -1, 0.0, 0.0}};
    std::vector<std::int64_t> waiting{0};
    while (!waiting.empty()) {
        const std::int64_t index = waiting.back();
        const Node from = nodes[index];
        waiting.pop_back();
        // Full lock is put on the stack first, and straight on last, so that it is taken first.
        for (int choice = 0; choice < curvatures; ++choice) {
            const double share = 1.0 - choice / 2 * 2.0 / (curvatures - 1);
            const DrivablePose pose = stepped(from.pose, 1.0 / turning_radius * (choice % 2 == 0 ? share : -share));
            std::int64_t place;
            if (!is_new(pose, place) || !is_free(pose)) continue;
            const double along = follow(pose.x, pose.y, modulo(from.progress, length), table, length)[0];
            const double gone = modulo(along - from.progress + 0.5 * length, length) - 0.5 * length;
            const double progress = from.progress + gone;
            if (progress < from.greatest - most_behind) continue;
            seen_[place] = true;
            nodes.push_back({pose, index, progress, max(from.greatest, progress)});
            if (progress >= length && fg::cos(pose.heading - start.heading) > aligned) return way(nodes);
            waiting.push_back(static_cast<std::int64_t>(nodes.size()) - 1);
        }
    }
    return {};
}

}  // namespace

std::vector<DrivablePose> drivable_lap(Matrix walls, const DrivablePose& start, Matrix table, double length) {
    return Search(walls).lap(start, table, length);
}

}  // namespace fg
