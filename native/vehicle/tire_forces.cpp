#include "tire_forces.hpp"

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double most_pull = 30.0;  // [m/s^2] of a car: no tires give as much, and a wall that stops it gives more
constexpr double still = 1.0;       // [rad/s] of a wheel: from there on it has all of its rolling resistance
constexpr int most_wheels = 4;

// What a car has from before the end of a step.
struct Kept {
    double steering_angle, steering_rate;
    double motion[3];  // see `place_between`
};

// The entry of a dof on the diagonal of MuJoCo's inertia.
double& diagonal(mjData* data, const Inertia& inertia, std::int64_t dof) {
    const Row<double> matrix{data->M, inertia.columns.length};
    return matrix[inertia.row_starts[dof] + inertia.row_counts[dof] - 1];
}

// Return what the higher coefficients of a damping add to its slope at a rate.
double higher_slope(double first, double second, double rate) {
    return 2.0 * first * std::abs(rate) + 3.0 * second * rate * rate;
}

// Return by how much a joint's damping grows with its rate [N m s/rad].
double damping_slope(const mjModel* model, const mjData* data, std::int64_t dof) {
    const double* higher = model->dof_dampingpoly + mjNPOLY * dof;
    return model->dof_damping[dof] + higher_slope(higher[0], higher[1], data->qvel[dof]);
}

// Return by how much the torque of a steering servo falls with the rate of its joint [N m s/rad].
double servo_slope(const mjModel* model, const mjData* data, const Gear& gear) {
    const double* own = gear.servo_damping;
    const auto servo = gear.actuator[0];
    double slope = own[0] + higher_slope(own[1], own[2], data->qvel[gear.steering_dof]);
    const double force = data->actuator_force[servo];
    if (gear.force_range[0][0] < force && force < gear.force_range[0][1])  // a force at its limit does not fall
        slope -= model->actuator_biasprm[mjNBIAS * servo + 2] * gear.servo_gear * gear.servo_gear;
    return slope;
}

// Add to MuJoCo's inertia what takes joint damping implicitly, and keep joints that are put where they belong.
void damp_inertia(const mjModel* model, mjData* data, const Inertia& inertia, Row<const Gear> gears, std::int64_t dofs,
                  double timestep) {
    for (int dof = 0; dof < dofs; ++dof) diagonal(data, inertia, dof) += timestep * damping_slope(model, data, dof);
    for (int car = 0; car < gears.size(); ++car) {
        const Gear& gear = gears[car];
        if (gear.steered) {
            for (const auto dof : {gear.steering_dof, gear.kingpin_dof[0], gear.kingpin_dof[1]})
                diagonal(data, inertia, dof) += 1.0;  // [kg m^2], ten thousand times its
        } else if (gear.handed) {
            diagonal(data, inertia, gear.steering_dof) += timestep * servo_slope(model, data, gear);
        }
    }
    mujoco.mj_factorM(model, data);
    mujoco.mj_projectConstraint(model, data);
}

// Add to the inertia, `share` [s] times, what constraints lack, damping of steerings of MuJoCo's; false: none.
bool damp_steering(const mjModel* model, mjData* data, const Inertia& inertia, Row<const Gear> gears, double share) {
    bool any_handed = false;
    for (int car = 0; car < gears.size(); ++car) {
        const Gear& gear = gears[car];
        if (!gear.handed) continue;
        any_handed = true;
        for (const auto dof : {gear.steering_dof, gear.kingpin_dof[0], gear.kingpin_dof[1]}) {
            double slope = damping_slope(model, data, dof);
            if (dof == gear.steering_dof) slope += servo_slope(model, data, gear);
            diagonal(data, inertia, dof) += share * slope;
        }
    }
    if (any_handed) mujoco.mj_factorM(model, data);
    return any_handed;
}

// Add the tires' rolling resistance to MuJoCo's passive forces.
void resist_rolling(mjData* data, Row<const Tire> tires, Row<const TireState> own, std::int64_t dofs) {
    const Row<double> qvel{data->qvel, dofs}, passive{data->qfrc_passive, dofs};
    for (int k = 0; k < tires.size(); ++k) {
        const Tire& tire = tires[k];
        if (!(tire.rolling_resistance > 0.0)) continue;
        const double share = min(max(qvel[tire.spin_dof] / still, -1.0), 1.0);
        const double moment = tire.rolling_resistance * own[k].load * tire.radius;
        passive[tire.spin_dof] -= moment * share;
    }
}

// Add a car's drag to MuJoCo's passive forces: in proportion to the velocity of its centre of gravity.
void resist_air(mjData* data, const Gear& gear, std::int64_t dofs) {
    const auto first = gear.free_dof;
    const Matrix axes{data->cdof, dofs, 6};
    const Row<double> qvel{data->qvel, dofs}, passive{data->qfrc_passive, dofs};
    for (int axis = 3; axis < 6; ++axis) {  // of what each dof makes of that velocity
        double velocity = 0.0;
        for (auto dof = first; dof < first + 6; ++dof) velocity += axes[dof][axis] * qvel[dof];
        for (auto dof = first; dof < first + 6; ++dof) passive[dof] -= gear.drag * axes[dof][axis] * velocity;
    }
}

// Write the forces that MuJoCo lets the motors push with: what their power gives now; if not `limited`, all.
// Above `power_limit_speed` the acceleration falls as power_limit_speed / speed (f1tenth_gym, CommonRoad). Braking
// keeps the full force. A motor that `push_car` drives is limited there.
void limit_power(const mjModel* model, const mjData* data, Row<const Gear> gears, std::int64_t dofs, bool limited) {
    const Numbers qvel{data->qvel, dofs};
    for (int car = 0; car < gears.size(); ++car) {
        const Gear& gear = gears[car];
        if (!(gear.power > 0.0) || gear.driven) continue;
        double speed = 0.0;
        for (int wheel = 0; wheel < 4; ++wheel) speed += gear.share[wheel][0] * qvel[gear.spin_dof[wheel]];
        const double power = limited ? gear.power / max(std::abs(speed), 1e-9) : inf;
        double* forces = model->actuator_forcerange + 2 * gear.actuator[1];
        const double least = gear.force_range[1][0], most = gear.force_range[1][1];
        forces[0] = speed < 0.0 ? max(least, -power) : least;
        forces[1] = speed > 0.0 ? min(most, power) : most;
    }
}

// Do MuJoCo's stages of positions and velocities, with their sensors; `clear`: there is no contact to be found.
void begin_step(const mjModel* model, mjData* data, bool clear) {
    mujoco.mj_checkPos(model, data);
    mujoco.mj_checkVel(model, data);
    mujoco.mj_kinematics(model, data);
    mujoco.mj_comPos(model, data);
    mujoco.mj_camlight(model, data);
    mujoco.mj_tendon(model, data);
    mujoco.mj_makeM(model, data);
    if (!clear || data->ncon > 0) mujoco.mj_collision(model, data);
    mujoco.mj_makeConstraint(model, data);
    mujoco.mj_island(model, data);
    mujoco.mj_transmission(model, data);
    mujoco.mj_sensorPos(model, data);
    mujoco.mj_fwdVelocity(model, data);
    mujoco.mj_sensorVel(model, data);
}

// Do MuJoCo's stages from the acceleration on; `last`: somebody reads the accelerometers of this step.
void end_step(const mjModel* model, mjData* data, bool advance, bool last) {
    mujoco.mj_solveM(model, data, data->qacc_smooth, data->qfrc_smooth, 1);
    mujoco.mj_fwdConstraint(model, data);
    // The sensors' own call believes those of mj_forward to be new.
    if (last) mujoco.mj_rnePostConstraint(model, data);  // else accelerometers keep those of the first step
    mujoco.mj_sensorAcc(model, data);
    if (advance) {
        mujoco.mj_checkAcc(model, data);
        mujoco.mj_Euler(model, data);
    }
}

// Move the state by all forces, those of constraints too, with the inertia as it is now.
void advance_damped(const mjModel* model, mjData* data, std::int64_t dofs) {
    for (int dof = 0; dof < dofs; ++dof) data->qacc[dof] = data->qfrc_smooth[dof] + data->qfrc_constraint[dof];
    mujoco.mj_solveM(model, data, data->qacc, data->qacc, 1);
    mujoco.mj_checkAcc(model, data);
    mujoco.mj_Euler(model, data);
}

// Do what a car that turns does in a step, of `before` (3,), its velocities along x, y [m/s] and yaw rate [rad/s].
// Forces turn with the car: it speeds up along its mean heading, and not along that of before. It moves over the
// ground by the mean of its velocities before and after, and turns likewise: with the velocity after, a car that
// slides at v comes to rest v h / 2 too soon, and its tires answer to steering late. Not where something else than
// tires stops the car: a contact counts on it.
void place_between(mjData* data, const Gear& gear, std::int64_t dofs, Numbers before, double timestep) {
    const Row<double> velocity = Row<double>{data->qvel, dofs}.part(gear.free_dof, gear.free_dof + 6);
    double* position = data->qpos + gear.free_qpos;
    const double after_x = velocity[0], after_y = velocity[1], after_turn = velocity[5];
    const double gain_x = after_x - before[0], gain_y = after_y - before[1];
    if (fg::hypot(gain_x, gain_y) >= most_pull * timestep) return;
    const double half = 0.25 * timestep * (before[2] + after_turn);
    const double sin_half = fg::sin(half), cos_half = fg::cos(half);
    velocity[0] = before[0] + gain_x * cos_half - gain_y * sin_half;
    velocity[1] = before[1] + gain_y * cos_half + gain_x * sin_half;
    position[0] += timestep * (0.5 * (before[0] + velocity[0]) - after_x);
    position[1] += timestep * (0.5 * (before[1] + velocity[1]) - after_y);
    const double quarter = 0.25 * timestep * (before[2] - after_turn);  // half of the angle
    const double sin = fg::sin(quarter), cos = fg::cos(quarter);
    double* turn = position + 3;
    const double w = turn[0], x = turn[1], y = turn[2], z = turn[3];
    turn[0] = w * cos - z * sin, turn[1] = x * cos + y * sin, turn[2] = y * cos - x * sin, turn[3] = z * cos + w * sin;
}

}  // namespace

void step_on_tires(const mjModel* model, mjData* data, const Inertia& inertia, Row<const Gear> gears,
                   Row<const Tire> tires, Matrix mu, Row<double> userdata, Row<double> scratch, std::int64_t dofs,
                   double timestep, bool advance, bool clear, bool last) {
    const auto count = mu.rows, wheels = mu.columns;
    begin_step(model, data, clear);
    limit_power(model, data, gears, dofs, true);
    for (int car = 0; car < count; ++car) {
        const Gear& gear = gears[car];
        if (gear.first_tire < 0) continue;
        const auto own = tire_states(userdata, gear.userdata, wheels);
        resist_rolling(data, tires.part(gear.first_tire, gear.first_tire + wheels), own, dofs);
        if (gear.drag > 0.0) resist_air(data, gear, dofs);
    }
    mujoco.mj_fwdActuation(model, data);
    damp_inertia(model, data, inertia, gears, dofs, timestep);
    mujoco.mj_fwdAcceleration(model, data);
    const Row<double> qvel{data->qvel, dofs};
    OwnRow<Kept> kept(count);
    for (int car = 0; car < count; ++car) {
        const Gear& gear = gears[car];
        if (gear.first_tire < 0) continue;
        const auto own = tires.part(gear.first_tire, gear.first_tire + wheels);
        const auto states = tire_states(userdata, gear.userdata, wheels);
        if (advance) {
            push_car(model, data, inertia, gear, own, mu[car], states, scratch, dofs, timestep, gear.tire_steps);
        } else {
            TireState copies[most_wheels];
            const Row<TireState> copied = row(copies).part(0, wheels);
            for (int k = 0; k < wheels; ++k) copied[k] = states[k];
            push_car(model, data, inertia, gear, own, mu[car], copied, scratch, dofs, timestep, gear.tire_steps);
            for (int k = 0; k < wheels; ++k) {
                copied[k].along = states[k].along, copied[k].across = states[k].across;  // the tires stay as they are
                states[k] = copied[k];
            }
        }
        if (gear.steered) {
            const auto [angle, rate] = steer(model, data, gear, timestep, gear.tire_steps);
            kept[car].steering_angle = angle, kept[car].steering_rate = rate;
        }
        if (gear.free_dof >= 0) {
            const auto free = gear.free_dof;
            double(&motion)[3] = kept[car].motion;
            motion[0] = qvel[free], motion[1] = qvel[free + 1], motion[2] = qvel[free + 5];
        }
    }
    if (damp_steering(model, data, inertia, gears, -timestep)) {
        mujoco.mj_projectConstraint(model, data);
        end_step(model, data, false, last);
        if (advance) {
            damp_steering(model, data, inertia, gears, timestep);
            advance_damped(model, data, dofs);
        }
    } else {
        end_step(model, data, advance, last);
    }
    limit_power(model, data, gears, dofs, false);
    if (!advance) return;
    for (int car = 0; car < count; ++car) {
        const Gear& gear = gears[car];
        if (gear.first_tire < 0 || gear.free_dof < 0) continue;
        place_between(data, gear, dofs, row(kept[car].motion), timestep);
        if (gear.steered) put_steering(data, gear, kept[car].steering_angle, kept[car].steering_rate);
    }
}

void steps_on_tires(const mjModel* model, mjData* data, const Inertia& inertia, Row<const Gear> gears,
                    Row<const Tire> tires, Matrix mu, Row<double> userdata, Row<double> scratch, std::int64_t dofs,
                    double timestep, Numbers readings, Table<double> records, Table<double> states) {
    for (int step = 0; step < records.rows; ++step) {
        step_on_tires(model, data, inertia, gears, tires, mu, userdata, scratch, dofs, timestep, true, false, true);
        for (int k = 0; k < records.columns; ++k) records[step][k] = readings[k];
        for (int k = 0; k < states.columns; ++k) states[step][k] = userdata[k];
    }
}

void step_on_contacts(const mjModel* model, mjData* data, Row<const Gear> gears, std::int64_t dofs) {
    limit_power(model, data, gears, dofs, true);
    mujoco.mj_step(model, data);
    limit_power(model, data, gears, dofs, false);
}

}  // namespace fg
