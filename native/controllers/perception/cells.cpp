#include "cells.hpp"

#include <memory>

#include "../../core/versions.hpp"

namespace fg {
namespace {

using Byte = std::uint8_t;
using Cell = std::uint16_t;

constexpr int margin = 8;      // columns next to the known ones, in which their walls count
constexpr int free_start = 4;  // cells from the car that may be near a wall
constexpr int buckets = 64;    // above the greatest cost of a step; a power of two: `cost & bucket` is that of a cost
constexpr int bucket = buckets - 1;

// The bits of some columns, which are needed together: that of a column is in row `column & 15`.
struct Columns {
    Byte bits[16][map_size];

    Row<Byte> operator[](int column) { return row(bits[column & 15]); }
};

void fill(Row<Byte> column, int value) {
    for (int j = 0; j < map_size; ++j) column[j] = static_cast<Byte>(value);
}

// Return whether any of some cells is known.
FG_VERSIONS bool is_known(Row<const Byte> cells) {
    int known = 0;
    for (int j = 0; j < map_size; ++j) known |= cells[j] & cell_kind;
    return known != unknown_cell;
}

// Return the first column in which a cell is known, and the one after the last; twice the same if none is.
std::array<std::int64_t, 2> known_columns(const LocalMap& world) {
    std::int64_t first = world.column - map_edge, end = world.column + map_edge + 1;
    while (first < end && !is_known(row(world.cells[first & map_ring]))) ++first;
    while (first < end && !is_known(row(world.cells[(end - 1) & map_ring]))) --end;
    return {first, end};
}

// Write how near the walls of a column are to its cells.
//
// The bits: 1, a wall; 2, within a cell; 4, within two; `within_4`; `within_6`.
FG_VERSIONS void mark_column(Row<const Byte> cells, Row<Byte> within) {
    Byte walls[map_size + 12];
    Byte some = 0;
    for (int j = 0; j < map_size; ++j) {
        const Byte wall = (cells[j] & cell_kind) == wall_cell;
        walls[j + 6] = wall;
        some |= wall;
    }
    if (some == 0) {
        fill(within, 0);
        return;
    }
    for (int j = 0; j < 6; ++j) {
        walls[j] = walls[map_size + j];
        walls[map_size + 6 + j] = walls[6 + j];
    }
    FG_INDEPENDENT
    for (int j = 0; j < map_size; ++j) {
        const Byte one = walls[j + 5] | walls[j + 6] | walls[j + 7];
        const Byte two = one | walls[j + 4] | walls[j + 8];
        const Byte four = two | walls[j + 2] | walls[j + 3] | walls[j + 9] | walls[j + 10];
        const Byte six = four | walls[j] | walls[j + 1] | walls[j + 11] | walls[j + 12];
        within[j] = static_cast<Byte>(walls[j + 6] | one << 1 | two << 2 | six << 6 | four << 7);
    }
}

// Write the bits of two columns to a third.
FG_VERSIONS void join(Row<const Byte> left, Row<const Byte> right, Row<Byte> both) {
    FG_INDEPENDENT
    for (int j = 0; j < map_size; ++j) both[j] = left[j] | right[j];
}

// Write all bits of a column, k, by the cells of it and by what is near its own and its neighbours' cells, and the
// nearness of its cells: a nearer wall is within the greater distances.
FG_VERSIONS void mark_cells_of(int k, Columns& within, Columns& two, Columns& four, Row<Byte> cells, Row<Byte> bits) {
    const Row<Byte> a = within[k - 2], b = within[k - 1], c = within[k], d = within[k + 1], e = within[k + 2];
    const Row<Byte> left = four[k - 4], right = four[k], last = within[k + 4];
    const Row<Byte> outer_left = two[k - 6], outer_right = two[k + 5];
    FG_INDEPENDENT
    for (int j = 0; j < map_size; ++j) {
        const Byte kind = cells[j] & cell_kind;
        const Byte ground = (kind == free_cell) << 4 | (kind == unknown_cell) << 5;
        const Byte near = ((a[j] | e[j]) >> 1 | (b[j] | c[j] | d[j]) >> 2) & 1;
        const Byte touching = (c[j] >> 1 | b[j] | d[j]) & 1;
        const Byte far = (left[j] | right[j] | last[j]) & (within_4 | within_6);
        const Byte outer = (outer_left[j] | outer_right[j]) & within_6;
        const Byte all = ground | near | touching << 2 | far | outer;
        bits[j] = all;
        const Byte level = (all >> 7) + near + touching;
        cells[j] = (cells[j] & (255 - cell_nearness)) | level << 2;
    }
}

// Return the cells that share a corner with a cell, and no side.
std::array<std::int64_t, 4> diagonal_neighbours(Cell cell) {
    const int column = cell & ~map_ring, row = cell & map_ring;
    const int right = (column + map_size) & last_cell, left = (column - map_size) & last_cell;
    const int up = (row + 1) & map_ring, down = (row - 1) & map_ring;
    return {right | up, right | down, left | up, left | down};
}

// Return the costs of a step onto a cell by its bits [way_unit]: up to 4.5 times its length near a wall.
constexpr std::array<std::int32_t, 256> costs(int length) {
    std::array<std::int32_t, 256> costs{};
    for (int bits = 0; bits < 256; ++bits) {
        costs[bits] = no_way;
        if ((bits & (open_cell | way_back | at_wall)) != open_cell) continue;
        int cost = length;
        if ((bits & within_6) != 0) cost += cost / 2;
        if ((bits & within_4) != 0) cost += cost / 2;
        costs[bits] = (bits & near_wall) != 0 ? 2 * cost : cost;
    }
    return costs;
}

constexpr std::array<std::int32_t, 256> straight = costs(10), diagonal = costs(14);

}  // namespace

// Only columns with something known in them are looked at. How near walls are is worked out within each column first.
// Then columns are joined, for the greater distances two and four at a time.
std::int64_t mark_cells(LocalMap& world, Table<Byte> bits) {
    const auto [first, end] = known_columns(world);
    for (int i = 0; i < map_size; ++i) fill(bits[i], unseen);
    for (std::int64_t i = world.column - map_edge; i <= world.column + map_edge; ++i)
        if (i < first - 2 || i >= end + 2)
            fill(row(world.cells[i & map_ring]), unknown_cell);
    if (first == end) return 0;
    const int count = static_cast<int>(end - first) + 2 * margin;
    Columns within, two, four;  // of a column; of it and the next; of it and the three after
    for (int last = 0; last < count; ++last) {
        const std::int64_t at = first + last - margin;
        if (at >= first && at < end)
            mark_column(row(world.cells[at & map_ring]), within[last]);
        else
            fill(within[last], 0);
        if (last >= 1) join(within[last - 1], within[last], two[last - 1]);
        if (last >= 3) join(two[last - 3], two[last - 1], four[last - 3]);
        const int k = last - 6;  // all that it needs is there
        const std::int64_t i = first + k - margin;
        if (k < margin - 2 || std::abs(i - world.column) > map_edge) continue;
        mark_cells_of(k, within, two, four, row(world.cells[i & map_ring]), bits[i & map_ring]);
    }
    return (end - first) * map_size;
}

std::int64_t flood(const LocalMap& world, Row<const Byte> bits, Row<Cell> distance, Row<Cell> queue, Row<Cell> edge,
                   std::int64_t impassable) {
    std::int64_t first = 0, count = 1, edges = 0;
    for (int level = 0; first < count; ++level) {
        const std::int64_t end = count;
        const int looked_at = open_cell | way_back | (level >= free_start ? static_cast<int>(impassable) : 0);
        const auto reach = [&](std::int64_t cell) {
            if ((bits[cell] & looked_at) != open_cell || distance[cell] != no_way) return;
            distance[cell] = static_cast<Cell>(level + 1);
            queue[count++] = static_cast<Cell>(cell);
        };
        for (std::int64_t index = first; index < end; ++index) {
            const Cell here = queue[index];
            int seen = 0;
            for (const std::int64_t cell : neighbours(here)) {
                seen |= bits[cell];
                reach(cell);
            }
            if (level % 2 == 1)
                for (const std::int64_t cell : diagonal_neighbours(here)) reach(cell);
            if ((seen & unseen) == 0) continue;
            const auto [i, j] = indices_of(world, here);
            if (std::abs(i - world.column) < map_edge && std::abs(j - world.row) < map_edge) edge[edges++] = here;
        }
        first = end;
    }
    return edges;
}

void dijkstra(Row<const Byte> bits, Row<Cell> distance, Table<Cell> distance_to_goal, Row<const Cell> goal,
              std::int64_t free) {
    std::int32_t heads[buckets];  // of the lists of cells that wait, by their way to go modulo `buckets`
    for (std::int32_t& head : heads) head = -1;
    // A cell is come upon once over a side and once over a corner, at most.
    const std::int64_t room = 2 * free + goal.length + 8;
    const auto cells = std::make_unique_for_overwrite<Cell[]>(room);
    const auto links = std::make_unique_for_overwrite<std::int32_t[]>(room);
    std::int32_t made = 0;
    const auto wait = [&](std::int64_t cell, int cost) {
        distance[cell] = static_cast<Cell>(cost);
        cells[made] = static_cast<Cell>(cell), links[made] = heads[cost & bucket];
        heads[cost & bucket] = made++;
    };
    for (std::int64_t index = 0; index < goal.length; ++index) wait(goal[index], 0);
    int level = 0, empty = 0;
    while (empty < buckets && made <= room - 8) {
        const std::int32_t entry = heads[level & bucket];
        if (entry < 0) {
            ++level, ++empty;
            continue;
        }
        empty = 0;
        heads[level & bucket] = links[entry];
        const Cell here = cells[entry];
        if (distance[here] != level) continue;  // it was reached by a shorter way meanwhile
        Cell& nearest = distance_to_goal[here / (2 * map_size)][(here & map_ring) / 2];
        if (nearest == no_way) nearest = static_cast<Cell>(level);  // the nearest cells come first
        const auto step = [&](int cell, const std::array<std::int32_t, 256>& costs) {
            const int cost = level + costs[bits[cell]];
            if (cost < distance[cell]) wait(cell, cost);
        };
        const int column = here & ~map_ring, row = here & map_ring;
        const int right = (column + map_size) & last_cell, left = (column - map_size) & last_cell;
        const int up = (row + 1) & map_ring, down = (row - 1) & map_ring;
        step(right | row, straight), step(left | row, straight);
        step(column | up, straight), step(column | down, straight);
        step(right | up, diagonal), step(right | down, diagonal);
        step(left | up, diagonal), step(left | down, diagonal);
    }
}

}  // namespace fg
