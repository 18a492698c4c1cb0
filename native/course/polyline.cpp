// A pair of boxes is looked at only where the box around the second and its neighbours overlaps the first.
#include "polyline.hpp"

#include "../core/numbers.hpp"

namespace fg {
namespace {

constexpr std::int64_t block_size = 32;  // consecutive segments that share one bounding box

}  // namespace

std::int64_t overlaps(const Boxes& boxes, Row<std::int64_t> found_first, Row<std::int64_t> found_second) {
    const auto& [low, high, other_low, other_high, blocks_low, blocks_high] = boxes;
    std::int64_t count = 0;
    for (std::int64_t i = 0; i < low.rows; ++i) {
        const double left = low[i][0], bottom = low[i][1], right = high[i][0], top = high[i][1];
        for (std::int64_t block = 0; block < blocks_low.rows; ++block) {
            if (blocks_low[block][0] > right || blocks_high[block][0] < left) continue;
            if (blocks_low[block][1] > top || blocks_high[block][1] < bottom) continue;
            const std::int64_t behind = min((block + 1) * block_size, other_low.rows);
            for (std::int64_t j = block * block_size; j < behind; ++j) {
                const bool across = other_low[j][0] <= right && other_high[j][0] >= left;
                if (!across || !(other_low[j][1] <= top && other_high[j][1] >= bottom)) continue;
                if (count < found_first.length) found_first[count] = i, found_second[count] = j;
                ++count;
            }
        }
    }
    return count;
}

}  // namespace fg
