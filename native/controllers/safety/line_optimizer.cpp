#include "line_optimizer.hpp"

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"
#include "../control/band_program.hpp"

namespace fg {
namespace {

constexpr int times_smoothed = 3;      // the derivative by the curvature: .3 m for points .25 m apart
constexpr double least_room = 1e-3;    // [m] to either side
constexpr double regular = 1e-6;
constexpr double lock_use = 0.85;      // share of the curvature at full lock without a price, the rest is to correct
constexpr double lock_price = 4.0;     // [s m] of the squared curvature beyond
constexpr double price_outside = 0.5;  // [s/m] of the point that is furthest outside of its room
constexpr double weakest = 1e-3, strongest = 1e6;  // multiple of the squared change of curvature
constexpr int fine_pieces = 8;                     // of a step, by which a curve is measured

// A step of least curvature: how far apart the points are, in spacings of the line, and how far each may move [m].
struct Flattening {
    double apart, most;
};
constexpr Flattening flattenings[steps_of_flattening] = {{4, 1.0}, {4, 0.8}, {4, 0.6}, {2, 0.4},
                                                         {2, 0.3}, {1, 0.2}, {1, 0.15}};
constexpr double most_moved = 0.3;  // [m] of a point in a step of least time

int before(int k, int n) { return k > 0 ? k - 1 : n - 1; }
int after(int k, int n) { return k + 1 < n ? k + 1 : 0; }

// Return how far the point that is furthest outside of its room is outside after a share of its move [m].
double outside(double share, Numbers moved, Numbers low, Numbers high) {
    double furthest = 0.0;
    for (int k = 0; k < moved.size(); ++k) {
        const double way = share > 0.0 ? share * moved[k] : 0.0;
        furthest = max(max(furthest, low[k] - way), way - high[k]);
    }
    return furthest;
}

// Return how each curvature grows by a move of the point before, of its own and of the next (3, n) [1/m^2].
// `turning` is 1; -1 where steps count as unchanged.
OwnTable<double> bending(Numbers bends, Numbers to, Numbers on, double turning) {
    const int n = bends.size();
    OwnTable<double> rows(3, n);
    for (int k = 0; k < n; ++k) {
        const double mean = 0.5 * (to[k] + on[k]);
        rows[0][k] = 1.0 / (to[k] * mean), rows[2][k] = 1.0 / (on[k] * mean);
        rows[1][k] = turning * bends[k] * bends[k] - rows[0][k] - rows[2][k];
    }
    return rows;
}

// Return the bands (3, n) of a multiple of the squares of rows, integrated over steps.
OwnTable<double> squares(Matrix rows, Numbers mean, double weight) {
    const int n = mean.size();
    OwnTable<double> bands(3, n);
    for (int k = 0; k < n; ++k) {
        const int back = before(k, n), ahead = after(k, n);
        const double own = rows[1][k] * mean[k], first = rows[0][ahead] * mean[ahead];
        const double last = rows[2][back] * mean[back];
        bands[0][k] = regular + weight * (rows[0][ahead] * first + rows[1][k] * own + rows[2][back] * last);
        bands[1][k] = weight * (own * rows[2][k] + first * rows[1][ahead]);
        bands[2][k] = weight * first * rows[2][ahead];
    }
    return bands;
}

// Return by how much the sum of rows times values (n,), each times its factor, changes for a move of each point (n,).
OwnRow<double> transposed(Matrix rows, Numbers values, Numbers factors) {
    const int n = values.size();
    OwnRow<double> changes(n);
    for (int k = 0; k < n; ++k) {
        const int back = before(k, n), ahead = after(k, n);
        changes[k] = rows[0][ahead] * (values[ahead] * factors[ahead]) + rows[1][k] * (values[k] * factors[k]) +
                     rows[2][back] * (values[back] * factors[back]);
    }
    return changes;
}

// Return the derivative of the lap time by the move of each point (n,) [s/m]; `by_bend` is written to.
OwnRow<double> by_move(Matrix rows, Numbers mean, Numbers bends, Numbers on, Row<double> by_bend, Numbers by_step) {
    const int n = bends.size();
    for (int k = 0; k < n; ++k) by_bend[k] /= mean[k];
    for (int i = 0; i < times_smoothed; ++i) average(by_bend);
    OwnRow<double> gradient = transposed(rows, by_bend, mean);
    for (int k = 0; k < n; ++k) {
        const int back = before(k, n);
        gradient[k] -= 0.5 * bends[k] * (by_step[k] * on[k] + by_step[back] * on[back]);
    }
    return gradient;
}

// Return how the place on a closed line (n, 2) changes from point to point.
std::array<double, 2> slope_at(Matrix line, int k) {
    const int n = static_cast<int>(line.rows);
    const Numbers first = line[(k - 2 + n) % n], back = line[(k - 1 + n) % n];
    const Numbers ahead = line[(k + 1) % n], last = line[(k + 2) % n];
    return {(8.0 * (ahead[0] - back[0]) - last[0] + first[0]) / 12.0,
            (8.0 * (ahead[1] - back[1]) - last[1] + first[1]) / 12.0};
}

struct Left {
    double most, slope;
};

// Return what a table has at a lateral acceleration [m/s^2], and its slope; beyond the last entry 0.
Left left_of(Numbers table, double lateral, double most) {
    const int last = table.size() - 1;
    const double position = lateral / most * last;
    if (position >= last) return {0.0, 0.0};
    const int at = position > 0.0 ? static_cast<int>(position) : 0;  // nor is NaN
    const double slope = table[at + 1] - table[at];
    return {table[at] + (position - at) * slope, slope * last / most};
}

// Return the price of curvature beyond the lock [s], and add its derivatives.
double beyond_lock(Numbers bends, Numbers steps, double lock, Row<double> by_bend) {
    double price = 0.0;
    for (int i = 0; i < bends.size(); ++i) {
        const double beyond = std::abs(bends[i]) - lock;
        if (beyond > 0.0) {
            price += lock_price * beyond * beyond * steps[i];
            by_bend[i] += 2.0 * lock_price * std::copysign(beyond, bends[i]) * steps[i];
        }
    }
    return price;
}

// Return the lateral acceleration over the speed squared that the tires hold at each point (n,) [1/m].
// That is the curvature, and where the wheels turn in or out, what this takes. Write to `own` (2, n) its derivatives by
// the curvature of the point, averaged as `average` does, and by how this changes to the neighbours.
OwnRow<double> demands_of(Numbers bends, Numbers steps, const Grip& grip, Table<double> own) {
    const int n = bends.size();
    OwnRow<double> smooth(n), demands(n);
    for (int k = 0; k < n; ++k) smooth[k] = bends[k];
    average(smooth);
    for (int k = 0; k < n; ++k) {
        const int back = before(k, n), ahead = after(k, n);
        const double bend = std::abs(smooth[k]), change = (smooth[ahead] - smooth[back]) / (steps[back] + steps[k]);
        const double sign = std::copysign(1.0, smooth[k]), turned = std::copysign(1.0, change);
        const bool inwards = smooth[k] * change > 0.0;
        demands[k] = max(bend, 1e-12), own[0][k] = sign, own[1][k] = 0.0;
        const double turning = grip.use * (inwards ? grip.turning : grip.turning_out);
        const double most = turning * std::abs(change) + (inwards ? grip.use * bend : 0.0);
        if (most > demands[k]) {
            demands[k] = most, own[0][k] = inwards ? grip.use * sign : 0.0, own[1][k] = turning * turned;
        }
    }
    return demands;
}

// Write the derivative by each curvature (n,), of that by what the tires hold; `own` as of `demands_of`.
void by_bends(Numbers by_demand, Matrix own, Numbers steps, Row<double> by_bend) {
    const int n = by_demand.size();
    for (int k = 0; k < n; ++k) by_bend[k] = by_demand[k] * own[0][k];
    for (int k = 0; k < n; ++k) {
        const int back = before(k, n), ahead = after(k, n);
        const double by_change = by_demand[k] * own[1][k] / (steps[back] + steps[k]);
        by_bend[ahead] += by_change;
        by_bend[back] -= by_change;
    }
    average(by_bend);
}

// Write the fastest speeds squared, and which come of the point before and behind; return the slowest point.
// `squared` (3, n) [m^2/s^2] are the limits in the corners, those after the pass along the line, and after both.
int drive_fastest(Numbers demands, Numbers steps, const Grip& grip, Table<double> squared, Row<bool> gained,
                  Row<bool> lost) {
    const int n = demands.size();
    const Row<double> limit = squared[0], forward = squared[1], both = squared[2];
    int slowest = 0;
    for (int i = 0; i < n; ++i) {
        limit[i] = forward[i] = min(grip.max_speed * grip.max_speed, grip.lateral / demands[i]);
        if (limit[i] < limit[slowest]) slowest = i;
    }
    for (int j = 0; j < n - 1; ++j) {
        const int i = (slowest + j) % n, ahead = after(i, n);
        const double push = left_of(grip.accelerating, demands[i] * forward[i], grip.lateral).most;
        const double reached = forward[i] + 2.0 * steps[i] * min(push, grip.power / std::sqrt(forward[i]));
        if (reached < forward[ahead]) forward[ahead] = reached, gained[ahead] = true;
    }
    for (int i = 0; i < n; ++i) both[i] = forward[i];
    for (int j = 0; j < n - 1; ++j) {
        const int ahead = (slowest - j + n) % n, i = before(ahead, n);
        const double braking = left_of(grip.braking, demands[ahead] * both[ahead], grip.lateral).most;
        const double reached = both[ahead] + 2.0 * steps[i] * braking;
        if (reached < both[i]) both[i] = reached, lost[i] = true;
    }
    return slowest;
}

}  // namespace

Grip limited_grip(const Limiter& limiter, double max_speed, std::array<double, 3> uses, double turning_use,
                  Row<double> accelerating, Row<double> braking) {
    const auto [cornering_use, braking_use, accelerating_use] = uses;
    const CarParameters& car = limiter.car;
    const double lateral = cornering_use * limiter.lateral;
    for (int k = 0; k < grip_entries; ++k) {
        const double used = lateral * k / (grip_entries - 1.0) / (limiter.mu * car.gravity);
        accelerating[k] = accelerating_use * limiter.accelerating * longitudinal_share(limiter, used, false);
        braking[k] = braking_use * limiter.braking * longitudinal_share(limiter, used, true);
    }
    const double lock = lock_use * fg::tan(lock_arc(limiter.slip, car)) / car.wheelbase;
    const double power = car.max_acceleration * car.power_limit_speed;
    const double turning = limiter.yaw_lag / turning_use, turning_out = turning / limiter.settings.most_left;
    return {lateral, accelerating, braking, power, max_speed, lock, cornering_use, turning, turning_out};
}

OwnTable<double> normals_of(Matrix line) {
    const int n = static_cast<int>(line.rows);
    OwnTable<double> normals(n, 2);
    for (int k = 0; k < n; ++k) {
        const Numbers back = line[before(k, n)], ahead = line[after(k, n)];
        const double dx = ahead[0] - back[0], dy = ahead[1] - back[1];
        const double apart = max(fg::hypot(dx, dy), 1e-9);
        normals[k][0] = -dy / apart, normals[k][1] = dx / apart;
    }
    return normals;
}

void measure(Matrix line, Row<double> bends, Row<double> to, Row<double> on) {
    const int n = static_cast<int>(line.rows);
    for (int k = 0; k < n; ++k) {
        const Numbers back = line[before(k, n)], here = line[k], ahead = line[after(k, n)];
        const double to_x = here[0] - back[0], to_y = here[1] - back[1];
        const double on_x = ahead[0] - here[0], on_y = ahead[1] - here[1];
        to[k] = max(fg::hypot(to_x, to_y), 1e-9), on[k] = max(fg::hypot(on_x, on_y), 1e-9);
        const double chord = max(fg::hypot(to_x + on_x, to_y + on_y), 1e-9);
        bends[k] = 2.0 * (to_x * on_y - to_y * on_x) / (to[k] * on[k] * chord);
    }
}

std::tuple<OwnTable<double>, double> begin_step(Matrix line, std::int64_t step, double spacing) {
    const bool flattens = step < steps_of_flattening;
    const auto [apart, most] = flattens ? flattenings[step] : Flattening{1, most_moved};
    if (flattens || (step - steps_of_flattening) % steps_of_a_round == 0) {
        const double count = std::nearbyint(length_of(line) / (apart * spacing));
        return {spread(line, count < 1e9 ? max(whole(count), 8) : 8), most};  // nor is NaN
    }
    OwnTable<double> same(line.rows, 2);
    for (int k = 0; k < line.rows; ++k) same[k][0] = line[k][0], same[k][1] = line[k][1];
    return {std::move(same), most};
}

std::tuple<std::int64_t, double> improve(Table<double> line, Matrix normals, std::array<Row<double>, 2> room,
                                         std::int64_t step, double weight, const Grip& grip) {
    const int n = static_cast<int>(line.rows);
    const auto [low, high] = room;
    const OwnRow<double> bends(n), to(n), on(n), mean(n), moved(n);
    measure(line, bends, to, on);
    for (int k = 0; k < n; ++k) mean[k] = 0.5 * (to[k] + on[k]);
    const double outside_now = outside(0.0, moved, low, high);
    for (int k = 0; k < n; ++k) {
        if (high[k] < low[k] + 2.0 * least_room) {
            const double middle = 0.5 * (low[k] + high[k]);
            low[k] = middle - least_room, high[k] = middle + least_room;
        }
    }
    if (step < steps_of_flattening) {
        const auto rows = bending(bends, to, on, -1.0);
        if (!least_on_ring(squares(rows, mean, 1.0), transposed(rows, mean, bends), low, high, moved))
            return {steps_of_a_line, nan};
        for (int k = 0; k < n; ++k)
            for (int axis = 0; axis < 2; ++axis) line[k][axis] += moved[k] * normals[k][axis];
        return {step + 1, 1.0};
    }
    const OwnRow<double> speeds(n), by_bend(n), by_step(n);
    const auto rows = bending(bends, to, on, 1.0);
    const double now = price_outside * outside_now + fastest_lap(bends, on, grip, speeds, by_bend, by_step);
    const auto gradient = by_move(rows, mean, bends, on, by_bend, by_step);
    double share = 1.0;
    if (!least_on_ring(squares(rows, mean, weight), gradient, low, high, moved)) {
        share = 0.0;
        if (!std::isfinite(now)) return {steps_of_a_line, nan};
    }
    const bool goes_on = (step + 1 - steps_of_flattening) % steps_of_a_round > 0;
    const OwnTable<double> there(n, 2);
    for (; share > 0.2; share *= 0.5) {
        for (int k = 0; k < n; ++k)
            for (int axis = 0; axis < 2; ++axis) there[k][axis] = line[k][axis] + share * moved[k] * normals[k][axis];
        measure(there, bends, to, on);
        const double then = price_outside * outside(share, moved, low, high);
        if (then + fastest_lap(bends, on, grip, speeds, by_bend, by_step) < now) {
            for (int k = 0; k < n; ++k) line[k][0] = there[k][0], line[k][1] = there[k][1];
            return {step + 1, goes_on ? max((share == 1.0 ? 0.75 : 1.3) * weight, weakest) : 1.0};
        }
    }
    if (3.0 * weight > strongest) {  // no move makes the lap shorter: on to the next round
        const std::int64_t rounds = (step - steps_of_flattening) / steps_of_a_round + 1;
        return {steps_of_flattening + rounds * steps_of_a_round, 1.0};
    }
    return {step + 1, goes_on ? 3.0 * weight : 1.0};
}

void average(Row<double> values) {
    const int count = values.size();
    const double first = values[0];
    double back = values[count - 1];
    for (int k = 0; k < count; ++k) {
        const double here = values[k], ahead = k + 1 < count ? values[k + 1] : first;
        values[k] = 0.5 * here + 0.25 * (back + ahead);
        back = here;
    }
}

OwnTable<double> spread(Matrix line, std::int64_t count) {
    // The points have to be about evenly apart. The curve is a cubic between two, with the slopes of the parabolas
    // through five points.
    const int n = static_cast<int>(line.rows), pieces = n * fine_pieces;
    const OwnRow<double> along(pieces + 1);
    const OwnTable<double> fine(pieces + 1, 2);
    for (int k = 0; k < n; ++k) {
        const Numbers here = line[k], ahead = line[after(k, n)];
        const auto slope = slope_at(line, k), slope_ahead = slope_at(line, after(k, n));
        for (int part = 0; part < fine_pieces; ++part) {
            const double share = static_cast<double>(part) / fine_pieces, rest = 1.0 - share;
            for (int axis = 0; axis < 2; ++axis) {
                fine[k * fine_pieces + part][axis] =
                    rest * rest * ((1.0 + 2.0 * share) * here[axis] + share * slope[axis]) +
                    share * share * ((1.0 + 2.0 * rest) * ahead[axis] - rest * slope_ahead[axis]);
            }
        }
    }
    fine[pieces][0] = line[0][0], fine[pieces][1] = line[0][1];
    for (int k = 0; k < pieces; ++k)
        along[k + 1] = along[k] + fg::hypot(fine[k + 1][0] - fine[k][0], fine[k + 1][1] - fine[k][1]);
    OwnTable<double> points(count, 2);
    int piece = 0;
    for (int k = 0; k < count; ++k) {
        const double way = along[pieces] * k / count;
        while (piece + 1 < pieces && along[piece + 1] <= way) ++piece;
        const double share = (way - along[piece]) / max(along[piece + 1] - along[piece], 1e-12);
        for (int axis = 0; axis < 2; ++axis)
            points[k][axis] = fine[piece][axis] + share * (fine[piece + 1][axis] - fine[piece][axis]);
    }
    return points;
}

double length_of(Matrix line) {
    const int n = static_cast<int>(line.rows);
    double length = 0.0;
    for (int k = 0; k < n; ++k) {
        const Numbers back = line[before(k, n)];
        length += fg::hypot(line[k][0] - back[0], line[k][1] - back[1]);
    }
    return length;
}

double fastest_lap(Numbers bends, Numbers steps, const Grip& grip, Row<double> speeds, Row<double> by_bend,
                   Row<double> by_step) {
    const int n = bends.size();
    const OwnTable<double> squared(3, n), own(2, n);
    const OwnRow<bool> gained(n), lost(n);
    const OwnRow<double> by_demand(n), by_square(n);
    const auto demands = demands_of(bends, steps, grip, own);
    const int slowest = drive_fastest(demands, steps, grip, squared, gained, lost);
    double time = 0.0;
    for (int i = 0; i < n; ++i) {
        const int ahead = after(i, n);
        const double here = std::sqrt(squared[2][i]), there = std::sqrt(squared[2][ahead]), sum = here + there;
        speeds[i] = here, by_demand[i] = 0.0, by_step[i] = 2.0 / sum;
        time += by_step[i] * steps[i];
        by_square[i] -= steps[i] / (sum * sum) / here;
        by_square[ahead] -= steps[i] / (sum * sum) / there;
    }
    for (int j = n - 2; j >= 0; --j) {  // the passes, backwards
        const int ahead = (slowest - j + n) % n, i = before(ahead, n);
        if (lost[i]) {
            const auto [left, slope] = left_of(grip.braking, demands[ahead] * squared[2][ahead], grip.lateral);
            const double twice = 2.0 * steps[i] * by_square[i];
            by_square[ahead] += by_square[i] + twice * slope * demands[ahead];
            by_demand[ahead] += twice * slope * squared[2][ahead];
            by_step[i] += 2.0 * left * by_square[i];
            by_square[i] = 0.0;
        }
    }
    for (int j = n - 2; j >= 0; --j) {
        const int i = (slowest + j) % n, ahead = after(i, n);
        if (gained[ahead]) {
            const double speed_squared = squared[1][i];
            const auto [left, slope] = left_of(grip.accelerating, demands[i] * speed_squared, grip.lateral);
            const double motor = grip.power / std::sqrt(speed_squared), twice = 2.0 * steps[i] * by_square[ahead];
            double push = left;
            if (motor < push) {
                by_square[i] += by_square[ahead] - 0.5 * twice * motor / speed_squared;
                push = motor;
            } else {
                by_square[i] += by_square[ahead] + twice * slope * demands[i];
                by_demand[i] += twice * slope * speed_squared;
            }
            by_step[i] += 2.0 * push * by_square[ahead];
            by_square[ahead] = 0.0;
        }
    }
    for (int i = 0; i < n; ++i) {
        if (squared[0][i] < grip.max_speed * grip.max_speed)
            by_demand[i] -= by_square[i] * squared[0][i] / demands[i];
    }
    by_bends(by_demand, own, steps, by_bend);
    return time + beyond_lock(bends, steps, grip.lock, by_bend);
}

}  // namespace fg
