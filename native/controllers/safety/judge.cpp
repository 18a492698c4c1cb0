// The judge: the proposals in their order, each simulated with several shares of the grip for cornering.
#include "judge.hpp"

#include "../control/reasons.hpp"
#include "../control/slip.hpp"
#include "../control/steering.hpp"
#include "../control/tracking.hpp"

namespace fg {
namespace {

constexpr double uses[] = {0.5, 1.0, 0.75, 0.25};          // shares of the grip for cornering, the limiter's own first
constexpr double braking[] = {0.5, 1.0, 0.75, 0.25, 0.0};  // of a stop: a car that brakes straight on loses its bend
constexpr double brakes_first[] = {0.0, 0.25};
constexpr double near_reference = 0.06;  // [rad] of steering, within which a direction is driven as fast as it
constexpr double widest = 1.8;           // [rad] to either side; directions further back are not simulated

// Return the steering angle [rad] that keeps the car on a motion from here.
double steering_on(const Situation& here, Matrix path) {
    const CarParameters& car = here.limiter.car;
    return steer_along(path, 0, {0.0, 0.0, 0.0}, here.speed, car.wheelbase, late_by(car),
                       late_on_path(here.limiter.slip, car, here.speed));
}

// Return the distance [m] of the goal by which a steering angle is read as a bearing.
double reach(const Situation& here) {
    const double speed = max(here.speed, here.settings.crawl_speed);
    return here.settings.pursuit_distance + path_lag(here.limiter.slip, speed);
}

// Return the bearing [rad] of a goal on the arc of a steering angle [rad].
double bearing_of(const Situation& here, double steering_angle) {
    const CarParameters& car = here.limiter.car;
    return bearing_of_arc(steering_angle, reach(here), car.lidar_offset, car.wheelbase);
}

// Return the plan along a path, or without one towards the end of the view on an arc.
Plan plan_on(const Situation& here, double steering_angle, Matrix path, double speed, double margin) {
    const double bearing = bearing_of(here, steering_angle);
    return {bearing, max(reading(here, bearing), here.settings.nearest_goal), path, speed, margin};
}

// Return the index of the greatest of some numbers, the first of equals; or of the first NaN.
int greatest(Numbers numbers) {
    int best = 0;
    for (int i = 0; i < numbers.size(); ++i) {
        if (std::isnan(numbers[i])) return i;
        if (numbers[i] > numbers[best]) best = i;
    }
    return best;
}

// Consider the directions to both sides of the reference, those with the longest view first, and the one in which the
// wheels stand.
bool look_aside(const Situation& here, const Wanted& wanted, Table<double> proposals, Best& best) {
    const JudgeSettings& settings = here.settings;
    const CarParameters& car = here.limiter.car;
    const double middle = bearing_of(here, wanted.steering_angle), distance = reach(here);
    const double speed = min(wanted.speed, settings.crawl_speed);
    const int count = 2 * whole(std::floor(settings.fan / settings.fan_step + 1e-6));
    const OwnRow<double> bearings(count), views(count);  // [rad] a step left, a step right, two left, ...; [m]
    for (int i = 0; i < count; ++i) {
        bearings[i] = middle + settings.fan_step * (i / 2 + 1) * (i % 2 == 0 ? 1.0 : -1.0);
        views[i] = std::abs(bearings[i]) > widest ? 0.0 : max(reading(here, bearings[i]), settings.nearest_goal);
    }
    for (int tried = 0; tried < count; ++tried) {
        const int i = greatest(views);
        if (!(views[i] > 0.0)) break;
        const Plan plan{bearings[i], views[i], {}, speed, settings.margin_aside};
        const double angle = pursue(bearings[i], distance, car.lidar_offset, car.wheelbase);
        if (consider(here, proposal_aside, angle, plan, row(uses), proposals, best)) return true;
        views[i] = 0.0;
    }
    const double held = held_arc(here.limiter.slip, car, here.angle, here.memory.curvature);
    const double bearing = bearing_of(here, here.angle), view = reading(here, bearing);
    const Plan plan{bearing, max(view, settings.pursuit_distance), {}, speed, settings.margin_aside};
    return consider(here, proposal_as_it_stands, held, plan, row(uses), proposals, best);
}

// Take what is nearer to the reference than a direction aside, if it meets nothing, too.
void stay_near(const Situation& here, const Wanted& wanted, Table<double> proposals, Best& best, Best& found) {
    const JudgeSettings& settings = here.settings;
    found.contact = inf;
    if (wanted.guided) {
        const Plan plan = plan_on(here, wanted.steering_angle, wanted.path, 0.0, settings.margin_aside);
        consider(here, proposal_motion, wanted.steering_angle, plan, row(brakes_first), proposals, found);
    } else if (wanted.path.rows == 0 && std::abs(best.steering_angle - wanted.steering_angle) < near_reference) {
        const double margin = settings.margin_kept * settings.margin;
        const Plan plan = plan_on(here, best.steering_angle, wanted.path, wanted.speed, margin);
        consider(here, proposal_beside, best.steering_angle, plan, row(uses), proposals, found);
    }
    if (found.contact == 0.0) take(best, found);
}

}  // namespace

void judge(const Situation& here, const Wanted& wanted, Judge& memory) {
    const JudgeSettings& settings = here.settings;
    const Table<double> proposals = table(memory.proposals);
    const double angle = wanted.steering_angle;
    Best& best = memory.best;
    double margin = wanted.path.rows == 0 ? settings.margin : settings.margin_aside;
    if (wanted.passed) margin *= settings.margin_kept;
    best.contact = inf;
    const Plan reference = plan_on(here, angle, wanted.path, wanted.speed, margin);
    if (consider(here, proposal_reference, angle, reference, row(uses), proposals, best)) return;
    if (wanted.passed && here.speed > settings.crawl_speed) {
        Plan stop = reference;
        stop.speed = 0.0;
        if (consider(here, proposal_stop, angle, stop, row(braking), proposals, best)) return;
    }
    if (look_aside(here, wanted, proposals, best)) {
        stay_near(here, wanted, proposals, best, memory.second);
        return;
    }
    if (wanted.last_stop.rows > 0 && here.speed > settings.standing_speed) {
        const double on_it = steering_on(here, wanted.last_stop);
        for (const double kept : {settings.margin_kept * settings.margin_aside, 0.0}) {
            const Plan last = plan_on(here, on_it, wanted.last_stop, 0.0, kept);
            if (consider(here, proposal_last_stop, on_it, last, row(braking), proposals, best)) return;
        }
    }
    if (wanted.guided) {  // it is free, as far as its search could tell
        best.why = proposal_reference;
        best.steering_angle = angle;
        best.use = 1.0;
    }
}

bool judge_own(const Situation& here, Matrix path, double speed, Judge& memory) {
    Best& found = memory.second;
    const double angle = steering_on(here, path);
    found.contact = inf;
    const Plan plan{0.0, 0.0, path, speed, here.settings.margin_aside};
    if (!consider(here, proposal_own, angle, plan, row(uses), table(memory.proposals), found)) return false;
    take(memory.best, found);
    return true;
}

bool consider(const Situation& here, std::int64_t why, double steering_angle, const Plan& plan, Numbers uses,
              Table<double> proposals, Best& best) {
    for (int i = 0; i < uses.size(); ++i) {
        const Met met = simulate(here, plan, uses[i], max(here.speed, here.settings.crawl_speed));
        log_proposal(proposals, why, steering_angle, plan.speed, met);
        if (met.speed < best.contact) {
            best.why = why;
            best.steering_angle = steering_angle;
            best.speed = plan.speed;
            best.use = uses[i];
            best.contact = met.speed;
        }
        if (met.what == Met::free) return true;
    }
    return false;
}

}  // namespace fg
