#include "band_program.hpp"

#include "../../core/numbers.hpp"

namespace fg {
namespace {

constexpr int most_steps = 60;
constexpr double short_of = 0.995;  // share of the way to the nearest bound
// Of the gradient, and of the products of multipliers and slacks, relative to the greatest gradient.
constexpr double tolerance = 1e-8;

// Write the changes of the forces (2, n) by a step, and return its share that brings a slack or a force to 0.
double until(Matrix slacks, Matrix forces, Matrix centred, Numbers step, Table<double> changes) {
    double share = inf;
    for (int i = 0; i < step.size(); ++i) {
        for (int bound = 0; bound < 2; ++bound) {
            const double inwards = bound == 0 ? step[i] : -step[i];
            const double slack = slacks[bound][i], force = forces[bound][i];
            const double change = centred[bound][i] - force - force / slack * inwards;
            changes[bound][i] = change;
            if (inwards < 0.0) share = min(share, slack / -inwards);
            if (change < 0.0) share = min(share, force / -change);
        }
    }
    return share;
}

// Return a value of H x.
double row_times(Matrix bands, Numbers x, int i) {
    const int n = x.size();
    const int before = (i - 1 + n) % n, first = (i - 2 + n) % n, after = (i + 1) % n, second = (i + 2) % n;
    const double value = bands[0][i] * x[i] + bands[1][i] * x[after] + bands[1][before] * x[before];
    return value + bands[2][i] * x[second] + bands[2][first] * x[first];
}

}  // namespace

bool least_on_ring(Matrix bands, Numbers gradient, Numbers low, Numbers high, Row<double> x) {
    const int n = gradient.size();
    double scale = 1e-12;
    for (int i = 0; i < n; ++i) scale = max(scale, std::abs(gradient[i]));
    const OwnTable<double> slacks(2, n), forces(2, n);  // to the lower and to the upper bound; multipliers
    for (int i = 0; i < n; ++i) {
        x[i] = 0.5 * (low[i] + high[i]);
        slacks[0][i] = slacks[1][i] = 0.5 * (high[i] - low[i]);
        forces[0][i] = forces[1][i] = 0.1 * scale;
    }
    const OwnTable<double> stiff(3, n), changes(2, n), centred(2, n);
    const OwnRow<double> right(n), step(n), pulled(n);
    for (int round = 0; round < most_steps; ++round) {
        double off = 0.0, gap = 0.0;
        for (int i = 0; i < n; ++i) {
            pulled[i] = gradient[i] + row_times(bands, x, i);
            off = max(off, std::abs(pulled[i] - forces[0][i] + forces[1][i]));
            gap += slacks[0][i] * forces[0][i] + slacks[1][i] * forces[1][i];
        }
        gap /= 2 * n;
        if (!std::isfinite(gap)) return false;
        if (off <= 10.0 * tolerance * scale && gap <= tolerance * scale) return true;
        for (int i = 0; i < n; ++i) {
            stiff[0][i] = bands[0][i] + forces[0][i] / slacks[0][i] + forces[1][i] / slacks[1][i];
            stiff[1][i] = bands[1][i], stiff[2][i] = bands[2][i], right[i] = -pulled[i];
            centred[0][i] = centred[1][i] = 0.0;
        }
        solve_ring(stiff, right, step);
        double share = min(until(slacks, forces, centred, step, changes), 1.0);
        double reached = 0.0;
        for (int i = 0; i < n; ++i) {
            reached += (slacks[0][i] + share * step[i]) * (forces[0][i] + share * changes[0][i]);
            reached += (slacks[1][i] - share * step[i]) * (forces[1][i] + share * changes[1][i]);
        }
        reached /= 2 * n;
        const double left = reached / gap, centre = left * left * left * gap;
        for (int i = 0; i < n; ++i) {
            centred[0][i] = (centre - step[i] * changes[0][i]) / slacks[0][i];
            centred[1][i] = (centre + step[i] * changes[1][i]) / slacks[1][i];
            right[i] = -pulled[i] + centred[0][i] - centred[1][i];
        }
        solve_ring(stiff, right, step);
        share = min(short_of * until(slacks, forces, centred, step, changes), 1.0);
        for (int i = 0; i < n; ++i) {
            x[i] += share * step[i];
            slacks[0][i] += share * step[i];
            slacks[1][i] -= share * step[i];
            forces[0][i] += share * changes[0][i];
            forces[1][i] += share * changes[1][i];
        }
    }
    return false;
}

void solve_ring(Matrix bands, Numbers right, Row<double> x) {
    const int n = right.size(), core = n - 2;
    const OwnRow<double> pivots(core), near(core), far(core);  // D, L[i, i - 1] and L[i, i - 2]
    const OwnTable<double> columns(core, 3);  // the right side, then what couples each point with the last two
    for (int i = 0; i < core; ++i) columns[i][0] = right[i];
    columns[core - 2][1] = bands[2][core - 2], columns[core - 1][1] = bands[1][core - 1];
    columns[core - 1][2] = bands[2][core - 1];
    columns[0][1] = bands[2][n - 2], columns[0][2] = bands[1][n - 1], columns[1][2] = bands[2][n - 1];
    const OwnTable<double> border(core, 3);
    for (int i = 0; i < core; ++i)
        for (int c = 0; c < 3; ++c) border[i][c] = columns[i][c];
    for (int i = 0; i < core; ++i) {
        double pivot = bands[0][i];
        if (i > 1) {
            far[i] = bands[2][i - 2] / pivots[i - 2];
            pivot -= far[i] * far[i] * pivots[i - 2];
        }
        if (i > 0) {
            double coupled = bands[1][i - 1];
            if (i > 1) coupled -= far[i] * pivots[i - 2] * near[i - 1];
            near[i] = coupled / pivots[i - 1];
            pivot -= near[i] * near[i] * pivots[i - 1];
        }
        pivots[i] = pivot;
        for (int c = 0; c < 3; ++c) {
            if (i > 0) columns[i][c] -= near[i] * columns[i - 1][c];
            if (i > 1) columns[i][c] -= far[i] * columns[i - 2][c];
        }
    }
    for (int i = core - 1; i >= 0; --i) {
        for (int c = 0; c < 3; ++c) {
            columns[i][c] /= pivots[i];
            if (i + 1 < core) columns[i][c] -= near[i + 1] * columns[i + 1][c];
            if (i + 2 < core) columns[i][c] -= far[i + 2] * columns[i + 2][c];
        }
    }
    double a = bands[0][n - 2], b = bands[1][n - 2], c = bands[0][n - 1], d = right[n - 2], e = right[n - 1];
    for (const int i : {0, 1, core - 2, core - 1}) {
        a -= border[i][1] * columns[i][1];
        b -= border[i][1] * columns[i][2];
        c -= border[i][2] * columns[i][2];
        d -= border[i][1] * columns[i][0];
        e -= border[i][2] * columns[i][0];
    }
    x[n - 2] = (c * d - b * e) / (a * c - b * b), x[n - 1] = (a * e - b * d) / (a * c - b * b);
    for (int i = 0; i < core; ++i) x[i] = columns[i][0] - columns[i][1] * x[n - 2] - columns[i][2] * x[n - 1];
}

}  // namespace fg
