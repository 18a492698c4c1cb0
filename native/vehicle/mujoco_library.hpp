// The functions of the MuJoCo library that the package `mujoco` brings. They are looked up when fg_mujoco is imported,
// because each installation has its library somewhere else.
#pragma once
#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

namespace fg {

struct MujocoLibrary {
    decltype(&::mj_version) mj_version;
    decltype(&::mj_step) mj_step;
    decltype(&::mj_checkPos) mj_checkPos;
    decltype(&::mj_checkVel) mj_checkVel;
    decltype(&::mj_checkAcc) mj_checkAcc;
    decltype(&::mj_kinematics) mj_kinematics;
    decltype(&::mj_comPos) mj_comPos;
    decltype(&::mj_camlight) mj_camlight;
    decltype(&::mj_tendon) mj_tendon;
    decltype(&::mj_makeM) mj_makeM;
    decltype(&::mj_collision) mj_collision;
    decltype(&::mj_makeConstraint) mj_makeConstraint;
    decltype(&::mj_island) mj_island;
    decltype(&::mj_projectConstraint) mj_projectConstraint;
    decltype(&::mj_transmission) mj_transmission;
    decltype(&::mj_fwdVelocity) mj_fwdVelocity;
    decltype(&::mj_fwdActuation) mj_fwdActuation;
    decltype(&::mj_fwdAcceleration) mj_fwdAcceleration;
    decltype(&::mj_fwdConstraint) mj_fwdConstraint;
    decltype(&::mj_sensorPos) mj_sensorPos;
    decltype(&::mj_sensorVel) mj_sensorVel;
    decltype(&::mj_sensorAcc) mj_sensorAcc;
    decltype(&::mj_rnePostConstraint) mj_rnePostConstraint;
    decltype(&::mj_factorM) mj_factorM;
    decltype(&::mj_solveM) mj_solveM;
    decltype(&::mj_Euler) mj_Euler;
    decltype(&::mj_resetData) mj_resetData;
    decltype(&::mj_setState) mj_setState;
    decltype(&::mj_getState) mj_getState;
    decltype(&::mj_readCtrl) mj_readCtrl;
    decltype(&::mjb_apply) mjb_apply;
};

// All null until `load_mujoco` is called.
extern MujocoLibrary mujoco;

// Look up the functions of the library in a file.
// Throws std::runtime_error: there is no such library, it lacks a function, or it is of another version than the
// headers that this was compiled with, so that its structures may be others.
void load_mujoco(const char* path);

}  // namespace fg
