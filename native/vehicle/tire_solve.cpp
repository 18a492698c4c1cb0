#include "tire_solve.hpp"

#include <optional>

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"
#include "../core/versions.hpp"
#include "terrain.hpp"
#include "tire_patch.hpp"

namespace fg {
namespace {

constexpr int contacts = 12;  // CONTACTS: velocities of contact points; those of the drive line come behind them
constexpr int lanes = 16;     // numbers in a row of the matrices

using Lanes = double[lanes];

// A tied speed of the drive line, see `tie`.
struct Tie {
    Lanes row;
    double size, free, wrong;
};

// How the contact point of a wheel moves without the wheel's spin [m/s]: forward, left, up, and how fast the first two
// change because the wheel turns [m/s^2].
struct Moves {
    double along, across, up, gain_along, gain_across;
};

// Room of `push_car`. Arrays of 4 are by wheel; `Lanes` have the forces on the contact points of the wheels, forward,
// left and up, then those of the drive line, or their velocities.
struct Scratch {
    double jacobian[4][16][4];  // by wheel, dof of its chain, and velocity: forward, left, up, its spin
    double halves[4][16][4];    // likewise, see `half_solve`
    Lanes common[16];           // of the common dofs
    Lanes mobility[lanes];
    Lanes velocity, force, mean, free, even;
    Moves moves;  // of the last wheel
    Tie ties[4];  // by speed of the drive line
    Lanes through;
};
static_assert(sizeof(Scratch) <= scratch_numbers * sizeof(double));

// Add to some numbers others, times a factor.
template <int Count>
inline void add_scaled(double (&to)[Count], const double (&of)[Count], double factor) {
    FG_INDEPENDENT
    for (int i = 0; i < Count; ++i) to[i] += factor * of[i];
}

using Vector = std::array<double, 3>;

inline double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// Return the mean surface that a tire touches: of three places along its heading, as its contact patch is long.
Surface touched(const Terrain& terrain, double x, double y, const Vector& axle, double radius) {
    constexpr double reach = 0.25;  // of the patch to either side, over the radius: it is pressed by 3 % of that
    const double level = std::sqrt(axle[0] * axle[0] + axle[1] * axle[1]);
    const double ahead_x = level > 1e-9 ? reach * radius * axle[1] / level : 0.0;
    const double ahead_y = level > 1e-9 ? -reach * radius * axle[0] / level : 0.0;
    const Surface middle = terrain.at(x, y);
    const Surface before = terrain.at(x - ahead_x, y - ahead_y), ahead = terrain.at(x + ahead_x, y + ahead_y);
    Surface mean{(middle.height + before.height + ahead.height) / 3.0, {}};
    for (int i = 0; i < 3; ++i) mean.normal[i] = middle.normal[i] + before.normal[i] + ahead.normal[i];
    const double size = std::sqrt(dot(mean.normal, mean.normal));
    for (double& part : mean.normal) part /= size;
    return mean;
}

// Write what each dof of a wheel moves its contact point by, and its spin, (links, 4); return the depth [m].
// Forward and left are those of the wheel half a physics step later, so that its mean force acts along its mean
// heading, and a car that turns neither gains nor loses by it. They are seen from the body that the dof moves: what
// the car itself turns by then is left to `place_between`. Written are `moves`, too. On level ground the normal is
// upright, and what it multiplies to nothing or to itself is left out.
template <bool Level>
double wheel_rows(const mjData* data, const Terrain& terrain, const Tire& tire, int wheel, std::int64_t dofs,
                  double timestep, Scratch& scratch) {
    const double* position = data->xpos + 3 * tire.body;
    const double* turn = data->xmat + 9 * tire.body;
    const double* mass_center = data->subtree_com + 3 * tire.root;
    const Matrix axes{data->cdof, dofs, 6};
    const Numbers qvel{data->qvel, dofs};
    const double* a = tire.axle;
    const Vector axle{turn[0] * a[0] + turn[1] * a[1] + turn[2] * a[2],
                      turn[3] * a[0] + turn[4] * a[1] + turn[5] * a[2],
                      turn[6] * a[0] + turn[7] * a[1] + turn[8] * a[2]};
    const double broad = tire.half_width * tire.half_width - tire.radius * tire.radius;
    Surface under{tire.ground, {0.0, 0.0, 1.0}};
    Vector foot{position[0], position[1], under.height};
    if constexpr (!Level) {
        under = touched(terrain, position[0], position[1], axle, tire.radius);
        foot[0] -= tire.radius * under.normal[0], foot[1] -= tire.radius * under.normal[1];
        under = touched(terrain, foot[0], foot[1], axle, tire.radius);
        foot[2] = under.height;
    }
    const Vector& normal = under.normal;
    const double lean = Level ? axle[2] : dot(axle, normal);
    const double deep = std::sqrt(tire.radius * tire.radius + broad * lean * lean);  // nearest point of an ellipsoid
    const Vector over{position[0] - foot[0], position[1] - foot[1], position[2] - foot[2]};
    const double depth = deep - (Level ? over[2] : dot(over, normal));
    double point[3];  // half way to the ground, from the centre of mass of the tree
    for (int i = 0; i < 3; ++i) {
        const double up = Level ? (i == 2 ? 1.0 : 0.0) : normal[i];
        const double off = broad * lean * (axle[i] - lean * up) / deep;
        point[i] = position[i] - deep * up - off + 0.5 * max(depth, 0.0) * up - mass_center[i];
    }
    const auto [x, y, z] = point;
    Vector heading = Level ? Vector{axle[1], -axle[0], 0.0} : cross(axle, normal);
    const double level = std::sqrt(dot(heading, heading));
    if (level > 1e-9)
        for (double& part : heading) part /= level;
    else
        heading = {1.0, 0.0, 0.0};
    const Vector left = cross(normal, heading);
    Moves moves{};
    double total = 0.0, turning = 0.0, sin = 0.0, cos = 1.0;  // [rad/s]: of the links before, and of the first `by`
    int by = 0;
    const auto turned = [&](const Numbers& axis) {
        if constexpr (Level) return axis[2];
        else return axis[0] * normal[0] + axis[1] * normal[1] + axis[2] * normal[2];
    };
    for (int link = 0; link < tire.links; ++link) {
        const Numbers axis = axes[tire.chain[link]];
        // velocity of the point that the dof makes: what it moves, and what it turns
        const double vx = axis[3] + axis[1] * z - axis[2] * y;
        const double vy = axis[4] + axis[2] * x - axis[0] * z;
        const double vz = axis[5] + axis[0] * y - axis[1] * x;
        double along = heading[0] * vx + heading[1] * vy, across = left[0] * vx + left[1] * vy, up = vz;
        if constexpr (!Level) {
            along += heading[2] * vz, across += left[2] * vz;
            up = normal[0] * vx + normal[1] * vy + normal[2] * vz;
        }
        if (by < tire.turned_by[link]) {
            const double before = turning;
            for (; by < tire.turned_by[link]; ++by)  // its spin turns no heading
                if (by > 0) turning += turned(axes[tire.chain[by]]) * qvel[tire.chain[by]];
            if (turning != before) {
                const double half = 0.5 * timestep * turning;
                sin = fg::sin(half), cos = fg::cos(half);
            }
        }
        double(&row)[4] = scratch.jacobian[wheel][link];
        row[0] = along * cos + across * sin, row[1] = across * cos - along * sin;
        row[2] = up, row[3] = link == 0 ? 1.0 : 0.0;
        if (link > 0) {
            const double speed = qvel[tire.chain[link]];
            moves.along += along * speed;
            moves.across += across * speed;
            moves.up += up * speed;
            const double seen = tire.straight[link] ? total : turning;
            moves.gain_along += seen * across * speed;
            moves.gain_across -= seen * along * speed;
            total += turned(axis) * speed;
        }
    }
    scratch.moves = moves;
    return depth;
}

// Write how a contact point moves, seen from the wheel, and how much faster in a short step; return its speed.
double move(const mjData* data, const Gear& gear, const Tire& tire, int wheel, double short_step, std::int64_t dofs,
            Scratch& scratch) {
    const Numbers qvel{data->qvel, dofs}, acceleration{data->qacc_smooth, dofs};
    const double(&rows)[16][4] = scratch.jacobian[wheel];
    const Moves& moves = scratch.moves;
    double along = 0.0, across = 0.0, up = 0.0;
    for (int link = 1; link < tire.links; ++link) {
        const double pull = acceleration[tire.chain[link]] * short_step;
        along += rows[link][0] * pull;
        across += rows[link][1] * pull;
        up += rows[link][2] * pull;
    }
    const double spin = qvel[tire.chain[0]], pull = acceleration[tire.chain[0]] * short_step;
    double* velocity = scratch.velocity + 3 * wheel;
    double* free = scratch.free + 3 * wheel;
    velocity[0] = moves.along + rows[0][0] * spin;
    velocity[1] = moves.across + rows[0][1] * spin;
    velocity[2] = moves.up + rows[0][2] * spin;
    free[0] = along + rows[0][0] * pull + short_step * moves.gain_along;
    free[1] = across + rows[0][1] * pull + short_step * moves.gain_across;
    free[2] = up + rows[0][2] * pull;
    for (int lane = 0; lane < gear.lanes; ++lane) {
        scratch.velocity[contacts + lane] += gear.share[wheel][lane] * spin;
        scratch.free[contacts + lane] += gear.share[wheel][lane] * pull;
    }
    return std::abs(moves.along);
}

// Write D^-1/2 L^-T times the rows of a wheel, of MuJoCo's inertia L' D L, for its own dofs; add to common ones.
FG_VERSIONS void half_solve(const mjData* data, const Inertia& inertia, const Gear& gear, const Tire& tire, int wheel,
                            std::int64_t dofs, Scratch& scratch) {
    const Numbers factor{data->qLD, inertia.columns.length}, diagonal{data->qLDiagInv, dofs};
    double(&halves)[16][4] = scratch.halves[wheel];
    const auto last = tire.links - 1;
    for (int link = 0; link < tire.links; ++link)
        for (int i = 0; i < 4; ++i) halves[link][i] = scratch.jacobian[wheel][link][i];
    for (int link = 0; link < tire.own_links; ++link) {
        const auto dof = tire.chain[link];
        const auto start = inertia.row_starts[dof];
        const double root = std::sqrt(diagonal[dof]);
        for (int entry = 0; entry < last - link; ++entry)  // its row has all that it hangs on, the root first
            add_scaled(halves[last - entry], halves[link], -factor[start + entry]);
        for (double& half : halves[link]) half *= root;
    }
    for (auto link = tire.own_links; link < tire.links; ++link) {
        Lanes& common = scratch.common[tire.common[link]];
        for (int i = 0; i < 3; ++i) common[3 * wheel + i] = halves[link][i];
        for (int lane = 0; lane < gear.lanes; ++lane)
            common[contacts + lane] += gear.share[wheel][lane] * halves[link][3];
    }
}

// Go on with what `half_solve` does, for the common dofs.
FG_VERSIONS void half_solve_common(const mjData* data, const Inertia& inertia, const Gear& gear, std::int64_t dofs,
                                   Scratch& scratch) {
    const Numbers factor{data->qLD, inertia.columns.length}, diagonal{data->qLDiagInv, dofs};
    for (auto place = gear.commons - 1; place >= 0; --place) {
        const auto dof = gear.common[place];
        const auto start = inertia.row_starts[dof];
        const double root = std::sqrt(diagonal[dof]);
        Lanes& own = scratch.common[place];
        for (int entry = 0; entry < inertia.row_counts[dof] - 1; ++entry)
            add_scaled(scratch.common[gear.common_of[place][entry]], own, -factor[start + entry]);
        for (double& half : own) half *= root;
    }
}

// Write by how much each force changes each velocity in a short step (lanes, lanes), as far as there are some.
FG_VERSIONS void write_mobility(const Gear& gear, Row<const Tire> tires, double short_step, Scratch& scratch) {
    Lanes(&mobility)[lanes] = scratch.mobility;
    const auto rows = contacts + gear.lanes;
    for (int i = 0; i < rows; ++i) {
        Lanes even{}, odd{};  // two sums go on at a time
        for (int place = 0; place < gear.commons; ++place) {
            const Lanes& row = scratch.common[place];
            add_scaled(place % 2 == 1 ? odd : even, row, row[i]);
        }
        for (int j = 0; j < lanes; ++j) mobility[i][j] = even[j] + odd[j];
    }
    for (int k = 0; k < tires.size(); ++k) {
        const int first = 3 * k;  // of its rows and columns
        for (int link = 0; link < tires[k].own_links; ++link) {
            const double(&own)[4] = scratch.halves[k][link];
            const double x = own[0], y = own[1], z = own[2], spin = own[3];
            mobility[first][first] += x * x;
            mobility[first + 1][first] += y * x;
            mobility[first + 1][first + 1] += y * y;
            mobility[first + 2][first] += z * x;
            mobility[first + 2][first + 1] += z * y;
            mobility[first + 2][first + 2] += z * z;
            for (int i = 0; i < gear.lanes; ++i) {
                const double turned = gear.share[k][i] * spin;
                mobility[first][contacts + i] += turned * x;
                mobility[first + 1][contacts + i] += turned * y;
                mobility[first + 2][contacts + i] += turned * z;
                for (int j = 0; j < gear.lanes; ++j)
                    mobility[contacts + i][contacts + j] += turned * gear.share[k][j] * spin;
            }
        }
        for (int i = 0; i < 3; ++i) {
            for (int j = 0; j < i; ++j) mobility[first + j][first + i] = mobility[first + i][first + j];
            for (int j = 0; j < gear.lanes; ++j) mobility[contacts + j][first + i] = mobility[first + i][contacts + j];
        }
    }
    for (int i = 0; i < rows; ++i)
        for (int j = 0; j < lanes; ++j) mobility[i][j] *= short_step;
}

// Take rigid ties and the motor's inertia out of mobility, free motion and velocities; write their rows.
FG_VERSIONS void tie(const Gear& gear, double short_step, Scratch& scratch) {
    for (int i = 0; i < gear.lanes; ++i) {
        if (!(gear.give[i] >= 0.0)) continue;
        const int lane = contacts + i;
        Tie& own = scratch.ties[i];
        for (int j = 0; j < lanes; ++j) own.row[j] = scratch.mobility[lane][j];
        own.size = own.row[lane] + short_step * gear.give[i];
        own.free = scratch.free[lane];
        own.wrong = gear.give[i] == 0.0 ? scratch.velocity[lane] : 0.0;
        add_scaled(scratch.free, own.row, -own.free / own.size);
        add_scaled(scratch.velocity, own.row, -own.wrong / own.size);
        for (int j = 0; j < contacts + gear.lanes; ++j)
            add_scaled(scratch.mobility[j], own.row, -own.row[j] / own.size);
    }
}

// Add to sums of forces over so many short steps those that `tie` has left out.
void add_tie_forces(const Gear& gear, Lanes& forces, double steps, const Scratch& scratch) {
    for (auto i = gear.lanes - 1; i >= 0; --i) {  // what was taken out last knows of no other
        if (!(gear.give[i] >= 0.0)) continue;
        const Tie& own = scratch.ties[i];
        double moved = steps * own.free + own.wrong;
        for (int j = 0; j < contacts + gear.lanes; ++j) moved += own.row[j] * forces[j];
        forces[contacts + i] -= moved / own.size;
    }
}

// Return the torque on a wheel of forces of the drive line [N m].
double spin_torque(const Gear& gear, int wheel, const Lanes& forces) {
    double torque = 0.0;
    for (int i = 0; i < gear.lanes; ++i) torque += gear.share[wheel][i] * forces[contacts + i];
    return torque;
}

// Let drag brake and clutches hold what they can; `pull` is the motor's force without MuJoCo's, `before` [N].
void hold_clutches(const Gear& gear, double pull, double before, Scratch& scratch) {
    if (gear.preload[0] >= 0.0) {
        const Lanes& row = scratch.mobility[contacts];
        const double stops = -scratch.velocity[contacts] / row[contacts];
        const double held = min(max(stops, -gear.preload[0]), gear.preload[0]);
        scratch.force[contacts] = pull + held;
        add_scaled(scratch.velocity, row, held);
    }
    for (int j = 0; j < lanes; ++j) scratch.through[j] = scratch.force[j];
    add_tie_forces(gear, scratch.through, 1.0, scratch);
    scratch.through[contacts] += before;
    for (int i = 1; i < gear.lanes; ++i) {
        if (!(gear.preload[i] >= 0.0)) continue;
        const int lane = contacts + i, first = gear.share[0][i] != 0.0 ? 0 : 2;
        const double through =
            spin_torque(gear, first, scratch.through) + spin_torque(gear, first + 1, scratch.through);
        const double most = gear.preload[i] + gear.ramp[i] * std::abs(through);
        const Lanes& row = scratch.mobility[lane];
        const double held = min(max(-scratch.velocity[lane] / row[lane], -most), most);
        scratch.force[lane] = held;
        add_scaled(scratch.velocity, row, held);
    }
}

// Return what a servo of a car is told now, delay and range included.
double control_of(const mjModel* model, const mjData* data, const Gear& gear, int servo) {
    const int actuator = static_cast<int>(gear.actuator[servo]);
    double told = data->ctrl[actuator];
    if (gear.delayed[servo] >= 0 && model->actuator_delay[actuator] > 0.0) {
        // of no delay MuJoCo's history knows the last step's only
        const int interpolation = static_cast<int>(gear.delayed[servo]);
        const double* kept = mujoco.mj_readCtrl(model, data, actuator, data->time, &told, interpolation);
        if (kept) told = *kept;
    }
    return min(max(told, gear.control_range[servo][0]), gear.control_range[servo][1]);
}

// The motor of a car, where it acts through fixed shares of the wheels' spins: a servo of the drive's speed.
struct Motor {
    double gain, bias, slope, damping, length, least, most, power;

    Motor(const mjModel* model, const mjData* data, const Gear& gear) {
        const auto motor = gear.actuator[1];
        const double* biases = model->actuator_biasprm + mjNBIAS * motor;
        gain = model->actuator_gainprm[mjNGAIN * motor] * control_of(model, data, gear, 1);
        bias = biases[0], slope = biases[1], damping = biases[2];
        length = data->actuator_length[motor];
        least = gear.force_range[1][0], most = gear.force_range[1][1];
        power = gear.power;
    }
    // The force at a speed [N].
    double pull(double speed) const {
        const double pull = min(max(gain + bias + slope * length + damping * speed, least), most);
        return pull * speed > power ? power / speed : pull;
    }
};

}  // namespace

FG_VERSIONS void push_car(const mjModel* model, mjData* data, const Inertia& inertia, const Gear& gear,
                          Row<const Tire> tires, Numbers mu, Row<TireState> own, Row<double> room, std::int64_t dofs,
                          double timestep, std::int64_t steps) {
    check(scratch_numbers - 1, room.length);
    Scratch& scratch = *reinterpret_cast<Scratch*>(room.data);
    const int wheels = tires.size();
    const double short_step = timestep / static_cast<double>(steps);
    for (int i = 0; i < lanes; ++i)
        scratch.velocity[i] = scratch.force[i] = scratch.mean[i] = scratch.free[i] = 0.0;
    for (int place = 0; place < gear.commons; ++place)
        for (double& number : scratch.common[place]) number = 0.0;
    Four depth{}, forward{}, along{}, across{}, peaks{};
    const Terrain terrain(model);
    for (int k = 0; k < wheels; ++k) {
        const Tire& tire = tires[k];
        depth[k] = terrain.level() ? wheel_rows<true>(data, terrain, tire, k, dofs, timestep, scratch)
                                   : wheel_rows<false>(data, terrain, tire, k, dofs, timestep, scratch);
        forward[k] = move(data, gear, tire, k, short_step, dofs, scratch);
        along[k] = own[k].along, across[k] = own[k].across, peaks[k] = mu[k];
        half_solve(data, inertia, gear, tire, k, dofs, scratch);
    }
    half_solve_common(data, inertia, gear, dofs, scratch);
    write_mobility(gear, tires, short_step, scratch);
    tie(gear, short_step, scratch);
    const double before = gear.lanes > 0 ? data->actuator_force[gear.actuator[1]] : 0.0;
    double pull = 0.0;
    const Patches patches(tires, forward, short_step);
    Four sliding{}, sliding_across{}, slip_size{};
    std::optional<Motor> motor;
    if (gear.driven) motor.emplace(model, data, gear);
    for (std::int64_t step = 0; step < steps; ++step) {
        Four over_x, over_y, over_z;
        for (int k = 0; k < 4; ++k) {
            const double* over = scratch.velocity + 3 * k;
            over_x[k] = over[0], over_y[k] = over[1], over_z[k] = over[2];
        }
        const Four pressed = patches.load(depth, over_z), none{};
        const FourFlags touches = (depth > 0.0) & (pressed > 0.0);
        const Four load = touches ? pressed : none;
        const Deflected now = patches.deflect(along, across, over_x, over_y, patches.grip(load, peaks));
        along = touches ? now.along : none, across = touches ? now.across : none;
        const Four slides = root_of(now.sliding_x * now.sliding_x + now.sliding_y * now.sliding_y);
        slip_size = max(slip_size, touches ? now.size : none);
        sliding = max(sliding, touches ? slides : none);
        sliding_across = max(sliding_across, touches ? size_of(now.sliding_y) : none);
        for (int k = 0; k < 4; ++k) {
            double* force = scratch.force + 3 * k;
            force[0] = touches[k] ? now.force_x[k] : 0.0, force[1] = touches[k] ? now.force_y[k] : 0.0;
            force[2] = load[k];
        }
        if (motor) {
            const double speed = scratch.velocity[contacts];
            pull = motor->pull(speed) - before;
            scratch.force[contacts] = pull;
            motor->length += short_step * speed;
        }
        Lanes odd{};
        for (int i = 0; i < lanes; ++i) scratch.even[i] = scratch.free[i];
        for (int j = 0; j < contacts; j += 2) {  // two sums go on at a time
            add_scaled(scratch.even, scratch.mobility[j], scratch.force[j]);
            add_scaled(odd, scratch.mobility[j + 1], scratch.force[j + 1]);
        }
        add_scaled(scratch.even, odd, 1.0);
        add_scaled(scratch.even, scratch.mobility[contacts], scratch.force[contacts]);
        add_scaled(scratch.velocity, scratch.even, 1.0);
        if (gear.clutches > 0) [[unlikely]] hold_clutches(gear, pull, before, scratch);
        add_scaled(scratch.mean, scratch.force, 1.0);
        for (int k = 0; k < 4; ++k) depth[k] -= short_step * scratch.velocity[3 * k + 2];
    }
    const double share = 1.0 / static_cast<double>(steps);
    const Row<double> smooth{data->qfrc_smooth, dofs};
    add_tie_forces(gear, scratch.mean, static_cast<double>(steps), scratch);
    for (int k = 0; k < wheels; ++k) {
        const Tire& tire = tires[k];
        const double torque = share * spin_torque(gear, k, scratch.mean);
        const double* mean = scratch.mean + 3 * k;
        const double fx = mean[0] * share, fy = mean[1] * share, fz = mean[2] * share;
        for (int link = 0; link < tire.links; ++link) {
            const double(&row)[4] = scratch.jacobian[k][link];
            smooth[tire.chain[link]] += row[0] * fx + row[1] * fy + row[2] * fz + row[3] * torque;
        }
        own[k] = {along[k], across[k], fz, fx, fy, sliding[k], sliding_across[k], slip_size[k]};
    }
}

std::array<double, 2> steer(const mjModel* model, const mjData* data, const Gear& gear, double timestep,
                            std::int64_t steps) {
    double angle = data->qpos[gear.steering_qpos], rate = data->qvel[gear.steering_dof];
    const double short_step = timestep / static_cast<double>(steps);
    const auto servo = gear.actuator[0];
    const double gain = model->actuator_gainprm[mjNGAIN * servo] * control_of(model, data, gear, 0);
    const double* bias = model->actuator_biasprm + mjNBIAS * servo;
    const double least = gear.force_range[0][0], most = gear.force_range[0][1];
    const double push = short_step / gear.steering_inertia;
    const double slowed = 0.5 * short_step * gear.steering_damping / gear.steering_inertia;
    for (std::int64_t step = 0; step < steps; ++step) {
        // of the second order: the force in the middle of a step, and means of rates
        const double middle = angle + 0.5 * short_step * rate;
        const double force = min(max(gain + bias[0] + bias[1] * middle + bias[2] * rate, least), most);
        const double before = rate;
        rate = (rate * (1.0 - slowed) + push * force) / (1.0 + slowed);
        angle += 0.5 * short_step * (before + rate);
        if (angle < gear.steering_range[0] || angle > gear.steering_range[1]) {  // the joint ends there, and it stops
            angle = min(max(angle, gear.steering_range[0]), gear.steering_range[1]);
            rate = 0.0;
        }
    }
    return {angle, rate};
}

void put_steering(mjData* data, const Gear& gear, double angle, double rate) {
    data->qpos[gear.steering_qpos] = angle, data->qvel[gear.steering_dof] = rate;
    for (int side = 0; side < 2; ++side) {
        const double(&c)[5] = gear.ackermann[side];
        data->qpos[gear.kingpin_qpos[side]] = c[0] + angle * (c[1] + angle * (c[2] + angle * (c[3] + angle * c[4])));
        const double slope = c[1] + angle * (2.0 * c[2] + angle * (3.0 * c[3] + angle * 4.0 * c[4]));
        data->qvel[gear.kingpin_dof[side]] = slope * rate;
    }
}

}  // namespace fg
