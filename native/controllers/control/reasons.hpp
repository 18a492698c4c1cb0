// Why a command is what it is: what each step of driving made of the reference, in the order of the work.
#pragma once
#include <cmath>
#include <cstdint>

#include "../../core/arrays.hpp"
#include "../../core/numbers.hpp"
#include "../safety/rollout.hpp"

namespace fg {

// The steps, as rows of a table of reasons.
enum Step : std::int64_t {
    step_maximum,
    step_planner,
    step_last_plan,
    step_no_plan,
    step_mean_range,
    step_guidance,
    step_moves,
    step_remembered_line,
    step_no_reference,
    step_ahead,
    step_law,
    step_after_recovery,
    step_sight,
    step_plan_in_time,
    step_safety_filter,
    step_recovery,
    step_lock,
    step_grip,
    step_transients,
    step_speedometer
};

// Why something was proposed, see safety.judge: rows of a table of proposals.
enum Proposed : std::int64_t {
    proposal_reference,
    proposal_stop,
    proposal_aside,
    proposal_as_it_stands,
    proposal_beside,
    proposal_motion,
    proposal_last_stop,
    proposal_on_line,
    proposal_own,
    proposal_left_out
};

// Why a motion that a stage proposed is left out.
enum Fault : std::int64_t {
    fault_not_finite,
    fault_no_points,
    fault_too_sharp,
    fault_reverses,
    fault_too_many,
    fault_decided,
    fault_no_judge
};

// Make tables of reasons and of proposals empty, for the next decision.
inline void forget_reasons(Table<double> reasons, Table<double> proposals) {
    for (int why = 0; why < proposals.rows; ++why) proposals[why][1] = nan;
    for (int step = 0; step < reasons.rows; ++step) reasons[step][0] = reasons[step][1] = nan;
}

// Write what a step made of the reference into a table of reasons.
inline void log_step(Table<double> reasons, std::int64_t step, double steering_angle, double speed) {
    const Row<double> row = reasons[step];
    row[0] = steering_angle, row[1] = speed;
}

// Write what a proposal would have met into a table of proposals, if that is slower than what stands there.
inline void log_proposal(Table<double> proposals, std::int64_t why, double steering_angle, double speed,
                         const Met& met) {
    const Row<double> row = proposals[why];
    if (!std::isnan(row[1]) && !(met.speed < row[2])) return;
    row[0] = steering_angle, row[1] = speed;
    row[2] = met.speed, row[3] = met.time, row[4] = static_cast<double>(met.what);
}

// Write that a stage's motion is left out into a table of proposals: the first fault, and how many more.
inline void log_left_out(Table<double> proposals, std::int64_t fault) {
    const Row<double> row = proposals[proposal_left_out];
    if (std::isnan(row[1])) {
        for (int i = 0; i < 4; ++i) row[i] = 0.0;
        row[4] = static_cast<double>(fault);
    } else {
        row[2] += 1.0;
    }
}

}  // namespace fg
