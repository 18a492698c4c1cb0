// Makes observations of some cars from what their sensors read, from step to step.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"

namespace fg {

// Put a tick's frames (n, width) into their rings (n, ticks, width), newest first; write to them those `delays` (width,)
// ticks old.
void shift(Row<const bool> which, Row<const bool> fresh, Table<float> frame, Cube<float> delayed,
           Row<const std::int64_t> delays);

// Scale the frames (n, width). Where `saturates` (width,) is set, x becomes x / (1 + x), without a scale.
void scale(Row<const bool> which, Row<const float> scales, Row<const bool> saturates, Table<float> frame);

// Write some columns of the frames (n, all) to the rings (n, places, width); the first one fills all places.
void remember(Row<const bool> which, Row<const bool> fresh, Table<const float> frame, Row<const std::int64_t> columns,
              Cube<float> ring, Row<std::int64_t> last);

// Write to `found` (n, length, width) what the rings (n, places, width) have, the oldest first.
void recall(Cube<const float> ring, Row<const std::int64_t> last, std::int64_t every, Cube<float> found);

}  // namespace fg
