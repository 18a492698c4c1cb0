#include "mujoco_library.hpp"

#include <stdexcept>
#include <string>

#ifdef _WIN32
#include <windows.h>

#include <filesystem>
#else
#include <dlfcn.h>
#endif

namespace fg {
namespace {

#ifdef _WIN32
void* open(const char* path) {  // in UTF-8
    const std::filesystem::path file(reinterpret_cast<const char8_t*>(path));
    return reinterpret_cast<void*>(LoadLibraryW(file.c_str()));
}
void* find(void* library, const char* name) {
    return reinterpret_cast<void*>(GetProcAddress(reinterpret_cast<HMODULE>(library), name));
}
#else
void* open(const char* path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
void* find(void* library, const char* name) { return dlsym(library, name); }
#endif

std::string version(int number) {  // as 3017000
    return std::to_string(number / 1000000) + "." + std::to_string(number / 1000 % 1000) + "." +
           std::to_string(number % 1000);
}

struct Source {
    const char* path;
    void* library;

    template <class Function>
    void find(Function& function, const char* name) const {
        function = reinterpret_cast<Function>(fg::find(library, name));
        if (!function) throw std::runtime_error(std::string(path) + " has no function " + name);
    }
};

}  // namespace

MujocoLibrary mujoco{};

void load_mujoco(const char* path) {
    const Source source{path, open(path)};
    if (!source.library) throw std::runtime_error(std::string(path) + " is no library that can be loaded");
    MujocoLibrary found{};
    source.find(found.mj_version, "mj_version");
    if (found.mj_version() != mjVERSION_HEADER)
        throw std::runtime_error(std::string(path) + " is MuJoCo " + version(found.mj_version()) +
                                 ", but fg_mujoco was compiled for MuJoCo " + version(mjVERSION_HEADER));
    source.find(found.mj_step, "mj_step");
    source.find(found.mj_checkPos, "mj_checkPos");
    source.find(found.mj_checkVel, "mj_checkVel");
    source.find(found.mj_checkAcc, "mj_checkAcc");
    source.find(found.mj_kinematics, "mj_kinematics");
    source.find(found.mj_comPos, "mj_comPos");
    source.find(found.mj_camlight, "mj_camlight");
    source.find(found.mj_tendon, "mj_tendon");
    source.find(found.mj_makeM, "mj_makeM");
    source.find(found.mj_collision, "mj_collision");
    source.find(found.mj_makeConstraint, "mj_makeConstraint");
    source.find(found.mj_island, "mj_island");
    source.find(found.mj_projectConstraint, "mj_projectConstraint");
    source.find(found.mj_transmission, "mj_transmission");
    source.find(found.mj_fwdVelocity, "mj_fwdVelocity");
    source.find(found.mj_fwdActuation, "mj_fwdActuation");
    source.find(found.mj_fwdAcceleration, "mj_fwdAcceleration");
    source.find(found.mj_fwdConstraint, "mj_fwdConstraint");
    source.find(found.mj_sensorPos, "mj_sensorPos");
    source.find(found.mj_sensorVel, "mj_sensorVel");
    source.find(found.mj_sensorAcc, "mj_sensorAcc");
    source.find(found.mj_rnePostConstraint, "mj_rnePostConstraint");
    source.find(found.mj_factorM, "mj_factorM");
    source.find(found.mj_solveM, "mj_solveM");
    source.find(found.mj_Euler, "mj_Euler");
    source.find(found.mj_resetData, "mj_resetData");
    source.find(found.mj_setState, "mj_setState");
    source.find(found.mj_getState, "mj_getState");
    source.find(found.mj_readCtrl, "mj_readCtrl");
    source.find(found.mjb_apply, "mjb_apply");
    mujoco = found;
}

}  // namespace fg
