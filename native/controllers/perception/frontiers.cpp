#include "frontiers.hpp"

#include <algorithm>
#include <memory>
#include <tuple>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../../core/versions.hpp"
#include "cells.hpp"

namespace fg {
namespace {

constexpr double moved_on = 0.2;       // [m] after which a scan is entered
constexpr double turned_on = 0.1;      // [rad] the same
constexpr int enter_every = 3;         // ticks, the same
constexpr double lasts = 0.25;         // of the distance to the frontier, after which it is searched again
constexpr double lasts_at_most = 2.0;  // [m] the same, at most,
constexpr double lasts_led = 0.3;      // [m] while the car is not driven by its planner alone,
constexpr double lasts_seen = 0.8;     // [m] and before a motion is searched for
constexpr double first_opened = 0.6;   // [m] before the end of the path that stay open
constexpr double all_closed = 15.0;    // [m] of the path that are closed
constexpr double closed_loop = 8.0;    // [m] the same, on a course that is shorter
constexpr double opened_more = 2.0;    // [m] at a time, before the end of a path into a pocket
constexpr double pocket = 6.0;         // [m] deepest pocket that the car leaves again
constexpr double widest = 3.0;         // [m] of a line across open ground, to either side
constexpr int least_frontier = 5;      // cells
constexpr int least_frontier_back = 10;  // cells, where the car has to leave a pocket for it
constexpr double wide = 3.0;             // [m] of a frontier; more counts as this
constexpr double same = 1.0;  // [m] from the last frontier: another one counts as the same, and as 1 m farther
constexpr double step_aside = 0.5 * cell_width;  // [m] along a line across the path

constexpr int chunk = 16;                   // steps along that line that are computed together
constexpr std::int64_t farthest = 1 << 30;  // column or row, for these steps

constexpr int most_cells = map_size * map_size;

using Byte = std::uint8_t;
using Cell = std::uint16_t;

// The cells of the map in one search: each is a number, its column in the ring times `map_size`, and its row.
struct Ground {
    Byte bits[most_cells];      // of each cell, see `cells`
    Cell distance[most_cells];  // of each cell from the car, in cells
    Cell queue[most_cells];     // cells in the order of that distance; the first is that of the LiDAR
    Cell edge[most_cells];      // those of them at ground that nobody has seen
    Cell goal[most_cells];      // cells of the frontier
    Cell group[most_cells];     // cells of a frontier that is looked at
    Byte label[most_cells];     // 1: at unknown ground, 2: in a frontier that was looked at
};

// Enter a scan; arguments as of `search_frontier`.
void enter(const ScanGeometry& geometry, Numbers ranges, double lidar_offset, FrontierSearch& memory) {
    memory.entered = memory.ticks, memory.entered_driven = memory.map.driven;
    memory.entered_heading = memory.map.heading;
    enter_scan(memory.map, geometry, ranges, lidar_offset);
}

// Return the index of the point of the path so many points before its end.
std::int64_t index_back(const LocalMap& world, std::int64_t back) {
    const std::int64_t index = (world.newest - back) % path_points;
    return index < 0 ? index + path_points : index;
}

// Return the number of the cell in a column and a row.
std::int64_t number_of(std::int64_t i, std::int64_t j) { return (i & map_ring) * map_size | (j & map_ring); }

// Return column and row of the cell at a distance to the left of a point of the path [m].
std::array<std::int64_t, 2> aside_of(Numbers point, double aside) {
    return {floored((point[0] - aside * point[path_sin]) * cells_per_metre),
            floored((point[1] + aside * point[path_cos]) * cells_per_metre)};
}

// Write the columns and rows of the cells at some steps to the left of a point of the path, from the `first` one on.
inline void write_across(Numbers point, double step_left, std::int64_t first, std::int32_t (&columns)[chunk],
                         std::int32_t (&rows)[chunk]) {
    const double x = point[0], y = point[1], sin = point[path_sin], cos = point[path_cos];
    FG_INDEPENDENT
    for (int k = 0; k < chunk; ++k) {
        const double aside = step_left * (static_cast<double>(first) + k);
        const double u = (x - aside * sin) * cells_per_metre, v = (y + aside * cos) * cells_per_metre;
        const std::int32_t column = static_cast<std::int32_t>(u), row = static_cast<std::int32_t>(v);
        columns[k] = column - (column > u), rows[k] = row - (row > v);
    }
}

// Block a line across the corridor at a point of the path, to one side: 1 left, -1 right; see `close_path`.
FG_VERSIONS void close_side(const LocalMap& world, Row<Byte> bits, Numbers point, int side, bool open_ground) {
    const double room = point[side == 1 ? path_left : path_right], step_left = side * 0.5 * cell_width;
    const std::int64_t steps = floored((open_ground ? widest : room) / step_aside) + 1;
    const auto first = aside_of(point, 0.0), last = aside_of(point, step_left * static_cast<double>(steps - 1));
    const bool whole = in_window(world, first[0], first[1]) && in_window(world, last[0], last[1]);
    const bool fits = whole && std::abs(first[0]) < farthest && std::abs(first[1]) < farthest;
    std::int32_t columns[chunk], rows[chunk];
    std::int64_t before = -1;
    for (std::int64_t step = 0; step < steps; ++step) {
        if (fits && step % chunk == 0) write_across(point, step_left, step, columns, rows);
        const auto [i, j] = fits ? std::array<std::int64_t, 2>{columns[step % chunk], rows[step % chunk]}
                                 : aside_of(point, step_left * static_cast<double>(step));
        if (!(whole || in_window(world, i, j))) break;
        const std::int64_t cell = number_of(i, j);
        if (open_ground && step_aside * static_cast<double>(step) > room && (bits[cell] & (open_cell | unseen)) == 0)
            break;
        if (cell == before) continue;
        before = cell;
        bits[cell] |= way_back;
        bits[(cell + map_size) & last_cell] |= way_back;  // two cells, or a diagonal step passes it
    }
}

// Block a line across the corridor at each point of the path from `opened` to `closed` [m] before its end.
//
// On open ground the lines go on up to a wall, or `widest` to either side.
void close_path(const LocalMap& world, Row<Byte> bits, double opened, double closed, bool open_ground) {
    double until = world.along - opened;
    if (opened > first_opened) until = max(until, world.furthest - pocket);
    for (std::int64_t back = 0; back < world.known; ++back) {
        const Numbers point = row(world.path[index_back(world, back)]);
        if (world.along - point[path_along] > closed) break;
        if (point[path_along] > until) continue;
        for (const int side : {1, -1}) close_side(world, bits, point, side, open_ground);
    }
}

// Close the path from `opened` to `closed` [m], and spread distances from the car; return what `flood` does.
std::int64_t spread(const LocalMap& world, Ground& ground, double opened, double closed, bool open_ground,
                    int impassable) {
    for (Byte& bits : ground.bits) bits &= 255 - way_back;  // remove all lines across the path
    close_path(world, row(ground.bits), opened, closed, open_ground);
    std::fill_n(ground.distance, most_cells, Cell{no_way});
    ground.distance[ground.queue[0]] = 0;
    return flood(world, row(ground.bits), row(ground.distance), row(ground.queue), row(ground.edge), impassable);
}

// Return whether the car, going on, reaches its path behind the part that is closed; that cell is the goal then.
bool find_behind(FrontierSearch& memory, Ground& ground) {
    const LocalMap& world = memory.map;
    for (std::int64_t back = 0; back < world.known; ++back) {
        const Numbers point = row(world.path[index_back(world, back)]);
        const std::int64_t cell = cell_at(point[0], point[1]);
        const bool behind = world.along - point[path_along] > closed_loop + 2.0 * cell_width;
        if (behind && ground.distance[cell] != no_way) {
            ground.goal[0] = static_cast<Cell>(cell);
            memory.x = point[0], memory.y = point[1];
            return true;
        }
    }
    return false;
}

// Return whether the ground beyond the room beside a point of the path is reached from the car, to one side.
bool is_passed(const LocalMap& world, const Cell* distance, Numbers point, int side) {
    const double room = point[side == 1 ? path_left : path_right];
    std::int64_t cell = 0;
    for (int cells = -1; cells < 3; ++cells) {
        const auto [i, j] = aside_of(point, side * (room + cells * cell_width));
        if (!in_window(world, i, j) || (world.cells[i & map_ring][j & map_ring] & cell_kind) == wall_cell)
            return false;  // the ground behind a thin barrier is another lane
        cell = number_of(i, j);
    }
    return distance[cell] != no_way;
}

// Return whether the ground along the closed path is reached from the car at a third of its points, or more.
bool is_open_ground(const LocalMap& world, const Cell* distance) {
    int points = 0, passed = 0;
    for (std::int64_t back = 0; back < world.known; ++back) {
        const Numbers point = row(world.path[index_back(world, back)]);
        const double age = world.along - point[path_along];
        if (age > all_closed) break;
        if (age > 2.0) {
            ++points;
            passed += is_passed(world, distance, point, 1) || is_passed(world, distance, point, -1);
        }
    }
    return 3 * passed > points && points > 10;
}

// A frontier: how many cells it has, their mean distance from the car [m], and its middle [m].
struct Frontier {
    int count;
    double far, x, y;
};

// Write the cells of the frontier that a cell belongs to, and return it.
Frontier gather(const LocalMap& world, Ground& ground, Cell start) {
    Frontier frontier{1, 0.0, 0.0, 0.0};
    ground.label[start] = 2;
    ground.group[0] = start;
    for (int at = 0; at < frontier.count; ++at) {
        const auto [i, j] = indices_of(world, ground.group[at]);
        frontier.far += ground.distance[ground.group[at]] * cell_width;
        frontier.x += static_cast<double>(i) * cell_width;
        frontier.y += static_cast<double>(j) * cell_width;
        for (int a = -1; a <= 1; ++a)
            for (int b = -1; b <= 1; ++b) {
                const std::int64_t cell = number_of(i + a, j + b);
                if (ground.label[cell] != 1) continue;
                ground.label[cell] = 2;
                ground.group[frontier.count++] = static_cast<Cell>(cell);
            }
    }
    frontier.far /= frontier.count, frontier.x /= frontier.count, frontier.y /= frontier.count;
    return frontier;
}

// Write the cells of the best frontier of at least so many, and its middle; return how many; 0: there is none.
int choose_frontier(FrontierSearch& memory, Ground& ground, std::int64_t edges, int least) {
    std::fill_n(ground.label, most_cells, Byte{0});
    for (std::int64_t index = 0; index < edges; ++index) ground.label[ground.edge[index]] = 1;
    double best = 0.0;
    const double last_x = memory.x, last_y = memory.y;
    int best_count = 0;
    for (std::int64_t index = 0; index < edges; ++index) {
        if (ground.label[ground.edge[index]] != 1) continue;
        const auto [count, far, x, y] = gather(memory.map, ground, ground.edge[index]);
        if (count < least) continue;
        double score = far + 2.0 * min(count * cell_width, wide);
        if (memory.found && fg::hypot(x - last_x, y - last_y) < same) score += 1.0;
        if (score > best) {
            best = score, best_count = count, memory.x = x, memory.y = y;
            std::copy_n(ground.group, count, ground.goal);
        }
    }
    return best_count;
}

// Write the cells of the frontier ahead, see 1. to 3.; return how many, and if they are the path's far side.
std::tuple<int, bool> find_ahead(FrontierSearch& memory, Ground& ground) {
    LocalMap& world = memory.map;
    double opened = 0.0;
    std::int64_t edges = spread(world, ground, first_opened, all_closed, false, at_wall);
    const bool open_ground = is_open_ground(world, ground.distance);
    if (open_ground) edges = spread(world, ground, first_opened, all_closed, true, at_wall);
    int count = choose_frontier(memory, ground, edges, least_frontier);
    if (count == 0 && !open_ground) {
        spread(world, ground, first_opened, closed_loop, false, at_wall);
        if (find_behind(memory, ground)) return {1, true};
    }
    while (count == 0 && opened < pocket) {
        opened += opened_more;
        edges = spread(world, ground, opened, all_closed, open_ground, near_wall);
        count = choose_frontier(memory, ground, edges, least_frontier_back);
    }
    if (count > 0 && opened > 0.0) cut_path(world, max(world.along - opened, world.furthest - pocket));
    return {count, false};
}

// Search the frontier, and write the distance to it.
void find_frontier(FrontierSearch& memory, double lidar_offset) {
    LocalMap& world = memory.map;
    const auto ground = std::make_unique_for_overwrite<Ground>();
    const std::int64_t free = mark_cells(world, {ground->bits, map_size, map_size});
    ground->queue[0] = static_cast<Cell>(cell_at(world.x + lidar_offset * fg::cos(world.heading),
                                                 world.y + lidar_offset * fg::sin(world.heading)));
    const auto [count, loop] = find_ahead(memory, *ground);
    memory.found = count > 0;
    memory.hidden = memory.found && !loop && fg::hypot(memory.x - world.x, memory.y - world.y) < sight - 1.0;
    std::fill_n(ground->distance, most_cells, Cell{no_way});
    std::fill_n(&memory.distance_to_goal[0][0], map_blocks * map_blocks, Cell{no_way});
    dijkstra(row(ground->bits), row(ground->distance), table(memory.distance_to_goal), row(ground->goal).part(0, count),
             free);
}

// Enter the scan and search the frontier; arguments as of `search_frontier`.
void search(const ScanGeometry& geometry, Numbers ranges, double lidar_offset, FrontierSearch& memory) {
    if (memory.entered != memory.ticks) enter(geometry, ranges, lidar_offset, memory);
    memory.searched = memory.marked = memory.ticks;
    memory.searched_driven = memory.map.driven;
    find_frontier(memory, lidar_offset);
}

}  // namespace

void search_frontier(const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, double lidar_offset,
                     FrontierSearch& memory, std::int64_t every, std::int64_t every_plain, bool led) {
    LocalMap& world = memory.map;
    move(world, odometry.speed, odometry.angular_velocity[2], period_of(geometry));
    extend_path(world, geometry, ranges);
    const std::int64_t since = memory.ticks - memory.searched;
    const double driven = world.driven - memory.searched_driven;
    bool due = memory.ticks == 0 || since >= (memory.found ? every_plain : every);
    if (since >= every && !due) {
        const double apart = fg::hypot(memory.x - world.x, memory.y - world.y);
        due = driven >= min(lasts * apart, led ? lasts_led : lasts_at_most);
    }
    const double moved = world.driven - memory.entered_driven;
    const double turned = std::abs(world.heading - memory.entered_heading);
    memory.nodes = 0;
    memory.ticks += 1;
    if (due)
        search(geometry, ranges, lidar_offset, memory);
    else if (moved >= moved_on || turned >= turned_on || memory.ticks - memory.entered > enter_every)
        enter(geometry, ranges, lidar_offset, memory);
}

void only_move(const ScanGeometry& geometry, Numbers ranges, const Odometry& odometry, FrontierSearch& memory) {
    move(memory.map, odometry.speed, odometry.angular_velocity[2], period_of(geometry));
    extend_path(memory.map, geometry, ranges);
    memory.ticks += 1;
}

void look_again(const ScanGeometry& geometry, Numbers ranges, double lidar_offset, FrontierSearch& memory,
                std::int64_t every) {
    if (memory.ticks - memory.marked < every) return;
    if (memory.map.driven - memory.searched_driven >= lasts_seen) {
        search(geometry, ranges, lidar_offset, memory);
        return;
    }
    if (memory.entered != memory.ticks) enter(geometry, ranges, lidar_offset, memory);
    memory.marked = memory.ticks;
    Byte bits[map_size][map_size];
    mark_cells(memory.map, table(bits));
}

double distance_to_goal_at(const FrontierSearch& memory, double x, double y) {
    if (!in_window(memory.map, floored(x * cells_per_metre), floored(y * cells_per_metre))) return inf;
    constexpr int last = map_blocks - 1;
    const auto distance = [&](std::int64_t i, std::int64_t j) -> int {
        return memory.distance_to_goal[i & last][j & last];
    };
    double u = 0.5 * cells_per_metre * x, v = 0.5 * cells_per_metre * y;
    const int here = distance(floored(u), floored(v));
    if (here == no_way) return inf;
    const std::int64_t i = floored(u - 0.5), j = floored(v - 0.5);
    u = u - 0.5 - static_cast<double>(i), v = v - 0.5 - static_cast<double>(j);
    const int a = distance(i, j), b = distance(i, j + 1), c = distance(i + 1, j), d = distance(i + 1, j + 1);
    if (a == no_way || b == no_way || c == no_way || d == no_way) return way_unit * here;
    return way_unit * ((1.0 - u) * ((1.0 - v) * a + v * b) + u * ((1.0 - v) * c + v * d));
}

double distance_to_goal_around(const FrontierSearch& memory, double x, double y) {
    for (int reach = 0; reach < 7; ++reach) {
        double least = inf;
        for (int i = -reach; i <= reach; ++i) {
            const int step = std::abs(i) == reach || reach == 0 ? 1 : 2 * reach;  // the sides of a square
            for (int j = -reach; j <= reach; j += step)
                least = min(least, distance_to_goal_at(memory, x + i * cell_width, y + j * cell_width) +
                                       reach * cell_width);
        }
        if (least < inf) return least;
    }
    return inf;
}

std::array<double, 2> least_distance_towards(const FrontierSearch& memory, double x, double y, double cos, double sin,
                                             double distance) {
    const double step_x = 0.2 * cells_per_metre * cos, step_y = 0.2 * cells_per_metre * sin;
    x = x * cells_per_metre, y = y * cells_per_metre;
    int least = no_way;
    std::int64_t at = 0;
    const std::int64_t steps = floored(min(distance, sight) / 0.2);  // all of these are in the window
    for (std::int64_t step = 1; step <= steps; ++step) {
        const std::int64_t i = floored(x + static_cast<double>(step) * step_x);
        const std::int64_t j = floored(y + static_cast<double>(step) * step_y);
        const int cells = memory.distance_to_goal[(i & map_ring) >> 1][(j & map_ring) >> 1];
        if (cells < least) least = cells, at = step;
    }
    if (least == no_way) return {inf, 0.0};
    return {least * way_unit, 0.2 * static_cast<double>(at)};
}

}  // namespace fg
