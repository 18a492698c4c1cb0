// The method is that of addons/drivers/ltv_program.py: a predictor and corrector, each by Riccati's recursion.
#include "ltv_program.hpp"

#include <utility>

#include "../../core/numbers.hpp"

namespace fg {
namespace {

constexpr double short_of = 0.995;   // share of the way to where a slack or a multiplier is 0
constexpr double least_slack = 0.1;  // at first, as a share of the way between the bounds
constexpr double tolerance = 1e-6;   // of the mean product of slack and multiplier, and of what is missing, as a share
                                     // of the first

// One bound of a value: its slack and its multiplier, their steps, and what their product is to be.
struct Bound {
    double slack, force, slack_step, force_step, centred;
};

// What the method works on.
struct Work {
    std::int64_t count, size;           // of the inputs, and of a state
    OwnTable<double> gains;             // (n, states) feedback
    OwnRow<double> pivots;              // (n,) the cost's curvature in the inputs
    OwnTable<double> carried;           // (n, states) P c, P Riccati's
    OwnTable<double> p, pa;             // (states, states)
    OwnRow<double> pb;                  // (states,)
    OwnRow<double> forward;             // (n,)
    OwnTable<double> slopes;            // (2, states)
    OwnTable<double> added, slope;      // (n, 4) what the bounds add to the values' weights, and to the cost's slope
    OwnTable<double> values;            // (n, 4) what is bounded,
    OwnTable<double> next_values;       // and the same of the solution
    OwnRow<double> next_inputs;         // (n,)
    OwnTable<double> next_states;       // (n + 1, states)
    OwnRow<Bound> bounds;               // (n, 4, 2)

    Work(std::int64_t count, std::int64_t size)
        : count(count), size(size), gains(count, size), pivots(count), carried(count, size), p(size, size),
          pa(size, size), pb(size), forward(count), slopes(2, size), added(count, bounded), slope(count, bounded),
          values(count, bounded), next_values(count, bounded), next_inputs(count), next_states(count + 1, size),
          bounds(count * bounded * 2) {}

    Bound& bound(int side, std::int64_t k, int j) const { return bounds[(k * bounded + j) * 2 + side]; }
    double share_of_mean() const { return static_cast<double>(2 * bounded * count); }
};

// Write what is bounded (n, 4).
void read_values(Numbers coupling, Numbers inputs, Matrix states, Table<double> values) {
    const std::int64_t last = states.columns - 1;
    for (std::int64_t k = 0; k < inputs.length; ++k) {
        values[k][bounds_input] = inputs[k], values[k][bounds_coupled] = inputs[k] + coupling[k] * states[k][last];
        values[k][bounds_last] = states[k + 1][last], values[k][bounds_first] = states[k + 1][0];
    }
}

// Write the feedback of a step, and Riccati's P before it; `pb` and `pa` are P b and P a.
void fold(const Program& program, const Work& work, std::int64_t k) {
    const Table<const double> a = program.a[k];
    const Numbers b = program.b[k], weights = program.weights[k];
    const Row<double> gains = work.gains[k], added = work.added[k], pb = work.pb;
    const Table<double> p = work.p, pa = work.pa;
    const std::int64_t size = work.size;
    double pivot = program.effort[k] + added[bounds_input] + added[bounds_coupled];
    const double crossed = added[bounds_coupled] * program.coupling[k];
    for (std::int64_t i = 0; i < size; ++i) pivot += b[i] * pb[i];
    work.pivots[k] = pivot;
    for (std::int64_t j = 0; j < size; ++j) {
        double gain = j == size - 1 ? crossed : 0.0;
        for (std::int64_t i = 0; i < size; ++i) gain += pb[i] * a[i][j];
        gains[j] = gain / pivot;
    }
    for (std::int64_t i = 0; i < size; ++i) {
        for (std::int64_t j = 0; j <= i; ++j) {
            double value = -pivot * gains[i] * gains[j];
            for (std::int64_t m = 0; m < size; ++m) value += a[m][i] * pa[m][j];
            p[i][j] = p[j][i] = value;
        }
        p[i][i] += weights[i];
    }
    p[size - 1][size - 1] += crossed * program.coupling[k];
}

// Write the feedback gains, the cost's curvature in inputs, and P c.
void factor(const Program& program, const Work& work) {
    const std::int64_t size = work.size;
    const Table<double> p = work.p, pa = work.pa;
    for (std::int64_t i = 0; i < size; ++i)
        for (std::int64_t j = 0; j < size; ++j) p[i][j] = i == j ? program.weights[work.count][i] : 0.0;
    for (std::int64_t k = work.count - 1; k >= 0; --k) {
        const Table<const double> a = program.a[k];
        const Numbers b = program.b[k], c = program.c[k];
        p[size - 1][size - 1] += work.added[k][bounds_last];
        p[0][0] += work.added[k][bounds_first];
        for (std::int64_t i = 0; i < size; ++i) {
            double by_input = 0.0, by_disturbance = 0.0;
            for (std::int64_t j = 0; j < size; ++j) {
                by_input += p[i][j] * b[j];
                by_disturbance += p[i][j] * c[j];
                double by_state = 0.0;
                for (std::int64_t m = 0; m < size; ++m) by_state += p[i][m] * a[m][j];
                pa[i][j] = by_state;
            }
            work.pb[i] = by_input, work.carried[k][i] = by_disturbance;
        }
        fold(program, work, k);
    }
}

// Write the input of each step that is not of the feedback.
void pull_back(const Program& program, const Work& work) {
    const std::int64_t size = work.size;
    Row<double> after = work.slopes[0], before = work.slopes[1];
    for (std::int64_t i = 0; i < size; ++i) after[i] = 0.0;
    for (std::int64_t k = work.count - 1; k >= 0; --k) {
        const Table<const double> a = program.a[k];
        const Numbers slope = work.slope[k];
        after[size - 1] += slope[bounds_last];
        after[0] += slope[bounds_first];
        double pull = slope[bounds_input] + slope[bounds_coupled];
        for (std::int64_t i = 0; i < size; ++i) {
            after[i] += work.carried[k][i];
            pull += program.b[k][i] * after[i];
        }
        work.forward[k] = -pull / work.pivots[k];
        for (std::int64_t j = 0; j < size; ++j) {
            double value = -work.gains[k][j] * pull;
            for (std::int64_t i = 0; i < size; ++i) value += a[i][j] * after[i];
            before[j] = value;
        }
        before[size - 1] += program.coupling[k] * slope[bounds_coupled];
        std::swap(after, before);
    }
}

// Write inputs and states of least cost without bounds, with a slope of the cost in what is bounded, and its values.
void solve(const Program& program, const Work& work, Row<double> inputs, Table<double> states, Table<double> values) {
    const std::int64_t size = work.size;
    pull_back(program, work);
    for (std::int64_t k = 0; k < work.count; ++k) {
        const Numbers here = states[k];
        double value = work.forward[k];
        for (std::int64_t i = 0; i < size; ++i) value -= work.gains[k][i] * here[i];
        inputs[k] = value;
        for (std::int64_t i = 0; i < size; ++i) {
            double ahead = program.c[k][i] + program.b[k][i] * value;
            for (std::int64_t j = 0; j < size; ++j) ahead += program.a[k][i][j] * here[j];
            states[k + 1][i] = ahead;
        }
    }
    read_values(program.coupling, inputs, states, values);
}

// Write the first slacks, and multipliers, slacks times weights; return the mean of their products.
double begin(const Program& program, const Work& work) {
    const std::int64_t last = work.size - 1;
    double gap = 0.0;
    for (std::int64_t k = 0; k < work.count; ++k) {
        for (int j = 0; j < bounded; ++j) {
            const double low = program.limits[limits_low][k][j], high = program.limits[limits_high][k][j];
            const double weight =
                j <= bounds_coupled ? program.effort[k] : program.weights[k + 1][j == bounds_last ? last : 0];
            for (int side = 0; side < 2; ++side) {
                Bound& bound = work.bound(side, k, j);
                const double slack = side == limits_low ? work.values[k][j] - low : high - work.values[k][j];
                bound.slack = max(slack, least_slack * (high - low));
                bound.force = weight * bound.slack;
                gap += bound.slack * bound.force / work.share_of_mean();
            }
        }
    }
    return gap;
}

// Write what the bounds add to the values' weights and to the slope of the cost.
void stiffen(const Program& program, const Work& work) {
    for (std::int64_t k = 0; k < work.count; ++k) {
        for (int j = 0; j < bounded; ++j) {
            const double value = work.values[k][j], softness = program.limits[limits_softness][k][j];
            double added = 0.0, slope = 0.0;
            for (int side = 0; side < 2; ++side) {
                const Bound& bound = work.bound(side, k, j);
                const double inward = side == limits_low ? 1.0 : -1.0, given = softness * bound.force;
                const double stiff = 1.0 / (bound.slack + given);
                const double off = inward * (value - program.limits[side][k][j]) + given;
                added += bound.force * stiff;
                slope -= inward * (bound.force + (bound.centred - bound.force * off) * stiff);
            }
            slope -= added * value;
            work.added[k][j] = added, work.slope[k][j] = slope;
        }
    }
}

// Write the steps of slacks and multipliers to a solution, and return the share that leaves them positive.
double steps_of(const Program& program, const Work& work) {
    double share = 1.0;
    for (std::int64_t k = 0; k < work.count; ++k) {
        for (int j = 0; j < bounded; ++j) {
            const double soft = program.limits[limits_softness][k][j];
            for (int side = 0; side < 2; ++side) {
                Bound& bound = work.bound(side, k, j);
                const double slack = bound.slack, force = bound.force, inward = side == limits_low ? 1.0 : -1.0;
                const double off = inward * (work.next_values[k][j] - program.limits[side][k][j]) + soft * force;
                const double rise = (bound.centred - force * off) / (slack + soft * force);
                const double grow = off - slack + soft * rise;
                bound.slack_step = grow, bound.force_step = rise;
                if (slack + share * grow < 0.0) share = -slack / grow;
                if (force + share * rise < 0.0) share = -force / rise;
            }
        }
    }
    return share == 1.0 ? share : short_of * share;
}

// Write what the products of slacks and multipliers are to be, by how far the step towards 0 comes.
void centre(const Work& work, double share, double gap) {
    double reached = 0.0;
    for (int side = 0; side < 2; ++side) {
        for (std::int64_t k = 0; k < work.count; ++k) {
            for (int j = 0; j < bounded; ++j) {
                const Bound& bound = work.bound(side, k, j);
                const double slack = bound.slack + share * bound.slack_step;
                reached += slack * (bound.force + share * bound.force_step) / work.share_of_mean();
            }
        }
    }
    const double left = reached / gap, wanted = left * (left * left) * gap;
    for (std::int64_t i = 0; i < work.count * bounded * 2; ++i) {
        Bound& bound = work.bounds[i];
        bound.centred = wanted - bound.slack_step * bound.force_step;
    }
}

// Make a share of the step, and return the mean product of slacks and multipliers.
double move(const Work& work, double share, Row<double> inputs, Table<double> states) {
    double gap = 0.0;
    for (int side = 0; side < 2; ++side) {
        for (std::int64_t k = 0; k < work.count; ++k) {
            for (int j = 0; j < bounded; ++j) {
                Bound& bound = work.bound(side, k, j);
                bound.slack += share * bound.slack_step;
                bound.force += share * bound.force_step;
                gap += bound.slack * bound.force / work.share_of_mean();
            }
        }
    }
    for (std::int64_t k = 0; k < work.count; ++k) {
        inputs[k] += share * (work.next_inputs[k] - inputs[k]);
        for (std::int64_t i = 0; i < work.size; ++i)
            states[k + 1][i] += share * (work.next_states[k + 1][i] - states[k + 1][i]);
    }
    return gap;
}

}  // namespace

int solve_program(const Program& program, Row<double> inputs, Table<double> states, int most) {
    const Work work(program.b.rows, program.b.columns);
    for (std::int64_t i = 0; i < work.size; ++i) states[0][i] = work.next_states[0][i] = program.start[i];
    factor(program, work);
    solve(program, work, inputs, states, work.values);
    double gap = begin(program, work), missing = 1.0;  // share of what is missing at first of slacks and slopes
    const double first_gap = gap;
    for (int iteration = 1; iteration <= most; ++iteration) {
        for (std::int64_t i = 0; i < work.count * bounded * 2; ++i) work.bounds[i].centred = 0.0;
        stiffen(program, work);
        factor(program, work);
        solve(program, work, work.next_inputs, work.next_states, work.next_values);
        centre(work, steps_of(program, work), gap);
        stiffen(program, work);
        solve(program, work, work.next_inputs, work.next_states, work.next_values);
        const double share = steps_of(program, work);
        gap = move(work, share, inputs, states);
        read_values(program.coupling, inputs, states, work.values);
        missing *= 1.0 - share;
        if (!std::isfinite(gap + states[work.count][0])) return 0;
        if (gap <= tolerance * first_gap && missing <= tolerance) return iteration;
    }
    return 0;
}

}  // namespace fg
