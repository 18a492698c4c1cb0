#include "local_map.hpp"

#include <algorithm>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../../core/versions.hpp"

namespace fg {
namespace {

constexpr int forget_after = 8;                // times 2 m: longer than the path that is closed (frontiers)
constexpr int swept_rows = 16;                 // searched for old cells each time: all of them within 16 entries
constexpr double step_length = 0.09;           // [m] along a beam, below a cell
constexpr double finest = 0.5 * (pi / 180.0);  // [rad] between the beams that are entered: a cell at 11 m
// Only every so many beams are followed from the LiDAR on; those between from where they are apart.
constexpr int coarsest = 8;
constexpr double joined = 0.4;                                    // [m] between neighbouring ends that are one wall
constexpr double part_length = 0.8 * cell_width;                  // [m] at most between cells of a wall that is joined
constexpr double within_part = 0.99 * part_length * part_length;  // [m^2] below it, one part is enough
constexpr double spacing = 0.1;                                   // [m] between the points of the path
// [m/m] by which the room along the path may grow: at a barrier's end the road ahead is to the side.
constexpr double widens = 0.3;
constexpr double widest = 3.0;  // [m] of the room to one side
// [rad] to either side of square to the car: beams that measure the room to its sides.
constexpr double beside = 15.0 * (pi / 180.0);
constexpr int kept_cells = 15;      // round the car that are kept when the rest is forgotten
constexpr double before = 7.0;      // [m] of path that the car is taken to have come before its first tick
constexpr double close_by = 2.0;    // [m] from the LiDAR within which the ends of beams are kept as they are
constexpr double very_close = 0.6;  // [m] the same, all of them; between, every second
constexpr int most_ends = 720;
// [m] from the rear axle within which the ends of earlier beams are kept, where no beam goes now,
constexpr double passed = 1.0;
constexpr double passed_apart = 0.03;  // [m] and no closer to each other
constexpr double farthest = 1e9;       // [m] or [rad] of a tick; beyond, it is no odometry

// Take the car to have come straight to where it is, for the length `before`.
void begin_path(LocalMap& memory) {
    memory.known = 0;
    memory.along = memory.furthest = before;
}

// Keep of the ends of beams those beside and behind the car that a LiDAR at x0, y0 [m] does not see any more.
void keep_passed_ends(LocalMap& memory, const ScanGeometry& geometry, std::int64_t beams, double x0, double y0) {
    const double cos = fg::cos(memory.heading), sin = fg::sin(memory.heading);
    const double to_right = fg::cos(geometry.angle_min);
    const double to_left = fg::cos(bearing_of(geometry, static_cast<double>(beams - 1)));
    const Table<double> ends = table(memory.ends);
    int kept = 0;
    for (int k = 0; k < memory.ends_known; ++k) {
        const double x = ends[k][0], y = ends[k][1];
        if ((x - memory.x) * (x - memory.x) + (y - memory.y) * (y - memory.y) > passed * passed) continue;
        const double ahead = cos * (x - x0) + sin * (y - y0), left = cos * (y - y0) - sin * (x - x0);
        if (ahead >= (left > 0.0 ? to_left : to_right) * std::sqrt(ahead * ahead + left * left)) continue;
        if (kept > 0) {
            const double dx = x - ends[kept - 1][0], dy = y - ends[kept - 1][1];
            if (dx * dx + dy * dy < passed_apart * passed_apart) continue;
        }
        ends[kept][0] = x, ends[kept][1] = y;
        ++kept;
    }
    memory.ends_known = kept;
}

// Make the cells of a row unknown that were seen too long ago.
FG_VERSIONS void forget_old(Row<std::uint8_t> cells, std::uint8_t now) {
    for (int j = 0; j < map_size; ++j) {
        const std::uint8_t age = static_cast<std::uint8_t>(now - (cells[j] & 240)) >> 4;
        cells[j] = age > forget_after ? std::uint8_t{unknown_cell} : cells[j];
    }
}

// Enter what is seen at the place of a cell.
inline void enter(Table<std::uint8_t> cells, double x, double y, int seen) {
    std::uint8_t& cell = cells[floored(x) & map_ring][floored(y) & map_ring];
    cell = static_cast<std::uint8_t>((cell & cell_nearness) | seen);
}

// Return the reading of a beam; 0 where there is none.
double reading(Numbers ranges, double beam) {
    if (ranges.length == 0) return 0.0;
    return ranges[beam >= 0.0 ? static_cast<std::int64_t>(beam) : 0];
}

// Return the distances to the walls to the right and to the left [m], past what is narrower than the beams.
std::array<double, 2> room_beside(const ScanGeometry& geometry, Numbers ranges) {
    double right = 0.0, left = 0.0;
    const double ahead = -geometry.angle_min / geometry.angle_increment, half = beside / geometry.angle_increment;
    const double quarter = 0.5 * pi / geometry.angle_increment, last = static_cast<double>(ranges.length) - 1.0;
    for (int index = -2; index <= 2; ++index) {
        const double aside = fg::cos(0.5 * index * beside);
        right = max(right, aside * reading(ranges, min(max(ahead - quarter + 0.5 * index * half, 0.0), last)));
        left = max(left, aside * reading(ranges, min(max(ahead + quarter + 0.5 * index * half, 0.0), last)));
    }
    return {right, left};
}

// Where beams ended [m], and the angle between those that are entered.
struct Beams {
    std::int64_t stride, count;
    double increment, x0, y0;
};

// Make the cells along the beams free, and write where they ended; the ends that are close are kept.
void enter_free(LocalMap& memory, const ScanGeometry& geometry, Numbers ranges, const Beams& beams, int now,
                Table<double> ends) {
    const Table<std::uint8_t> cells = table(memory.cells);
    const auto [stride, count, increment, x0, y0] = beams;
    const double turn_cos = fg::cos(increment), turn_sin = fg::sin(increment);
    double cos = fg::cos(memory.heading + geometry.angle_min), sin = fg::sin(memory.heading + geometry.angle_min);
    for (std::int64_t beam = 0; beam < count; ++beam) {
        const double distance = ranges[beam * stride];
        ends[beam][0] = x0 + distance * cos, ends[beam][1] = y0 + distance * sin;
        if (distance < close_by && memory.ends_known < most_ends && (distance < very_close || beam % 2 == 0)) {
            memory.ends[memory.ends_known][0] = ends[beam][0], memory.ends[memory.ends_known][1] = ends[beam][1];
            ++memory.ends_known;
        }
        int every = 1;
        while (every < coarsest && beam % (2 * every) == 0) every *= 2;
        const double first = every == coarsest ? 0.0 : 0.3 * cell_width / (increment * every);
        const double last = min(distance, sight) - 0.5 * cell_width;
        if (first < last) {
            double x = (x0 + first * cos) * cells_per_metre, y = (y0 + first * sin) * cells_per_metre;
            const double step_x = step_length / cell_width * cos, step_y = step_length / cell_width * sin;
            const std::int64_t steps = floored((last - first) / step_length) + 1;
            for (std::int64_t step = 0; step < steps; ++step) {
                enter(cells, x, y, free_cell | now);
                x += step_x;
                y += step_y;
            }
        }
        const double cos_before = cos;
        cos = cos * turn_cos - sin * turn_sin, sin = sin * turn_cos + cos_before * turn_sin;
    }
}

// Make the cells at the ends of the beams walls; ends that are close together are joined.
void enter_walls(LocalMap& memory, Numbers ranges, const Beams& beams, int now, Matrix ends) {
    const Table<std::uint8_t> cells = table(memory.cells);
    for (std::int64_t beam = 0; beam < beams.count; ++beam) {
        if (ranges[beam * beams.stride] >= sight) continue;
        const double x = ends[beam][0], y = ends[beam][1];
        double before_x = x, before_y = y;
        int parts = 1;
        if (beam > 0 && ranges[(beam - 1) * beams.stride] < sight) {
            before_x = ends[beam - 1][0], before_y = ends[beam - 1][1];
            const double square = (x - before_x) * (x - before_x) + (y - before_y) * (y - before_y);
            if (within_part < square && square < joined * joined)
                parts = static_cast<int>(std::sqrt(square) / part_length) + 1;
        }
        for (int part = 0; part < parts; ++part) {
            const double share = part > 0 ? static_cast<double>(part) / parts : 0.0;
            enter(cells, (x + share * (before_x - x)) * cells_per_metre, (y + share * (before_y - y)) * cells_per_metre,
                  wall_cell | now);
        }
    }
}

}  // namespace

void move(LocalMap& memory, double speed, double yaw_rate, double period) {
    const double way = speed * period, turn = yaw_rate * period;
    if (!memory.begun) {
        memory.begun = true;
        begin_path(memory);
        return;
    }
    if (!(std::abs(way) < farthest && std::abs(turn) < farthest)) return;  // nor is NaN
    memory.x += way * fg::cos(memory.heading + 0.5 * turn);
    memory.y += way * fg::sin(memory.heading + 0.5 * turn);
    memory.heading += turn;
    memory.driven += std::abs(way);
    memory.along += way;
    memory.furthest = max(memory.furthest, memory.along);
    if (way < 0.0) cut_path(memory, memory.along);
    const std::int64_t column = floored(memory.x * cells_per_metre), row = floored(memory.y * cells_per_metre);
    if (std::abs(column - memory.column) > map_size || std::abs(row - memory.row) > map_size) {  // odometry that jumps
        std::fill_n(&memory.cells[0][0], map_size * map_size, std::uint8_t{unknown_cell});
        memory.column = column, memory.row = row;
        begin_path(memory);
    }
    while (memory.column != column) {
        const int step = column > memory.column ? 1 : -1;
        memory.column += step;
        std::fill_n(memory.cells[(memory.column + step * (map_edge + 1)) & map_ring], map_size,
                    std::uint8_t{unknown_cell});
    }
    while (memory.row != row) {
        const int step = row > memory.row ? 1 : -1;
        memory.row += step;
        for (auto& cells : memory.cells) cells[(memory.row + step * (map_edge + 1)) & map_ring] = unknown_cell;
    }
}

void forget(LocalMap& memory) {
    for (int i = -map_edge; i <= map_edge; ++i)
        for (int j = -map_edge; j <= map_edge; ++j)
            if (max(std::abs(i), std::abs(j)) > kept_cells)
                memory.cells[(memory.column + i) & map_ring][(memory.row + j) & map_ring] = unknown_cell;
    begin_path(memory);
}

void enter_scan(LocalMap& memory, const ScanGeometry& geometry, Numbers ranges, double lidar_offset) {
    const int now = static_cast<int>(floored(memory.driven * 0.5) & 15) << 4;
    for (int more = 0; more < swept_rows; ++more) {
        memory.swept = (memory.swept + 1) & map_ring;
        forget_old(row(memory.cells[memory.swept]), static_cast<std::uint8_t>(now));
    }
    Beams beams;
    beams.stride = max(std::int64_t{1}, floored(finest / geometry.angle_increment + 1e-6));
    beams.count = (ranges.length + beams.stride - 1) / beams.stride;
    beams.increment = static_cast<double>(beams.stride) * geometry.angle_increment;
    beams.x0 = memory.x + lidar_offset * fg::cos(memory.heading);
    beams.y0 = memory.y + lidar_offset * fg::sin(memory.heading);
    const OwnTable<double> ends(beams.count, 2);
    keep_passed_ends(memory, geometry, ranges.length, beams.x0, beams.y0);
    enter_free(memory, geometry, ranges, beams, now, ends);
    enter_walls(memory, ranges, beams, now, ends);
}

void extend_path(LocalMap& memory, const ScanGeometry& geometry, Numbers ranges) {
    const Row<double> last = row(memory.path[memory.newest]);
    const bool begins = memory.known == 0;
    if (!begins && memory.along - last[path_along] < spacing) return;
    auto [right, left] = room_beside(geometry, ranges);
    if (!begins) {
        const double wider = widens * (memory.along - last[path_along]);
        right = min(right, last[path_right] + wider), left = min(left, last[path_left] + wider);
    }
    while (true) {
        memory.newest = (memory.newest + 1) % path_points;
        memory.known = min(memory.known + 1, std::int64_t{path_points});
        const Row<double> point = row(memory.path[memory.newest]);
        point[0] = memory.x, point[1] = memory.y, point[2] = memory.heading;
        point[path_right] = min(right, widest), point[path_left] = min(left, widest);
        point[path_sin] = fg::sin(memory.heading), point[path_cos] = fg::cos(memory.heading);
        point[path_along] = begins ? static_cast<double>(memory.known) - 1.0 : memory.along;
        if (!begins || point[path_along] >= before) break;
    }
}

void cut_path(LocalMap& memory, double along) {
    while (memory.known > 1 && memory.path[memory.newest][path_along] > along) {
        memory.newest = (memory.newest + path_points - 1) % path_points;
        --memory.known;
    }
    memory.along = max(memory.path[memory.newest][path_along], along);
}

}  // namespace fg
