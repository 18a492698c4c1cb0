// Rows of the table: s, x, y, dx, dy, length^2 of each segment; with sections the x and y of their ends on the left,
// and on the right, at the start of each segment, NaN where there is none.
#include "projection.hpp"

#include "../core/numbers.hpp"
#include "modulo.hpp"

namespace fg {
namespace {

constexpr double search = 1.5;  // [m] to either side of the previous progress; a car at 20 m/s does 0.5 m in a tick
constexpr double touch = 1e-9;  // [m^2] a point this near to the line is on it
constexpr std::int64_t plain_rows = 6;  // of a table without sections

}  // namespace

std::array<double, 2> follow(double x, double y, double near, Matrix table, double modulus) {
    const Numbers starts = table[0];
    double s = near, offset = 0.0;
    std::int64_t segment = 0;
    const int rounds = whole(std::ceil(modulus / search));
    for (int round = 0; round < rounds; ++round) {
        const double centre = modulo(s, modulus);
        double nearest = inf;
        for (std::int64_t i = segment_at(starts, centre - search); i < starts.length; ++i) {
            if (starts[i] > centre + search) break;
            const double away_x = x - table[1][i], away_y = y - table[2][i];
            const double step_x = table[3][i], step_y = table[4][i];
            const double share = min(max((away_x * step_x + away_y * step_y) / table[5][i], 0.0), 1.0);
            const double foot_x = away_x - share * step_x, foot_y = away_y - share * step_y;
            const double squared = foot_x * foot_x + foot_y * foot_y;
            if (squared < nearest) {
                nearest = squared, segment = i;
                s = starts[i] + share * std::sqrt(table[5][i]);
                offset = std::copysign(std::sqrt(squared), step_x * away_y - step_y * away_x);
            }
        }
        if (std::abs(s - centre) < 0.9 * search) break;
    }
    if (table.rows > plain_rows) s = by_sections(x, y, s, segment, table, offset > 0.0);
    return {modulo(s, modulus), offset};
}

std::int64_t segment_at(Numbers starts, double s) {
    std::int64_t first = 0, behind = starts.length;
    while (first < behind) {
        const std::int64_t middle = (first + behind) / 2;
        if (starts[middle] > s)
            behind = middle;
        else
            first = middle + 1;
    }
    return max(first - 1, std::int64_t{0});
}

bool has_sections(double s, Matrix table) {
    if (table.rows == plain_rows) return false;
    const std::int64_t segment = segment_at(table[0], s);
    return !(std::isnan(table[6][segment]) && std::isnan(table[8][segment]));
}

double by_sections(double x, double y, double s, std::int64_t segment, Matrix table, bool on_left) {
    const double side = on_left ? 1.0 : -1.0;
    const Numbers ends_x = table[on_left ? 6 : 8], ends_y = table[on_left ? 7 : 9];
    std::int64_t first = segment;
    while (first >= 0 && !std::isnan(ends_x[first])) --first;
    double past = -1.0;
    std::int64_t least = table.columns;
    for (std::int64_t i = first + 1; i < table.columns; ++i) {
        if (first == segment || std::isnan(ends_x[i])) break;
        const double away_x = x - table[1][i], away_y = y - table[2][i];
        const double aside_x = ends_x[i] - table[1][i], aside_y = ends_y[i] - table[2][i];
        const double before = past;  // how far the point is past both sections
        past = side * (away_x * aside_y - away_y * aside_x);
        if (!(before >= 0.0 && 0.0 > past)) continue;  // as of the first section, which has none before it
        const double step_x = table[3][i - 1], step_y = table[4][i - 1];
        const bool is_beside = side * (step_x * away_y - step_y * away_x) >= -touch;
        const bool is_before_wall = away_x * aside_x + away_y * aside_y <= aside_x * aside_x + aside_y * aside_y;
        const std::int64_t away = std::abs(i - 1 - segment);
        if (is_beside && is_before_wall && away < least) {
            least = away;
            const double first_x = ends_x[i - 1] - table[1][i - 1], first_y = ends_y[i - 1] - table[2][i - 1];
            const double share_before = before / std::abs(step_x * first_y - step_y * first_x);
            const double share_after = -past / std::abs(step_x * aside_y - step_y * aside_x);
            s = table[0][i - 1] + share_before / (share_before + share_after) * std::sqrt(table[5][i - 1]);
        }
    }
    return s;
}

}  // namespace fg
