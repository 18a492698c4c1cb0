// The functions of native/lidar as Python sees them; fg_mujoco/_native.pyi has their signatures.
#pragma once
#include <nanobind/nanobind.h>

namespace fg {

void bind_lidar(nanobind::module_& module);

}  // namespace fg
