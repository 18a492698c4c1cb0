// The functions of the native core as Python sees them, a room each; fg_mujoco/_native.pyi has their signatures.
#pragma once
#include <nanobind/nanobind.h>

namespace fg {

void bind_arena(nanobind::module_& module);
void bind_calls(nanobind::module_& module);
void bind_controllers(nanobind::module_& module);
void bind_course(nanobind::module_& module);
void bind_drivers(nanobind::module_& module);
void bind_envs(nanobind::module_& module);
void bind_gym2d(nanobind::module_& module);
void bind_lidar(nanobind::module_& module);
void bind_perception(nanobind::module_& module);
void bind_predictions(nanobind::module_& module);
void bind_racing_drivers(nanobind::module_& module);
void bind_realcar(nanobind::module_& module);
void bind_records(nanobind::module_& module);
void bind_safety(nanobind::module_& module);
void bind_simulation(nanobind::module_& module);
void bind_transcendental(nanobind::module_& module);
void bind_vehicle(nanobind::module_& module);

}  // namespace fg
