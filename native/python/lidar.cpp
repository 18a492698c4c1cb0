// Binds native/lidar. Shapes that do not fit together are refused with a ValueError.
#include "bindings.hpp"

#include <string>

#include "../lidar/body_poses.hpp"
#include "../lidar/links.hpp"
#include "../lidar/point_cloud.hpp"
#include "../lidar/scan_effects.hpp"
#include "../lidar/scanline.hpp"
#include "casters.hpp"
#include "record_casters.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using WithoutGil = nb::call_guard<nb::gil_scoped_release>;

namespace fg {
namespace {

bool are_poses(std::int64_t count, std::int64_t position_rows, std::int64_t position_columns,
               const Cube<const double>& rotations) {
    return position_rows == count && position_columns == 3 && rotations.length == count && rotations.rows == 3 &&
           rotations.columns == 3;
}

bool is_three_by_three(const Matrix& rotation) { return rotation.rows == 3 && rotation.columns == 3; }

Cube<const double> read_only(const Cube<double>& cube) { return {cube.data, cube.length, cube.rows, cube.columns}; }

// A scene whose arrays fit together, which every later scan relies on.
struct CheckedScene : Scene {
    CheckedScene(Matrix beams, Numbers limits, Matrix edges, Table<const std::uint16_t> triangles, Matrix boxes,
                 Table<const std::int32_t> spans, Matrix planes, Table<const std::int32_t> frames, Matrix shapes,
                 Matrix spheres)
        : Scene{beams, limits, edges, triangles, boxes, spans, planes, frames, shapes, spheres} {
        check_layout();
    }

    CheckedScene along(Matrix other_beams, Numbers other_limits) const {
        CheckedScene other = *this;
        other.beams = other_beams, other.limits = other_limits;
        other.check_beams();
        return other;
    }
};

void checked_scan(const CheckedScene& scene, const Scratch& scratch, Numbers position, Matrix rotation,
                  Matrix moving_positions, Cube<const double> moving_rotations, Row<double> out, int own_tree,
                  const Optics& optics = {}) {
    require(out.length == scene.beams.columns, "out has not as many numbers as the scene has beams");
    require(position.length == 3 && is_three_by_three(rotation), "the LiDAR's pose is not (3,) and (3, 3)");
    require(are_poses(scene.frames.rows - 1, moving_positions.rows, moving_positions.columns, moving_rotations),
            "the poses are not (m, 3) and (m, 3, 3) of the m bodies that move");
    scratch.check_room(scene);
    scan(scene, scratch, position, rotation, moving_positions, moving_rotations, out, own_tree, optics);
}

void scan_poses(const CheckedScene& scene, const Scratch& scratch, Matrix positions, Cube<const double> rotations,
                Numbers optics, Row<double> out) {
    require(optics.length == 2, "optics is not (2,)");
    require(are_poses(scene.frames.rows, positions.rows, positions.columns, rotations),
            "the poses are not those of the LiDAR and of the bodies that move");
    const std::int64_t moving = positions.rows - 1;
    checked_scan(scene, scratch, positions[0], rotations[0], {positions.data + 3, moving, 3},
                 {rotations.data + 9, moving, 3, 3}, out, -1, {optics[0], optics[1]});
}

void checked_bursts(const CheckedScene& scene, Matrix elevations, Matrix materials, std::int64_t joint,
                    Numbers offset_position, Matrix offset_rotation, std::int64_t tree, Row<const Link> links,
                    Numbers before, Numbers after, Numbers shares, Cube<const double> placed, std::int64_t first,
                    Cube<double> out) {
    const std::int64_t bursts = shares.length, moving = scene.frames.rows - 1;
    require(scene.edges.rows == 3 && scene.beams.columns == LINES * COLUMN_ROOM && elevations.rows == 2 &&
                elevations.columns > COLUMN_ROOM && materials.columns == 2,
            "the arrays of points are not (3, v), (2, 512), (2, cycle + 128) and (m, 2)");
    scene.check_materials(materials.rows);
    require(offset_position.length == 3 && is_three_by_three(offset_rotation) && 0 <= joint &&
                joint + 7 <= after.length && before.length == after.length,
            "the LiDAR is not mounted on a free joint of this state");
    require(first >= 0 && out.length == bursts && out.rows == LINES * COLUMNS && out.columns == 4 &&
                placed.length == bursts && placed.rows <= moving && placed.columns == 3,
            "the arrays of the bursts are not (n,), (n, k, 3) and (n, 500, 4)");
    for (int i = 0; i < links.size(); ++i)
        require(links[i].frame < moving - placed.rows && links[i].parent < i && links[i].qpos < after.length,
                "a link is of a body or a state that is not there");
    cast_bursts(scene, elevations, materials, {joint, tree, offset_position, offset_rotation}, links, before, after,
                shares, placed, first, out);
}

void check_poses(const Poses& poses) {
    const std::int64_t count = poses.sources.rows;
    require(poses.sources.columns == 2 &&
                are_poses(count, poses.offset_positions.rows, poses.offset_positions.columns, poses.offset_rotations) &&
                are_poses(count, poses.positions.rows, poses.positions.columns, read_only(poses.rotations)),
            "the arrays of poses are not (m, 2), (m, 3), (m, 3, 3), (m, 3) and (m, 3, 3)");
}

void checked_read_poses(const Poses& poses, const State& state) {
    require(state.mocap_pos.columns == 3 && state.mocap_quat.columns == 4 && state.xpos.columns == 3 &&
                state.xmat.columns == 9,
            "the arrays of the state are not those of a mujoco.MjData");
    for (std::int64_t i = 0; i < poses.sources.rows; ++i) {
        const std::int64_t kind = poses.sources[i][0], place = poses.sources[i][1];
        const std::int64_t behind = kind == 2 ? min(state.xpos.rows, state.xmat.rows)
                                  : kind == 1 ? min(state.mocap_pos.rows, state.mocap_quat.rows)
                                              : state.qpos.length - 6;
        require(0 <= place && place < behind, "a pose follows from what the state has not");
    }
    read_poses(poses, state);
}

void checked_effects(const Effects& effects, Row<const std::int64_t> rows, Table<double> ranges) {
    const std::int64_t count = effects.states.rows, beams = ranges.columns;
    require(effects.states.columns == 4 && ranges.rows == count && effects.deviations.length == count &&
                effects.dropouts.length == count && effects.no_returns.length == count &&
                effects.lates.length == count && effects.sweeps.length == count && effects.held.length == count &&
                effects.table_of.length == count && effects.noise.length == beams && effects.shares.length == beams &&
                effects.held.columns == beams,
            "the arrays of the effects are not those of these rows and beams");
    require(effects.values.columns == 3 && effects.values.rows == effects.knots.rows * effects.knots.columns * beams,
            "the tables of errors are not those of these beams");
    for (int k = 0; k < rows.size(); ++k) {
        require(0 <= rows[k] && rows[k] < count, "a row is not there");
        require(effects.lates[rows[k]] <= effects.held.rows, "there is no room for the sweeps that are held back");
        require(effects.table_of[rows[k]] < effects.knots.rows, "a table of errors is not there");
    }
    apply_effects(effects, rows, ranges);
}

void check_state(Row<std::int64_t> state) { require(state.length == 4, "the state is not (4,)"); }

void check_ziggurat(const Ziggurat& ziggurat) {
    require(ziggurat.limits.length == 256 && ziggurat.widths.length == 256 && ziggurat.heights.length == 256,
            "the layers of the ziggurat are not 256");
}

nb::dict link_fields() {
    nb::dict fields;
    const auto add = [&](const char* name, std::size_t offset) { fields[name] = offset; };
    add("parent", offsetof(Link, parent)), add("kind", offsetof(Link, kind)), add("qpos", offsetof(Link, qpos));
    add("qpos0", offsetof(Link, qpos0)), add("place", offsetof(Link, place)), add("turn", offsetof(Link, turn));
    add("axis", offsetof(Link, axis)), add("anchor", offsetof(Link, anchor)), add("frame", offsetof(Link, frame));
    return fields;
}

}  // namespace

void bind_scan(nb::module_& module) {
    nb::class_<CheckedScene>(module, "Scene")
        .def(nb::init<Matrix, Numbers, Matrix, Table<const std::uint16_t>, Matrix, Table<const std::int32_t>, Matrix,
                      Table<const std::int32_t>, Matrix, Matrix>(),
             "beams"_a, "limits"_a, "edges"_a, "triangles"_a, "boxes"_a, "spans"_a, "planes"_a, "frames"_a,
             "shapes"_a, "spheres"_a, nb::keep_alive<1, 2>(), nb::keep_alive<1, 3>(), nb::keep_alive<1, 4>(),
             nb::keep_alive<1, 5>(), nb::keep_alive<1, 6>(), nb::keep_alive<1, 7>(), nb::keep_alive<1, 8>(),
             nb::keep_alive<1, 9>(), nb::keep_alive<1, 10>(), nb::keep_alive<1, 11>())
        .def("along", &CheckedScene::along, "beams"_a, "limits"_a, nb::keep_alive<0, 1>(), nb::keep_alive<0, 2>(),
             nb::keep_alive<0, 3>());
    nb::class_<Scratch>(module, "Scratch")
        .def("__init__",
             [](Scratch* self, Table<double> cuts, Row<std::int32_t> columns, Row<double> nearest,
                Table<std::int32_t> views, Row<std::int32_t> bins, Table<double> poses) {
                 new (self) Scratch{cuts, columns, nearest, views, bins, poses};
             },
             "cuts"_a, "columns"_a, "nearest"_a, "views"_a, "bins"_a, "poses"_a, nb::keep_alive<1, 2>(),
             nb::keep_alive<1, 3>(), nb::keep_alive<1, 4>(), nb::keep_alive<1, 5>(), nb::keep_alive<1, 6>(),
             nb::keep_alive<1, 7>());
    nb::class_<Poses>(module, "Poses")
        .def("__init__",
             [](Poses* self, Table<const std::int32_t> sources, Matrix offset_positions,
                Cube<const double> offset_rotations, Table<double> positions, Cube<double> rotations) {
                 new (self) Poses{sources, offset_positions, offset_rotations, positions, rotations};
                 check_poses(*self);
             },
             "sources"_a, "offset_positions"_a, "offset_rotations"_a, "positions"_a, "rotations"_a,
             nb::keep_alive<1, 2>(), nb::keep_alive<1, 3>(), nb::keep_alive<1, 4>(), nb::keep_alive<1, 5>(),
             nb::keep_alive<1, 6>());
    module.def("scan",
               [](const CheckedScene& scene, const Scratch& scratch, Numbers position, Matrix rotation,
                  Matrix moving_positions, Cube<const double> moving_rotations, Row<double> out, int own_tree) {
                   checked_scan(scene, scratch, position, rotation, moving_positions, moving_rotations, out, own_tree);
               },
               "scene"_a, "scratch"_a, "position"_a, "rotation"_a, "moving_positions"_a,
               "moving_rotations"_a, "out"_a, "own_tree"_a, WithoutGil());
    module.def("scan_poses", &scan_poses, "scene"_a, "scratch"_a, "positions"_a, "rotations"_a, "optics"_a,
               "out"_a, WithoutGil());
    module.def("scan_state",
               [](const CheckedScene& scene, const Scratch& scratch, const Poses& poses, Numbers qpos, Matrix mocap_pos,
                  Matrix mocap_quat, Matrix xpos, Matrix xmat, Numbers optics, Row<double> out) {
                   checked_read_poses(poses, {qpos, mocap_pos, mocap_quat, xpos, xmat});
                   scan_poses(scene, scratch, {poses.positions.data, poses.positions.rows, 3},
                              read_only(poses.rotations), optics, out);
               },
               "scene"_a, "scratch"_a, "poses"_a, "qpos"_a, "mocap_pos"_a, "mocap_quat"_a, "xpos"_a, "xmat"_a,
               "optics"_a, "out"_a,
               WithoutGil());
    module.def("cast_bursts", &checked_bursts, "scene"_a, "elevations"_a, "materials"_a, "joint"_a,
               "offset_position"_a, "offset_rotation"_a, "tree"_a, "links"_a, "before"_a, "after"_a, "shares"_a,
               "placed"_a, "first"_a, "out"_a, WithoutGil());
}

void bind_poses(nb::module_& module) {
    module.def("read_poses",
               [](const Poses& poses, Numbers qpos, Matrix mocap_pos, Matrix mocap_quat, Matrix xpos, Matrix xmat) {
                   checked_read_poses(poses, {qpos, mocap_pos, mocap_quat, xpos, xmat});
               },
               "poses"_a, "qpos"_a, "mocap_pos"_a, "mocap_quat"_a, "xpos"_a, "xmat"_a, WithoutGil());
    module.def("mounted_pose",
               [](Numbers pose, bool level, Numbers offset_position, Matrix offset_rotation, Row<double> position,
                  Table<double> rotation) {
                   require(pose.length == 7 && offset_position.length == 3 && is_three_by_three(offset_rotation) &&
                               position.length == 3 && rotation.rows == 3 && rotation.columns == 3,
                           "the arrays of a pose are not (7,), (3,), (3, 3), (3,) and (3, 3)");
                   mounted_pose(pose.part(0, 3), pose.part(3, 7), level, offset_position, offset_rotation, position,
                                rotation);
               },
               "pose"_a, "level"_a, "offset_position"_a, "offset_rotation"_a, "position"_a, "rotation"_a);
    module.def("link_fields", &link_fields);
}

void bind_effects(nb::module_& module) {
    module.def("draw_shares",
               [](Row<std::int64_t> state, Row<double> out) {
                   check_state(state);
                   draw_shares(state, out);
               },
               "state"_a, "out"_a, WithoutGil());
    module.def("draw_normals",
               [](Row<std::int64_t> state, Row<const std::int64_t> limits, Numbers widths, Numbers heights,
                  Row<double> out) {
                   check_state(state);
                   check_ziggurat({limits, widths, heights});
                   draw_normals(state, {limits, widths, heights}, out);
               },
               "state"_a, "limits"_a, "widths"_a, "heights"_a, "out"_a, WithoutGil());
    module.def("apply_effects",
               [](Row<const std::int64_t> rows, Table<double> ranges, Table<std::int64_t> states,
                  Row<const std::int64_t> limits, Numbers widths, Numbers heights, Numbers deviations,
                  Row<double> noise, Numbers dropouts, Row<double> shares, Numbers no_returns,
                  Row<const std::int64_t> lates, Row<std::int64_t> sweeps, Cube<double> held,
                  Row<const std::int64_t> table_of, Matrix knots, Matrix values, double range_min, double range_max) {
                   check_ziggurat({limits, widths, heights});
                   checked_effects({states, {limits, widths, heights}, deviations, dropouts, no_returns, noise, shares,
                                    lates, sweeps, held, table_of, knots, values, range_min, range_max},
                                   rows, ranges);
               },
               "rows"_a, "ranges"_a, "states"_a, "limits"_a, "widths"_a, "heights"_a, "deviations"_a, "noise"_a,
               "dropouts"_a, "shares"_a, "no_returns"_a, "lates"_a, "sweeps"_a, "held"_a, "table_of"_a, "knots"_a,
               "values"_a, "range_min"_a, "range_max"_a, WithoutGil());
    module.def("add_noise",
               [](Numbers ranges, double deviation, double range_max, Row<double> noise) {
                   require(ranges.length == noise.length, "ranges and noise are not equally long");
                   add_noise(ranges, deviation, range_max, noise);
               },
               "ranges"_a, "deviation"_a, "range_max"_a, "noise"_a, WithoutGil());
    module.def("error_at",
               [](Numbers knots, Matrix values, int which, double distance) {
                   require(knots.length > 0 && values.rows == knots.length && values.columns == 3 && 0 <= which &&
                               which < 3,
                           "knots is not (k,), values is not (k, 3), or which is not 0 to 2");
                   return error_at(knots, values, which, distance);
               },
               "knots"_a, "values"_a, "which"_a, "distance"_a);
}

void bind_lidar(nb::module_& module) {
    bind_scan(module);
    bind_poses(module);
    bind_effects(module);
}

}  // namespace fg
