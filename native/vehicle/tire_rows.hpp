// Tires, steering and drive of a car, as tire_rows.py reads them off a compiled model.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"
#include "../core/records.hpp"

namespace fg {

// Numbers of each tire in `userdata`: deflections [m] along the wheel's heading and to its left, which the next step
// begins with; then what the tire did in the last step: its mean load [N] and force [N], forward and to the left
// positive, the greatest speed at which it slid [m/s], that across its heading, and its greatest slip over that of the
// peak.
struct TireState {
    double along, across, load, force_along, force_across, sliding, sliding_across, slip_size;
};
constexpr int tire_numbers = sizeof(TireState) / sizeof(double);  // USERDATA

// The states of `count` tires, whose numbers are in `userdata` from a place on.
inline Row<const TireState> tire_states(Numbers userdata, std::int64_t place, std::int64_t count) {
    const Numbers own = userdata.part(place, place + tire_numbers * count);
    return {reinterpret_cast<const TireState*>(own.data), count};
}
inline Row<TireState> tire_states(Row<double> userdata, std::int64_t place, std::int64_t count) {
    const Row<double> own = userdata.part(place, place + tire_numbers * count);
    return {reinterpret_cast<TireState*>(own.data), count};
}

// A tire with a law of ours, and its wheel. Functions take an array (tires,) of it; none for the model `contact`.
struct Tire {
    std::int64_t law;  // its place in LAWS
    std::int64_t holds;  // see Law
    std::int64_t slides;
    std::int64_t alike;  // whether both curves are the same
    double curve[2][197];
    double slope[2];
    double peak_slip[2];  // 1 where there is no peak
    double peak[2];
    double relaxation_length;
    double load_sensitivity;
    double nominal_load;
    double vertical_stiffness;
    double vertical_damping;
    double rolling_resistance;
    double damping;  // [N s/m] of its deflections
    double radius;  // [m] of an ellipsoid about its axle, and half its width; equal: of a sphere
    double half_width;
    double ground;  // [m] height
    std::int64_t body;  // of the wheel
    std::int64_t root;  // of its tree
    double axle[3];  // in the frame of the wheel's body, forward spin positive
    std::int64_t spin_dof;
    std::int64_t links;
    std::int64_t own_links;  // how many of them move this wheel only: the first ones
    std::int64_t chain[16];  // the dofs that move it, from its spin to the root
    std::int64_t common[16];  // their places in `Gear.common`, behind its own
    std::int64_t turned_by[16];  // how many, the first ones, turn the wheel against the body of each
    std::int64_t straight[16];  // whether each moves without turning
};
FG_RECORD(Tire, law, holds, slides, alike, curve, slope, peak_slip, peak, relaxation_length, load_sensitivity,
          nominal_load, vertical_stiffness, vertical_damping, rolling_resistance, damping, radius, half_width, ground,
          body, root, axle, spin_dof, links, own_links, chain, common, turned_by, straight);

// The steering and the drive of a car; of one on MuJoCo's contacts only the servos and the motor's power.
struct Gear {
    std::int64_t first_tire;  // its first row among those of TIRE; -1: its tires are MuJoCo's contacts
    std::int64_t userdata;  // where in `userdata` that of its tires begins
    std::int64_t free_qpos;  // of base_link's joint
    std::int64_t free_dof;
    double drag;  // [N s/m] against the velocity of its centre of gravity
    std::int64_t tire_steps;  // short steps in a physics step, of `steps_within`
    std::int64_t commons;
    std::int64_t common[16];  // the dofs that move more than one wheel, in order
    std::int64_t common_of[16][16];  // where the entries of their rows are among them
    std::int64_t steered;  // whether `steer` moves the steering, and the kingpins follow by polynomials
    std::int64_t handed;  // whether MuJoCo's stages do; neither: its tires are MuJoCo's contacts, or it is no car
    std::int64_t steering_qpos;
    std::int64_t steering_dof;
    double servo_damping[3];  // [N m s/rad] of its servo, and by the rate and its square; if handed
    double servo_gear;
    double steering_damping;  // [N m s/rad] of it and its kingpins
    double steering_inertia;  // [kg m^2] likewise
    double steering_range[2];  // [rad] at which its joint ends; infinite: nowhere
    std::int64_t kingpin_qpos[2];
    std::int64_t kingpin_dof[2];
    double ackermann[2][5];  // their angles as polynomials of the steering angle
    std::int64_t driven;  // whether the motor acts through fixed shares of the wheels' spins
    std::int64_t lanes;  // how many speeds of the drive line are followed, that of the drive first; see `push_car`
    double share[4][4];  // of each wheel's spin in each of them
    double give[4];  // of what ties each: 0 rigid, else an inverse inertia; negative: nothing does
    double preload[4];  // [N m] of a clutch that holds each, [N] of the drag brake; negative: none does
    double ramp[4];  // [-] of the torque through its axle
    std::int64_t clutches;
    std::int64_t actuator[2];
    std::int64_t delayed[2];  // how MuJoCo interpolates what they were told; -1: they have no delay
    double control_range[2][2];
    double force_range[2][2];
    double power;  // [W] of the motor: its greatest force at `power_limit_speed`
    std::int64_t spin_dof[4];
    double wheel_radius;  // [m] mean of the drive
};
FG_RECORD(Gear, first_tire, userdata, free_qpos, free_dof, drag, tire_steps, commons, common, common_of, steered,
          handed, steering_qpos, steering_dof, servo_damping, servo_gear, steering_damping, steering_inertia,
          steering_range, kingpin_qpos, kingpin_dof, ackermann, driven, lanes, share, give, preload, ramp, clutches,
          actuator, delayed, control_range, force_range, power, spin_dof, wheel_radius);

}  // namespace fg
