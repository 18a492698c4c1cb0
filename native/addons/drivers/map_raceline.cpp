#include "map_raceline.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

// A point of the line and its normal, and what of the car is beside it.
struct Beside {
    double x, y, across_x, across_y, half, tail, nose;
};

// Lower a point's room to where the walls in a row of cells, from one wall point to another, leave the car.
void bound_room(const Walls& walls, std::int64_t first, std::int64_t end, const Beside& at, double& low, double& high) {
    for (std::int64_t k = first; k < end; ++k) {
        const Numbers point = walls.points[k], side = walls.sides[k];
        const double dx = point[0] - at.x, dy = point[1] - at.y;
        const double ahead = at.across_y * dx - at.across_x * dy, aside = at.across_x * dx + at.across_y * dy;
        if (!(-at.tail < ahead && ahead < at.nose)) continue;
        if (side[0] > 0.0 && aside > -side[1])
            high = min(high, aside - at.half);
        else if (side[0] < 0.0 && aside < side[1])
            low = max(low, aside + at.half);
    }
}

}  // namespace

void find_room(Matrix line, Matrix normals, const Walls& walls, std::array<double, 3> outline, double most,
               Row<double> low, Row<double> high) {
    const auto [half, tail, nose] = outline;
    const int columns = static_cast<int>(walls.starts.rows), rows = static_cast<int>(walls.starts.columns) - 1;
    const double reach = fg::hypot(max(tail, nose), half + most);
    const auto cell = [&](double place, int axis) { return whole((place - walls.origin[axis]) / walls_cell); };
    for (std::int64_t i = 0; i < line.rows; ++i) {
        const Beside at{line[i][0], line[i][1], normals[i][0], normals[i][1], half, tail, nose};
        low[i] = -most, high[i] = most;
        const int bottom = max(cell(at.y - reach, 1), 0), top = min(cell(at.y + reach, 1), rows - 1);
        const int last = min(cell(at.x + reach, 0), columns - 1);
        for (int column = max(cell(at.x - reach, 0), 0); column <= last && bottom <= top; ++column) {
            const Row<const std::int64_t> starts = walls.starts[column];
            bound_room(walls, starts[bottom], starts[top + 1], at, low[i], high[i]);
        }
    }
}

}  // namespace fg
