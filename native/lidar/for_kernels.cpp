// Functions in C that the kernels of fg_mujoco/simulation call, by name and by the addresses of arrays; declared in
// fg_mujoco/lidar/in_kernels.py. The arrays of a scene and its scratch arrays come as the rows of an array table
// (fg_mujoco/compiled/array_table.py): the address of an array, and its length along up to three axes. Nothing is
// checked here; the scene was checked when it was made. An index out of range in a build with FG_CHECK_BOUNDS ends the
// process, because no exception may pass through a kernel.
#include "body_poses.hpp"
#include "links.hpp"
#include "scanline.hpp"

#if defined(_WIN32)
#define FG_EXPORTED extern "C" __declspec(dllexport)
#else
#define FG_EXPORTED extern "C" __attribute__((visibility("default")))
#endif

namespace fg {
namespace {

struct TableRow {
    std::int64_t address, lengths[3];

    template <class T>
    Row<T> row() const {
        return {reinterpret_cast<T*>(address), lengths[0]};
    }
    template <class T>
    Table<T> table() const {
        return {reinterpret_cast<T*>(address), lengths[0], lengths[1]};
    }
};

Scene scene_of(const TableRow* rows) {
    return {rows[0].table<const double>(),       rows[1].row<const double>(),   rows[2].table<const double>(),
            rows[3].table<const std::uint16_t>(), rows[4].table<const double>(), rows[5].table<const std::int32_t>(),
            rows[6].table<const double>(),       rows[7].table<const std::int32_t>(),
            rows[8].table<const double>(),       rows[9].table<const double>()};
}

Scratch scratch_of(const TableRow* rows) {
    return {rows[0].table<double>(),       rows[1].row<std::int32_t>(), rows[2].row<double>(),
            rows[3].table<std::int32_t>(), rows[4].row<std::int32_t>(), rows[5].table<double>()};
}

}  // namespace
}  // namespace fg

// See `scan`; `out` has as many numbers as the scene has beams, and as many bodies move as it has frames but the first.
FG_EXPORTED void fg_scan(const fg::TableRow* scene_rows, const fg::TableRow* scratch_rows, const double* position,
                         const double* rotation, const double* moving_positions, const double* moving_rotations,
                         double* out, std::int64_t own_tree) noexcept {
    const fg::Scene scene = fg::scene_of(scene_rows);
    const std::int64_t moving = scene.frames.rows - 1;
    fg::scan(scene, fg::scratch_of(scratch_rows), {position, 3}, {rotation, 3, 3}, {moving_positions, moving, 3},
             {moving_rotations, moving, 3, 3}, {out, scene.beams.columns}, static_cast<int>(own_tree));
}

// See `place_links`; `bodies` of them have places in `positions` and `rotations`.
FG_EXPORTED void fg_place_links(const double* qpos, std::int64_t positions_in_qpos, const fg::Link* links,
                                std::int64_t count, double* poses, double* positions, double* rotations,
                                std::int64_t bodies) noexcept {
    fg::place_links({qpos, positions_in_qpos}, {links, count}, {poses, count, 7}, {positions, bodies, 3},
                    {rotations, bodies, 3, 3});
}

// See `mounted_pose`; `pose` (7,) is position and quaternion.
FG_EXPORTED void fg_mounted_pose(const double* pose, std::int64_t level, const double* offset_position,
                                 const double* offset_rotation, double* position, double* rotation) noexcept {
    fg::mounted_pose({pose, 3}, {pose + 3, 4}, level != 0, {offset_position, 3}, {offset_rotation, 3, 3},
                     {position, 3}, {rotation, 3, 3});
}
