// Binds native/lidar/point_cloud.hpp. Shapes that do not fit together are refused with a ValueError.
#include "../lidar/point_cloud.hpp"

#include "bindings.hpp"
#include "casters.hpp"
#include "record_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace fg {
namespace {

struct CheckedCloudScene : CloudScene {};
struct CheckedPattern : Pattern {};

void checked_bursts(const CheckedCloudScene& scene, const CheckedPattern& pattern, std::int64_t joint,
                    Numbers offset_position, Matrix offset_rotation, std::int64_t tree, Row<const Link> links,
                    Numbers before, Numbers after, Numbers shares, Cube<const double> placed, std::int64_t first,
                    Cube<double> out) {
    const std::int64_t bursts = shares.length, moving = scene.frames.rows - 1;
    require(offset_position.length == 3 && offset_rotation.rows == 3 && offset_rotation.columns == 3 && 0 <= joint &&
                joint + 7 <= after.length && before.length == after.length,
            "the LiDAR is not mounted on a free joint of this state");
    require(first >= 0 && out.length == bursts && out.rows == LINES * COLUMNS && out.columns == 4 &&
                placed.length == bursts && placed.rows <= moving && placed.columns == 3,
            "the arrays of the bursts are not (n,), (n, k, 3) and (n, 500, 4)");
    for (int i = 0; i < links.size(); ++i)
        require(links[i].frame < moving - placed.rows && links[i].parent < i && links[i].qpos < after.length,
                "a link is of a body or a state that is not there");
    cast_bursts(scene, pattern, {joint, tree, offset_position, offset_rotation}, links, before, after, shares, placed,
                first, out);
}

}  // namespace

void bind_point_cloud(nb::module_& module) {
    nb::class_<CheckedCloudScene>(module, "CloudScene")
        .def("__init__",
             [](CheckedCloudScene* self, Matrix vertices, Table<const std::uint16_t> triangles, Matrix boxes,
                Table<const std::int32_t> spans, Matrix planes, Table<const std::int32_t> frames, Matrix shapes,
                Matrix spheres, Matrix materials) {
                 new (self) CheckedCloudScene{
                     {vertices, triangles, boxes, spans, planes, frames, shapes, spheres, materials}};
                 self->check_layout();
             },
             "vertices"_a, "triangles"_a, "boxes"_a, "spans"_a, "planes"_a, "frames"_a, "shapes"_a, "spheres"_a,
             "materials"_a, nb::keep_alive<1, 2>(), nb::keep_alive<1, 3>(), nb::keep_alive<1, 4>(),
             nb::keep_alive<1, 5>(), nb::keep_alive<1, 6>(), nb::keep_alive<1, 7>(), nb::keep_alive<1, 8>(),
             nb::keep_alive<1, 9>(), nb::keep_alive<1, 10>());
    nb::class_<CheckedPattern>(module, "Pattern")
        .def("__init__",
             [](CheckedPattern* self, Matrix columns, Matrix elevations, std::int64_t cycle, double blind) {
                 new (self) CheckedPattern{{columns, elevations, cycle, blind}};
                 self->check_layout();
             },
             "columns"_a, "elevations"_a, "cycle"_a, "blind"_a, nb::keep_alive<1, 2>(), nb::keep_alive<1, 3>());
    module.def("cast_bursts", &checked_bursts, "scene"_a, "pattern"_a, "joint"_a, "offset_position"_a,
               "offset_rotation"_a, "tree"_a, "links"_a, "before"_a, "after"_a, "shares"_a, "placed"_a, "first"_a,
               "out"_a, nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace fg
