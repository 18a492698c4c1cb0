// A scan as a function in C, for tests of builds without Python. The arrays of a scene and its scratch arrays come as the
// rows of an array table. Nothing is checked here; an index out of range in a build with FG_CHECK_BOUNDS ends the process.
#include "../core/array_table.hpp"
#include "scanline.hpp"

#if defined(_WIN32)
#define FG_EXPORTED extern "C" __declspec(dllexport)
#else
#define FG_EXPORTED extern "C" __attribute__((visibility("default")))
#endif

// See `scan`; `out` has as many numbers as the scene has beams, and as many bodies move as it has frames but the first.
FG_EXPORTED void fg_scan(const fg::ArrayPlace* scene_rows, const fg::ArrayPlace* scratch_rows, const double* position,
                         const double* rotation, const double* moving_positions, const double* moving_rotations,
                         double* out, std::int64_t own_tree) noexcept {
    const fg::Scene scene = fg::scene_of({scene_rows, fg::scene_arrays});
    const std::int64_t moving = scene.frames.rows - 1;
    fg::scan(scene, fg::scratch_of({scratch_rows, fg::scratch_arrays}), {position, 3}, {rotation, 3, 3}, {moving_positions, moving, 3},
             {moving_rotations, moving, 3, 3}, {out, scene.beams.columns}, static_cast<int>(own_tree));
}
