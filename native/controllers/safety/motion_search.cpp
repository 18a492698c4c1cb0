// Motion search: a hybrid A* over arcs. Each place is come to once with a heading and a direction, and each new node is
// kept in a heap until the search goes on from it.
#include "motion_search.hpp"

#include <cmath>
#include <cstdlib>
#include <memory>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/slip.hpp"

namespace fg {
namespace {

constexpr int shares = 5, straight = 2;  // of the grip for turning: all to the right, half, none, half, all to the left
constexpr double arc_length = 0.2;       // [m] of an arc of a standing car
constexpr double arc_time = 0.05;        // [s] and as much more as the car drives in this time
constexpr int headings = 48;
constexpr double most_turn = 3.7;        // [rad] from the heading at the start: no loops
constexpr double braking_share = 0.65;   // of the greatest braking
constexpr double turn_cost = 0.2;        // [m^2] times the squared curvature, for each metre: the wider of two ways
constexpr double steer_cost = 0.02;      // [m] for each change of the share
constexpr double reverse_cost = 0.6;     // [m] for each change of the direction
constexpr double arrived = 0.35;         // [m] of way to go
constexpr double unknown_length = 1.5;   // [m] from the start on which the way to go may be unknown
constexpr double touching_length = 0.8;  // [m] the same, on which the car may be nearer to walls than it plans
constexpr double exact = 1.4;            // [m] from the car within which its outline is compared with ends of beams
constexpr double outline_margin = 0.03;  // [m] round the outline
constexpr int part_count = 6;
constexpr double parts[part_count] = {0.2, 0.4, 0.5, 0.6, 0.8, 1.0};  // of an arc, at which the car has to be free
constexpr int half_arc = 2, whole_arc = 5;  // where nothing is near, these parts; near walls, all but half of it
constexpr double square_width = 0.25;       // [m]

// Where an arc ends.
struct Node {
    double x, y;       // [m]
    double heading;    // [rad]
    double curvature;  // [1/m] up to there
    double square;     // [m^2/s^2] of the speed
    double length;     // [m] so far
    double cos, sin;   // of the heading
    double value;      // [m] length so far, and way to go
    std::int32_t parent;
    std::int8_t share, direction;
};

// A node from which the search may go on.
struct Waiting {
    double value;
    std::int32_t node;
};

// A part of an arc of a car along x.
struct ArcPart {
    double length = nan;    // [m] of the whole arc; NaN: none yet
    double x, y, cos, sin;  // [m] of its end, and of the heading there
};

// The nodes of a search. Node 0 is the start.
struct Tree {
    explicit Tree(std::int64_t most)
        : nodes(new Node[most]), heap(new Waiting[most]) {  // not zeroed: most of them are never used
        while (slots < 2 * most) slots *= 2;
        keys = std::make_unique<std::int32_t[]>(slots);
    }

    std::unique_ptr<Node[]> nodes;
    std::unique_ptr<Waiting[]> heap;  // the least value first
    std::int64_t waiting = 0;
    std::int64_t slots = 1024;
    std::unique_ptr<std::int32_t[]> keys;  // of the places that were come to; 0 marks an empty slot
    ArcPart arcs[shares][part_count];      // those of the last node with each share
};

// What the car can do, and how far it has to keep from walls.
struct Limits {
    double tightest;         // [1/m] curvature
    double lateral;          // [m/s^2]
    double braking[shares];  // [m/s^2] by the share of the grip for turning
    std::int64_t nearest;    // as of Query
    bool reverses;
    bool clear;              // the car stands clear of walls
    std::int64_t hits;       // points of the outline that lie in cells of walls where the car stands
    double margin;           // [m] round the outline
    Ends ends;               // of a car that reverses, plans to be near walls, or is: only it compares its outline
};

// An arc from a node.
struct Arc {
    int share;         // of the grip for turning, its index
    double curvature;  // [1/m]
    double length;     // [m]
    int direction;     // 1, or -1 in reverse
};

// Return the bits of a cell, by its column and row.
int cell(const LocalMap& world, std::int64_t i, std::int64_t j) {
    return world.cells[i & map_ring][j & map_ring];
}

// Return in which line of squares a place is; those beyond the last count as in it, and before the first as -1.
int square(double along) {
    const std::int64_t line = floored(along * (1.0 / square_width));
    return static_cast<int>(min(max(line, std::int64_t{-1}), std::int64_t{Ends::squares - 1}));
}

// Return the number of the square in which an end is.
int square_of(const Ends& ends, const double (&end)[2]) {
    return max(square(end[0] - ends.left), 0) * Ends::squares + max(square(end[1] - ends.low), 0);
}

// Return whether the ground under the car's tail was seen; the LiDAR does not look backwards.
bool tail_is_seen(const LocalMap& world, const CarParameters& car, const Node& at) {
    const std::int64_t i = floored((at.x - car.rear_overhang * at.cos) * cells_per_metre);
    const std::int64_t j = floored((at.y - car.rear_overhang * at.sin) * cells_per_metre);
    return in_window(world, i, j) && (cell(world, i, j) & cell_kind) == free_cell;
}

// Write where a part of an arc ends. Most nodes have the same arcs as the last node, which `arcs` keeps.
void drive(ArcPart (&arcs)[shares][part_count], const Arc& arc, int part, const Node& here, Node& after) {
    ArcPart& kept = arcs[arc.share][part];
    const double turned = arc.curvature * parts[part] * arc.length, cos = here.cos, sin = here.sin;
    if (kept.length != arc.length) {  // the length tells the speed, and so the curvature
        const double chord = parts[part] * arc.length, half = 0.5 * turned;
        kept = {arc.length, chord * fg::cos(half), chord * fg::sin(half), fg::cos(turned), fg::sin(turned)};
    }
    const double ahead = kept.x * arc.direction, aside = kept.y, turn_sin = kept.sin * arc.direction;
    after.x = here.x + cos * ahead - sin * aside;
    after.y = here.y + sin * ahead + cos * aside;
    after.heading = here.heading + turned * arc.direction;
    after.curvature = arc.curvature;
    after.cos = cos * kept.cos - sin * turn_sin;
    after.sin = sin * kept.cos + cos * turn_sin;
}

// Return the number of the cell, heading and direction of a place, above 0; `fine` times as fine as cells are.
std::int32_t key_of(const Node& at, int fine, int direction) {
    const int cells = fine * map_size, turns = headings * fine;
    const std::int64_t i = floored(at.x * cells_per_metre * fine) & (cells - 1);
    const std::int64_t j = floored(at.y * cells_per_metre * fine) & (cells - 1);
    std::int64_t turn = floored(at.heading * (headings / (2.0 * pi)) * fine) % turns;
    if (turn < 0) turn += turns;
    return static_cast<std::int32_t>(((i * cells + j) * turns + turn) * 2 + (direction == 1) + 1);
}

// Return the slot of the table that has a key, or in which it is to be put.
std::int32_t& slot_of(const Tree& tree, std::int32_t key) {
    std::int64_t slot = (key * std::int64_t{2654435761}) & (tree.slots - 1);
    while (tree.keys[slot] != 0 && tree.keys[slot] != key) slot = (slot + 1) & (tree.slots - 1);
    return tree.keys[slot];
}

// Add a node to the heap.
void push(Tree& tree, std::int32_t node) {
    const double value = tree.nodes[node].value;
    std::int64_t index = tree.waiting++;
    while (index > 0 && tree.heap[(index - 1) / 2].value > value) {
        tree.heap[index] = tree.heap[(index - 1) / 2];
        index = (index - 1) / 2;
    }
    tree.heap[index] = {value, node};
}

// Take the node of the least value from the heap.
std::int32_t pop(Tree& tree) {
    const Waiting least = tree.heap[0], last = tree.heap[tree.waiting - 1];
    const std::int64_t size = --tree.waiting;
    std::int64_t index = 0;
    while (2 * index + 1 < size) {
        std::int64_t child = 2 * index + 1;
        if (child + 1 < size && tree.heap[child + 1].value < tree.heap[child].value) ++child;
        if (tree.heap[child].value >= last.value) break;
        tree.heap[index] = tree.heap[child];
        index = child;
    }
    tree.heap[index] = last;
    return least.node;
}

// Write the start of a search: the place to which the car drives on as it does.
void plant(const LocalMap& world, const Query& query, Node& start) {
    const double speed = max(query.speed, 0.0), driven = query.lag * speed;
    const double turned = query.curvature * query.lag * speed;
    start.x = world.x + driven * fg::cos(world.heading + 0.5 * turned);
    start.y = world.y + driven * fg::sin(world.heading + 0.5 * turned);
    start.heading = world.heading + turned;
    start.curvature = query.curvature;
    start.square = speed * speed;
    start.length = 0.0;
    start.cos = fg::cos(start.heading);
    start.sin = fg::sin(start.heading);
    start.direction = 1;
    start.parent = -1;
}

// Write what the car can do, and how near to walls it stands at the start.
void write_limits(const FrontierSearch& frontier, const Limiter& limiter, const Query& query, const Node& start,
                  Limits& limits) {
    const CarParameters& car = limiter.car;
    const LocalMap& world = frontier.map;
    const double x = start.x, y = start.y, cos = start.cos, sin = start.sin;
    limits.tightest = query.lock * fg::tan(lock_arc(limiter.slip, car)) / car.wheelbase;
    limits.lateral = query.grip * limiter.lateral;
    for (int k = 0; k < shares; ++k) {
        const double used = min(query.grip, 0.97) * (std::abs(k - straight) / static_cast<double>(straight));
        limits.braking[k] = braking_share * limiter.braking * longitudinal_share(limiter, used, true);
    }
    limits.nearest = query.nearest;
    limits.reverses = query.reverses;
    limits.clear = is_clear(frontier, car, x, y, cos, sin, query.nearest);
    limits.hits = 0;
    limits.margin = outline_margin;
    if (query.reverses || query.nearest == wall_in_1 || !limits.clear) {
        limits.ends = sorted_ends(world, world.ends_known);
        limits.hits = outline_in_walls(world, car, x, y, cos, sin);
        while (limits.margin > 0.0 && touches(limits.ends, car, x, y, cos, sin, limits.margin)) limits.margin -= 0.01;
    }
}

// Return whether the car is free along an arc to a new node; `touching`: it may still be nearer to walls.
bool is_free(Tree& tree, const Arc& arc, const Node& here, Node& after, bool touching, const FrontierSearch& frontier,
             const CarParameters& car, const Limits& limits) {
    const LocalMap& world = frontier.map;
    drive(tree.arcs, arc, half_arc, here, after);
    const double dx = after.x - world.x, dy = after.y - world.y;
    const bool close = dx * dx + dy * dy < exact * exact;
    const bool compared = touching || (close && limits.nearest == wall_in_1), corners = close && limits.reverses;
    for (int part = 0; part < part_count; ++part) {
        if (compared == (part == half_arc) && part < whole_arc) continue;  // half of the arc, or the other parts
        drive(tree.arcs, arc, part, here, after);
        if (compared) {
            const std::int64_t hits = outline_in_walls(world, car, after.x, after.y, after.cos, after.sin);
            if (hits > (touching ? limits.hits : most_in_walls)) return false;
        } else if (!is_clear(frontier, car, after.x, after.y, after.cos, after.sin, limits.nearest)) {
            return false;
        }
        // Three discs leave the corners out.
        if ((compared || corners) &&
            touches(limits.ends, car, after.x, after.y, after.cos, after.sin, limits.margin))
            return false;
    }
    return true;
}

// Write a new node at the end of an arc from a node; return the way to go there [m], or inf: it cannot be driven.
//
// `rest` is the way to go from the node.
double grow(Tree& tree, std::int32_t node, std::int32_t new_node, int choice, double rest,
            const FrontierSearch& frontier, const CarParameters& car, const Limits& limits) {
    const Node& here = tree.nodes[node];
    Node& after = tree.nodes[new_node];
    const int share = choice % shares, direction = choice < shares ? 1 : -1;
    const bool turns_round = direction != here.direction;
    if (!turns_round && std::abs(share - here.share) > 1) return inf;
    const double length = arc_length + arc_time * std::sqrt(here.square);
    const double curvature = (share - straight) / static_cast<double>(straight) *
                             min(limits.tightest, limits.lateral / max(here.square, 1e-3));
    if (std::abs(here.heading + curvature * direction * length - tree.nodes[0].heading) > most_turn) return inf;
    const Arc arc{share, curvature, length, direction};
    const bool touching = !limits.clear && here.length < touching_length;
    drive(tree.arcs, arc, whole_arc, here, after);
    const double offset = car.lidar_offset;
    const double to_go = distance_to_goal_at(frontier, after.x + offset * after.cos, after.y + offset * after.sin);
    const bool known = to_go < inf;
    if (!known && direction == 1 && !touching && here.length > unknown_length) return inf;
    const std::int32_t key = key_of(after, limits.nearest == wall_in_1 ? 2 : 1, direction);
    std::int32_t& slot = slot_of(tree, key);
    if (slot == key) return inf;  // a motion has come there
    if (direction == -1 && !tail_is_seen(frontier.map, car, after)) return inf;
    if (!is_free(tree, arc, here, after, touching, frontier, car, limits)) return inf;
    slot = key;
    const double slowest = limits.lateral / limits.tightest;  // [m^2/s^2] square of the speed that full lock is held at
    after.square = max(here.square - 2.0 * limits.braking[share] * length, min(here.square, slowest));
    after.length = here.length + length * (1.5 - 0.5 * direction + turn_cost * (after.curvature * after.curvature));
    after.length += steer_cost * std::abs(share - here.share) + reverse_cost * turns_round;
    after.share = static_cast<std::int8_t>(share);
    after.direction = static_cast<std::int8_t>(direction);
    after.parent = node;
    const double distance_to_goal = known ? to_go : rest + length;
    after.value = after.length + distance_to_goal;
    return distance_to_goal;
}

// Write the motion that leads to a node, cut off if it has too many points.
void write(Motion& motion, std::int32_t node, const Tree& tree) {
    std::int64_t count = 0;
    for (std::int32_t walk = node; walk > 0; walk = tree.nodes[walk].parent) ++count;
    motion.count = min(count, std::int64_t{motion_points});
    for (; node > 0; node = tree.nodes[node].parent) {
        if (--count >= motion_points) continue;
        const Node& from = tree.nodes[node];
        const double point[5] = {from.x, from.y, from.heading, from.curvature, static_cast<double>(from.direction)};
        for (int k = 0; k < 5; ++k) motion.points[count][k] = point[k];
    }
}

}  // namespace

bool search_motion(FrontierSearch& frontier, const Limiter& limiter, Motion& motion, const Query& query) {
    motion.found = false;
    motion.count = 0;
    const std::int64_t most = min(query.most_nodes, most_nodes - frontier.nodes);
    if (most <= 2 * shares) return false;
    Tree tree(most);
    Node& start = tree.nodes[0];
    plant(frontier.map, query, start);
    const double offset = limiter.car.lidar_offset;
    const double whole_way =
        distance_to_goal_around(frontier, start.x + offset * start.cos, start.y + offset * start.sin);
    if (!std::isfinite(whole_way)) return false;
    Limits limits;
    write_limits(frontier, limiter, query, start, limits);
    const double most_curved = min(limits.tightest, limits.lateral / max(start.square, 1e-3));
    const double turned = min(max(query.curvature / most_curved, -1.0), 1.0) * straight;
    start.share = static_cast<std::int8_t>(whole(std::rint(turned)) + straight);
    start.value = whole_way;
    push(tree, 0);
    std::int32_t count = 1, best = 0;
    double least = whole_way;
    while (tree.waiting > 0 && count < most - 2 * shares) {
        const std::int32_t node = pop(tree);
        const Node& from = tree.nodes[node];
        const double rest = from.value - from.length;
        if (node > 0 && from.direction == 1 && (rest <= arrived || rest <= whole_way - query.horizon)) {
            motion.found = true;
            best = node;
            break;
        }
        for (int choice = 0; choice < (query.reverses ? 2 * shares : shares); ++choice) {
            const double to_go = grow(tree, node, count, choice, rest, frontier, limiter.car, limits);
            if (to_go == inf) continue;
            if (to_go < least) {
                best = count;
                least = to_go;
            }
            push(tree, count);
            ++count;
        }
    }
    frontier.nodes += count;
    write(motion, best, tree);
    return motion.found;
}

bool is_clear(const FrontierSearch& frontier, const CarParameters& car, double x, double y, double cos, double sin,
              std::int64_t nearest) {
    const double back = 0.5 * car.width - car.rear_overhang, front = car.length - car.rear_overhang - 0.5 * car.width;
    for (int k = 0; k < 3; ++k) {
        const double offset = back + 0.5 * k * (front - back);
        const std::int64_t i = floored((x + offset * cos) * cells_per_metre);
        const std::int64_t j = floored((y + offset * sin) * cells_per_metre);
        if (!in_window(frontier.map, i, j) || (cell(frontier.map, i, j) & cell_nearness) >= nearest) return false;
    }
    return true;
}

std::int64_t outline_in_walls(const LocalMap& world, const CarParameters& car, double x, double y, double cos,
                              double sin) {
    std::int64_t hits = 0;
    for (int k = 0; k < 7; ++k) {
        const double along = k * car.length / 6.0 - car.rear_overhang;
        for (const double side : {-0.5 * car.width, 0.5 * car.width}) {
            const std::int64_t i = floored((x + along * cos - side * sin) * cells_per_metre);
            const std::int64_t j = floored((y + along * sin + side * cos) * cells_per_metre);
            hits += (cell(world, i, j) & cell_kind) == wall_cell;
        }
    }
    return hits;
}

Ends sorted_ends(const LocalMap& world, std::int64_t count) {
    Ends ends;
    ends.left = ends.low = inf;
    for (std::int64_t k = 0; k < count; ++k) {
        ends.left = min(ends.left, world.ends[k][0]);
        ends.low = min(ends.low, world.ends[k][1]);
    }
    constexpr int squares = Ends::squares * Ends::squares;
    int(&first)[squares + 1] = ends.first;
    for (int& each : first) each = 0;
    for (std::int64_t k = 0; k < count; ++k) ++first[square_of(ends, world.ends[k]) + 1];
    for (int k = 0; k < squares; ++k) first[k + 1] += first[k];
    for (std::int64_t k = count - 1; k >= 0; --k) {  // one place is too far until all are in their places
        const int place = --first[square_of(ends, world.ends[k]) + 1];
        ends.points[place][0] = world.ends[k][0];
        ends.points[place][1] = world.ends[k][1];
    }
    for (int k = 0; k < squares; ++k) first[k] = first[k + 1];
    first[squares] = static_cast<int>(count);
    return ends;
}

bool touches(const Ends& ends, const CarParameters& car, double x, double y, double cos, double sin, double margin) {
    const double tail = -car.rear_overhang - margin, nose = car.length - car.rear_overhang + margin;
    const double half = 0.5 * car.width + margin, middle = 0.5 * (tail + nose), reach = 0.5 * (nose - tail);
    const double across = std::abs(cos) * reach + std::abs(sin) * half + 1e-9;
    const double along = std::abs(sin) * reach + std::abs(cos) * half + 1e-9;
    const double at_x = x + middle * cos - ends.left, at_y = y + middle * sin - ends.low;
    const int low_j = max(square(at_y - along), 0), high_j = square(at_y + along);
    if (high_j < low_j) return false;
    const int last_i = square(at_x + across);
    for (int i = max(square(at_x - across), 0); i <= last_i; ++i) {  // only the ends in the squares under the outline
        const int behind = ends.first[i * Ends::squares + high_j + 1];
        for (int k = ends.first[i * Ends::squares + low_j]; k < behind; ++k) {
            const double dx = ends.points[k][0] - x, dy = ends.points[k][1] - y;
            const double ahead = cos * dx + sin * dy;
            if (tail < ahead && ahead < nose && std::abs(cos * dy - sin * dx) < half) return true;
        }
    }
    return false;
}

}  // namespace fg
