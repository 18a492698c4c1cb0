// Checks that the arrays of a scene fit together. A scan itself checks no index.
#include "scene.hpp"

namespace fg {
namespace {

constexpr int SHAPE = 19;  // numbers of a round shape, see fg_mujoco/lidar/visible_surfaces.py

bool is_span(std::int64_t first, std::int64_t behind, std::int64_t length) {
    return 0 <= first && first <= behind && behind <= length;
}

}  // namespace

void Scene::check_beams() const {
    require(beams.rows == 2 && limits.length == 4, "beams is not (2, n), or limits is not (4,)");
    require(angle_increment() > 0.0 && range_max() > 0.0, "limits has an increment or a greatest range that is not positive");
}

void Scene::check_layout() const {
    check_beams();
    require((edges.rows == 6 || edges.rows == 3) && triangles.columns == 3,
            "edges is not (6, e) nor (3, v), or triangles is not (t, 3)");
    require(boxes.rows == 9 && spans.columns == 5 && boxes.columns == spans.rows,
            "boxes and spans are not (9, b) and (b, 5)");
    require(planes.columns == 15 && shapes.columns == SHAPE, "planes is not (p, 15), or shapes is not (k, 19)");
    require(frames.rows > 0 && frames.columns == 7 && spheres.rows == frames.rows && spheres.columns == 4,
            "frames and spheres are not (f, 7) and (f, 4)");
    for (std::int64_t frame = 0; frame < frames.rows; ++frame) {
        const auto parts = frames[frame];
        require(is_span(parts[0], parts[1], spans.rows) && is_span(parts[2], parts[3], planes.rows) &&
                    is_span(parts[4], parts[5], shapes.rows),
                "a frame has clusters, planes or shapes that are not there");
    }
    for (std::int64_t cluster = 0; cluster < spans.rows; ++cluster) {
        const auto span = spans[cluster];
        require(is_span(span[0], span[1], edges.columns) && is_span(span[2], span[3], triangles.rows) &&
                    0 <= span[4] && span[4] < frames.rows,
                "a cluster has edges, triangles or a frame that are not there");
        for (std::int64_t triangle = span[2]; triangle < span[3]; ++triangle)
            for (int side = 0; side < 3; ++side)
                require(triangles[triangle][side] < span[1] - span[0], "a triangle has an edge that is not there");
    }
}

void Scene::check_materials(std::int64_t count) const {
    const auto check = [&](double material) {
        require(0.0 <= material && material < static_cast<double>(count), "a surface has a material that is not there");
    };
    for (std::int64_t i = 0; i < boxes.columns; ++i) check(boxes[8][i]);
    for (std::int64_t i = 0; i < planes.rows; ++i) check(planes[i][14]);
    for (std::int64_t i = 0; i < shapes.rows; ++i) check(shapes[i][18]);
}

void Scratch::check_room(const Scene& scene) const {
    std::int64_t longest = 0;
    for (std::int64_t cluster = 0; cluster < scene.spans.rows; ++cluster)
        longest = max(longest, std::int64_t{scene.spans[cluster][1] - scene.spans[cluster][0]});
    require(scene.edges.rows == 6 && cuts.rows == 2 && cuts.columns >= longest && columns.length >= longest &&
                nearest.length == scene.spans.rows && views.rows == 3 && views.columns == scene.spans.rows &&
                bins.length == BINS + 1 && poses.rows == scene.frames.rows && poses.columns == 12,
            "the scratch arrays are not those of this scene");
}

}  // namespace fg
