#include "single_track.hpp"

#include <array>
#include <cmath>

#include "../../core/numbers.hpp"
#include "../../core/transcendental.hpp"

namespace fg {
namespace {

constexpr double sliding_share = 0.7;  // [-] of its peak, below which the force of a tire does not fall, as in files of
                                       // tires that say nothing else
constexpr double hardly = 0.2;  // [-] of the load: a drive so small takes a fiftieth of the lateral force at most, and
                                // one step to find

// The motion of the car in a segment.
struct Motion {
    double vy, r, x, y, heading;
    std::array<double, 2> slip;  // [rad] angles of the front and the rear axle
    double leaning;              // [m/s^2] lateral acceleration of the loads
    double roll;                 // [rad] to the outside
};

// Angle of the front wheels [rad], forward speed [m/s] and acceleration [m/s^2].
struct Driven {
    double steering, vx, ax;
};

// How the car rolls in a part of a step: not at all, or after `lean` [rad s^2/m] times its lateral acceleration.
struct Rolling {
    bool rolls;
    double lean, rolled;  // `rolled`: what is left of a roll after a part of a step
};

// Return the loads of the front and the rear axle [N]; a forward acceleration [m/s^2] moves load between them.
std::array<double, 2> axle_loads(double acceleration, const SingleTrackCar& car) {
    const double moved = acceleration * car.height, length = car.front + car.rear;
    return {car.mass * (car.gravity * car.rear - moved) / length,
            car.mass * (car.gravity * car.front + moved) / length};
}

// Return F_y / F_z of an axle [-] at a slip angle [rad].
double friction_used(double slip, const AxleTires& tire) {
    const double x = tire.stiffness / (tire.c * tire.d) * slip;
    return tire.d * fg::sin(tire.c * fg::atan(x - tire.e * (x - fg::atan(x))));
}

// Return F_y / F_z of a tire [-] at a slip of its own sign, never below its share of the peak behind it.
double held(double slip, const AxleTires& tire) {
    const double x = tire.stiffness / (tire.c * tire.d) * slip;
    const double turn = tire.c * fg::atan(x - tire.e * (x - fg::atan(x)));
    const double used = tire.d * fg::sin(turn);
    return turn > 0.5 * pi ? max(used, sliding_share * tire.d) : used;
}

// Return the force of a tire over its load and its slip, at a slip angle [rad] and a slip ratio [-].
double secant(double slip, double ratio, const AxleTires& tire) {
    const double size = std::sqrt(slip * slip + ratio * ratio + 1e-12);
    return held(size, tire) / size;
}

// Return the lateral force of a tire [N] at a slip angle [rad], driven by a force along its heading [N].
// By similarity: the curve gives the force at the size of the vector of slip ratio and slip angle. The slip ratio is
// the one with that drive; where there is none, the tire spins, at a slip ratio of 1.
double across_tire(double slip, double load, double drive, const AxleTires& tire) {
    double used = secant(slip, 0.0, tire);
    const int rounds = std::abs(drive) < hardly * load ? 1 : 3;
    for (int round = 0; round < rounds; ++round) {
        used = secant(slip, min(std::abs(drive) / max(load * used, 1e-6), 1.0), tire);
    }
    return load * used * slip;
}

// Return both axles' pull along their wheels [N] for a force on the car; `rolls`: rear way over the front's.
std::array<double, 2> pulls(double total, const Motion& motion, std::array<double, 2> loads, double cos, double rolls,
                            const SimulatedDrive& drive) {
    const double share = drive.car.front_share;
    if (drive.car.shaft == 0.0) {
        const double pull = total / (share * cos + 1.0 - share);
        return {share * pull, (1.0 - share) * pull};
    }
    double front = 0.0, rear = 0.0, ratio_front = 0.0, ratio_rear = 0.0;
    for (int round = 0; round < 3; ++round) {
        front = loads[0] * secant(motion.slip[0], ratio_front, drive.tires.front);
        rear = loads[1] * secant(motion.slip[1], ratio_rear, drive.tires.rear);
        ratio_rear = (total - front * (rolls - 1.0) * cos) / (front * rolls * cos + rear);
        ratio_rear = min(max(ratio_rear, -1.0), 1.0);
        ratio_front = rolls * (1.0 + ratio_rear) - 1.0;
    }
    return {front * ratio_front, rear * ratio_rear};
}

// Return the slip angles of both axles [rad]; `vy` is of what the wheels stand on, below the centre of gravity.
std::array<double, 2> slips(double vy, double r, double steering, double vx, const SingleTrackCar& car) {
    return {steering - fg::atan2(vy + car.front * r, vx), -fg::atan2(vy - car.rear * r, vx)};
}

// Return the lateral [m/s^2] and the yaw acceleration [rad/s^2] of a car whose tires all differ.
std::array<double, 2> two_track_accelerations(const Motion& motion, const Driven& now, std::array<double, 2> loads,
                                              const SimulatedDrive& drive) {
    const SingleTrackCar& car = drive.car;
    const double vy = motion.vy, r = motion.r, vx = now.vx, half = car.half_width;
    const double length = car.front + car.rear;
    const double cos = fg::cos(now.steering), sin = fg::sin(now.steering);
    // What drives the car overcomes the drag of the steered wheels, as at the force that turns the car.
    const double drag = car.mass * motion.leaning * car.rear / length * fg::tan(now.steering);
    const double rolls = vx / (vx * cos + (vy + car.front * r) * sin);
    const auto [pull_front, pull_rear] = pulls(car.mass * now.ax + drag, motion, loads, cos, rolls, drive);
    const double moved = 0.25 * car.mass * motion.leaning * car.height / half;  // [N] to the outer tire of each axle
    double across = 0.0, turning = 0.0;
    for (const double side : {-1.0, 1.0}) {  // right, left
        const double along = vx - side * half * r;
        // Ackermann's angle of this wheel, and how its slip angle differs from its axle's
        const double angle = fg::atan2(length * sin, length * cos - side * half * sin);
        double apart =
            (angle - fg::atan2(vy + car.front * r, along)) - (now.steering - fg::atan2(vy + car.front * r, vx));
        double load = max(0.5 * loads[0] - side * moved, 0.0);
        double pull = 0.5 * pull_front;
        double force = across_tire(motion.slip[0] + apart, load, pull, drive.tires.front);
        const double cos_wheel = fg::cos(angle), sin_wheel = fg::sin(angle);
        const double to_left = force * cos_wheel + pull * sin_wheel;
        across += to_left;
        turning += car.front * to_left - side * half * (pull * cos_wheel - force * sin_wheel);
        apart = fg::atan2(vy - car.rear * r, vx) - fg::atan2(vy - car.rear * r, along);
        load = max(0.5 * loads[1] - side * moved, 0.0);
        pull = 0.5 * pull_rear;
        force = across_tire(motion.slip[1] + apart, load, pull, drive.tires.rear);
        across += force;
        turning += -car.rear * force - side * half * pull;
    }
    return {across / car.mass, turning / car.inertia};
}

// Return the lateral [m/s^2] and the yaw acceleration [rad/s^2].
std::array<double, 2> accelerations(const Motion& motion, const Driven& now, const SimulatedDrive& drive) {
    const SingleTrackCar& car = drive.car;
    const auto loads = axle_loads(now.ax, car);
    if (car.half_width != 0.0) return two_track_accelerations(motion, now, loads, drive);
    const double cos = fg::cos(now.steering), sin = fg::sin(now.steering), share = car.front_share;
    const double force_front = loads[0] * friction_used(motion.slip[0], drive.tires.front);
    const double force_rear = loads[1] * friction_used(motion.slip[1], drive.tires.rear);
    const double pull = share * (car.mass * now.ax + force_front * sin) / (share * cos + 1.0 - share);
    const double across_front = force_front * cos + pull * sin;
    return {(across_front + force_rear) / car.mass, (car.front * across_front - car.rear * force_rear) / car.inertia};
}

// Drive on by a part of a step [s], from the accelerations now to what is driven then.
void advance(Motion& motion, std::array<double, 2> accelerations_now, const Driven& now, const Driven& then,
             double part, const Rolling& rolling, const SimulatedDrive& drive) {
    const auto [ay, turn] = accelerations_now;
    const SingleTrackCar& car = drive.car;
    // [m/s] the wheels move to the inside of the turn
    const double swing =
        rolling.rolls ? car.height * (1.0 - rolling.rolled) * (rolling.lean * ay - motion.roll) / part : 0.0;
    Motion next = motion;
    next.vy = motion.vy + part * (ay - now.vx * motion.r);
    next.r = motion.r + part * turn;
    next.slip = slips(next.vy + swing, next.r, then.steering, then.vx, car);
    if (drive.relaxation_length > 0.0) {
        // exact where the slip angle that they follow changes evenly
        const auto steady = slips(motion.vy + swing, motion.r, now.steering, now.vx, car);
        const double way = part * 0.5 * (now.vx + then.vx) / drive.relaxation_length;
        const double kept = fg::exp(-way), mean = (1.0 - kept) / way;
        for (const int axle : {0, 1}) {
            next.slip[axle] =
                kept * motion.slip[axle] + (mean - kept) * steady[axle] + (1.0 - mean) * next.slip[axle];
        }
    }
    next.leaning = ay;
    const auto [new_ay, new_turn] = accelerations(next, then, drive);
    if (rolling.rolls) {
        next.roll = rolling.rolled * motion.roll + (1.0 - rolling.rolled) * rolling.lean * 0.5 * (ay + new_ay);
    }
    const double half = 0.5 * part;
    const double lateral = ay - now.vx * motion.r + new_ay - then.vx * next.r;
    next.vy = motion.vy + half * lateral;
    next.r = motion.r + half * (turn + new_turn);
    next.heading = motion.heading + half * (motion.r + next.r);
    const double halfway = 0.5 * (motion.heading + next.heading), across = 0.5 * (motion.vy + next.vy);
    const double ahead = 0.5 * (now.vx + then.vx);
    next.x = motion.x + part * (ahead * fg::cos(halfway) - across * fg::sin(halfway));
    next.y = motion.y + part * (ahead * fg::sin(halfway) + across * fg::cos(halfway));
    next.leaning = new_ay;
    if (drive.relaxation_length == 0.0) next.slip = slips(next.vy, next.r, then.steering, then.vx, car);
    motion = next;
}

}  // namespace

OwnRow<double> friction_curve(Numbers slip, const AxleTires& tire) {
    OwnRow<double> found(slip.length);
    for (std::int64_t i = 0; i < slip.length; ++i) found[i] = friction_used(slip[i], tire);
    return found;
}

void simulate_segments(const SimulatedDrive& drive, Table<const std::int64_t> segments, Matrix starts,
                       Table<double> out) {
    const SingleTrackCar& car = drive.car;
    // Slip angles that follow at once make the stiffest motion of all.
    const int parts = drive.relaxation_length == 0.0 ? 2 : 1;
    const double part = drive.step / parts;
    Rolling rolling{};
    rolling.rolls = drive.relaxation_length > 0.0 && car.half_width > 0.0 && car.height > 0.0 && drive.gain != 1.0;
    if (rolling.rolls) {
        rolling.lean = (drive.gain - 1.0) / car.gravity;
        rolling.rolled = fg::exp(-part / (car.half_width * std::sqrt(std::abs(rolling.lean) / car.height)));
    }
    const auto at = [&](std::int64_t node) {
        return Driven{drive.steering[node], drive.forward_speed[node], drive.forward_acceleration[node]};
    };
    for (std::int64_t segment = 0; segment < segments.rows; ++segment) {
        const std::int64_t first = segments[segment][0], end = segments[segment][1];
        const Numbers start = starts[segment];
        const Driven begun = at(first);
        const double leaning = begun.vx * start[1];
        Motion motion{start[0], start[1], start[2], start[3], start[4],
                      slips(start[0], start[1], begun.steering, begun.vx, car), leaning, rolling.lean * leaning};
        for (std::int64_t node = first; node < end; ++node) {
            Driven now = at(node);
            auto found = accelerations(motion, now, drive);
            const double reading = rolling.rolls ? found[0] + car.gravity * motion.roll : drive.gain * found[0];
            const std::array all{motion.vy, motion.r, motion.x, motion.y, motion.heading, reading};
            for (std::size_t i = 0; i < all.size(); ++i) out[node][i] = all[i];
            if (node == end - 1) break;
            const Driven next = at(node + 1);
            const Driven change{(next.steering - now.steering) / parts, (next.vx - now.vx) / parts,
                                (next.ax - now.ax) / parts};
            for (int k = 0; k < parts; ++k) {
                if (k > 0) found = accelerations(motion, now, drive);
                const Driven then{now.steering + change.steering, now.vx + change.vx, now.ax + change.ax};
                advance(motion, found, now, then, part, rolling, drive);
                now = then;
            }
        }
    }
}

}  // namespace fg
