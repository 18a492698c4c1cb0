// Cells of the local map: which are free or unknown and how near walls are, and distances over the free ones.
#pragma once
#include <array>
#include <cstdint>

#include "../../core/arrays.hpp"
#include "local_map.hpp"

namespace fg {

// Bits of a cell: a wall is within two cells; closed by `frontiers`; a wall is within one cell; free; unknown; a wall
// is in the square of six cells to each side, and in that of four.
inline constexpr int near_wall = 1, way_back = 2, at_wall = 4, open_cell = 16, unseen = 32, within_6 = 64;
inline constexpr int within_4 = 128;
inline constexpr int no_way = 65535;      // distance of a cell to which no way is known
inline constexpr double way_unit = 0.01;  // [m] of the distances of `dijkstra`; those of `flood` are in cells
inline constexpr int last_cell = map_size * map_size - 1;  // the greatest number of a cell
// Blocks of two by two cells to a side: of each of them one distance to the goal is kept.
inline constexpr int map_blocks = map_size / 2;

// Write the bits of all cells, without `way_back`, and the nearness of the map's; return how many may be free.
std::int64_t mark_cells(LocalMap& world, Table<std::uint8_t> bits);

// Return the cell at a place [m].
inline std::int64_t cell_at(double x, double y) {
    return (floored(x * cells_per_metre) & map_ring) * map_size | (floored(y * cells_per_metre) & map_ring);
}

// Return the column and the row of a cell of the window.
inline std::array<std::int64_t, 2> indices_of(const LocalMap& world, std::uint16_t cell) {
    constexpr int half = map_size / 2;
    return {world.column + ((cell / map_size - world.column + half) & map_ring) - half,
            world.row + (((cell & map_ring) - world.row + half) & map_ring) - half};
}

// Return the cells that share a side with a cell.
inline std::array<std::int64_t, 4> neighbours(std::uint16_t cell) {
    const int column = cell & ~map_ring, row = cell & map_ring;
    const int right = (column + map_size) & last_cell, left = (column - map_size) & last_cell;
    return {right | row, left | row, column | ((row + 1) & map_ring), column | ((row - 1) & map_ring)};
}

// Spread distances [cells] from the first cell of the queue, whose distance is 0; that of all others is `no_way`.
// Return how many cells there are in `edge`.
//
// Steps to four neighbours and to eight take turns, which makes circles octagons. No step leaves the window: the cells
// around it are unknown.
//   bits      of each cell
//   distance  of each cell; written to
//   queue     cells in the order in which they are reached, written to
//   edge      those of them that share a side with a cell that nobody has seen, in the same order; written to
//   impassable  bits of cells that are reached in the first steps only
std::int64_t flood(const LocalMap& world, Row<const std::uint8_t> bits, Row<std::uint16_t> distance,
                   Row<std::uint16_t> queue, Row<std::uint16_t> edge, std::int64_t impassable);

// Write the way to go [way_unit] from all free cells to the nearest cell of `goal`.
//   bits      of each cell
//   distance  of each cell, `no_way`; written to
//   distance_to_goal  (map_blocks, map_blocks) the least of the cells of each block, `no_way`; written to
//   goal      cells
//   free      how many cells are free
void dijkstra(Row<const std::uint8_t> bits, Row<std::uint16_t> distance, Table<std::uint16_t> distance_to_goal,
              Row<const std::uint16_t> goal, std::int64_t free);

}  // namespace fg
