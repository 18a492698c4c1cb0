// How the named tuples Situation and Plan of controllers/safety/judge.py become structures.
#pragma once
#include "../controllers/control/driving.hpp"
#include "../controllers/safety/rollout.hpp"
#include "tuple_casters.hpp"

NAMESPACE_BEGIN(NB_NAMESPACE)
NAMESPACE_BEGIN(detail)

template <>
struct type_caster<fg::Situation>
    : tuple_caster<fg::Situation, fg::Held<fg::Limiter>, fg::Held<fg::LimiterMemory>, fg::Held<fg::JudgeSettings>,
                   fg::Held<fg::ScanGeometry>, fg::Numbers, fg::Numbers, double, fg::Matrix,
                   fg::Held<fg::FrontierSearch>, double, double, double, bool> {};
template <> struct type_caster<fg::Plan> : tuple_caster<fg::Plan, double, double, fg::Matrix, double, double> {};

NAMESPACE_END(detail)
NAMESPACE_END(NB_NAMESPACE)

namespace fg {

inline void check_situation(const Situation& here) {
    require(here.ranges.length == here.widened.length && here.ranges.length > 0, "ranges and widened are not (n,)");
    require(here.movers.rows == 0 || here.movers.columns == 12, "movers are not (k, 12)");
}

}  // namespace fg
