// A scanline z-buffer: all beams leave one point in one plane, so the scan is a picture of one row.
#pragma once
#include "scene.hpp"

namespace fg {

// What a LiDAR makes of what its beams meet.
struct Optics {
    double through_cars = 0.0;  // share of the beams that pass through the bodies of other cars, but for their boxes
    double glancing = 0.0;      // sine of the angle to the floor below which a beam does not come back
};
constexpr double as_optics_say = -1.0;  // the porosity of a car's body, AS_OPTICS_SAY

// Write the readings of one scan: distances [m], +inf from range_max on, -inf below range_min (REP 117).
//   position, rotation: (3,) [m] and (3, 3) of the LiDAR, into the world's frame.
//   moving_positions, moving_rotations: (m, 3) [m] and (m, 3, 3) of the bodies that the frames behind the first follow.
//   out: (beams,) [m], written to.
//   own_tree: root body of the car that carries the LiDAR, of which it sees nothing; -1: there is none.
void scan(const Scene& scene, const Scratch& scratch, Numbers position, Matrix rotation, Matrix moving_positions,
          Cube<const double> moving_rotations, Row<double> out, int own_tree, const Optics& optics = {});

}  // namespace fg
