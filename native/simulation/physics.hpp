// Many states of one model, stepped by MuJoCo's batch functions.
#pragma once
#include <array>
#include <cstdint>

namespace fg {

// The places of the parts of a state in its row: the first index, and the one behind the last.
struct StateLayout {
    std::int64_t time;
    std::array<std::int64_t, 2> qpos;
    std::array<std::int64_t, 2> qvel;
    std::array<std::int64_t, 2> ctrl;
    std::array<std::int64_t, 2> mocap_pos;
    std::array<std::int64_t, 2> userdata;
};

}  // namespace fg
