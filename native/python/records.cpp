// Binds the layouts of all records, for fg_mujoco/native.py to compare with Python's types.
#include <nanobind/nanobind.h>

#include "../controllers/control/actuation.hpp"
#include "../controllers/control/driving.hpp"
#include "../controllers/control/planner_settings.hpp"
#include "../controllers/control/slip.hpp"
#include "../controllers/control/stages.hpp"
#include "../controllers/perception/frontiers.hpp"
#include "../controllers/perception/lap_map.hpp"
#include "../controllers/perception/local_map.hpp"
#include "../controllers/perception/scan_geometry.hpp"
#include "../controllers/perception/targets.hpp"
#include "../controllers/safety/braking_trajectories.hpp"
#include "../controllers/safety/friction_limiter.hpp"
#include "../controllers/safety/guidance.hpp"
#include "../controllers/safety/judge.hpp"
#include "../controllers/safety/lap_raceline.hpp"
#include "../controllers/safety/lap_trial.hpp"
#include "../controllers/safety/motion_search.hpp"
#include "../controllers/safety/plan_in_time.hpp"
#include "../controllers/safety/predictions.hpp"
#include "../controllers/safety/recovery.hpp"
#include "../controllers/safety/turning.hpp"
#include "../course/lap_timer.hpp"
#include "../messages.hpp"
#include "../simulation/telemetry.hpp"
#include "../vehicle/motion.hpp"
#include "../vehicle/tire_rows.hpp"
#include "bindings.hpp"
#include "tables.hpp"

namespace nb = nanobind;

namespace fg {
void bind_records(nb::module_& module) {
    module.attr("RECORDS") = nb::dict();
    FG_ADD(Axle);
    FG_ADD(Best);
    FG_ADD(BrakingSettings);
    FG_ADD(Car);
    FG_ADD(CarParameters);
    FG_ADD(Driver);
    FG_ADD(DrivingMemory);
    FG_ADD(DrivingSettings);
    FG_ADD(FeltGround);
    FG_ADD(FrictionLimiterSettings);
    FG_ADD(FrontierSearch);
    FG_ADD(Gear);
    FG_ADD(Guidance);
    FG_ADD(GuidanceSettings);
    FG_ADD(Judge);
    FG_ADD(JudgeSettings);
    FG_ADD(LapMap);
    FG_ADD(LapTimer);
    FG_ADD(Limiter);
    FG_ADD(LimiterMemory);
    FG_ADD(Line);
    FG_ADD(LocalMap);
    FG_ADD(Motion);
    FG_ADD(Odometry);
    FG_ADD(PlanInTime);
    FG_ADD(Predictions);
    FG_ADD(Recovery);
    FG_ADD(RecoverySettings);
    FG_ADD(Reference);
    FG_ADD(Remembered);
    FG_ADD(ScanGeometry);
    FG_ADD(Slip);
    FG_ADD(Snapshot);
    FG_ADD(Speedometer);
    FG_ADD(Statistics);
    FG_ADD(Target);
    FG_ADD(Targets);
    FG_ADD(TickRecord);
    FG_ADD(Tire);
    FG_ADD(Trajectories);
    FG_ADD(Trial);
    FG_ADD(Turning);
    FG_ADD(VelocityFrame);
}

}  // namespace fg
