// Rings of what was seen.
#include "observer.hpp"

#include <algorithm>

namespace fg {

void shift(Row<const bool> which, Row<const bool> fresh, Table<float> frame, Cube<float> delayed,
           Row<const std::int64_t> delays) {
    for (std::int64_t i = 0; i < which.length; ++i) {
        const Row<float> own = frame[i];
        const Table<float> ring = delayed[i];
        if (which[i]) {
            for (std::int64_t tick = ring.rows - 1; tick > 0; --tick)
                std::copy_n(fresh[i] ? own.data : ring[tick - 1].data, own.length, ring[tick].data);
            std::copy_n(own.data, own.length, ring[0].data);
        }
        for (std::int64_t k = 0; k < own.length; ++k) own[k] = ring[delays[k]][k];
    }
}

void scale(Row<const bool> which, Row<const float> scales, Row<const bool> saturates, Table<float> frame) {
    for (std::int64_t i = 0; i < which.length; ++i) {
        if (!which[i]) continue;
        const Row<float> own = frame[i];
        for (std::int64_t k = 0; k < own.length; ++k)
            own[k] = saturates[k] ? own[k] / (1.0F + own[k]) : own[k] * scales[k];
    }
}

void remember(Row<const bool> which, Row<const bool> fresh, Table<const float> frame, Row<const std::int64_t> columns,
              Cube<float> ring, Row<std::int64_t> last) {
    for (std::int64_t i = 0; i < which.length; ++i) {
        if (!which[i]) continue;
        last[i] = (last[i] + 1) % ring.rows;
        const std::int64_t first = fresh[i] ? 0 : last[i], behind = fresh[i] ? ring.rows : last[i] + 1;
        for (std::int64_t place = first; place < behind; ++place)
            for (std::int64_t k = 0; k < columns.length; ++k) ring[i][place][k] = frame[i][columns[k]];
    }
}

void recall(Cube<const float> ring, Row<const std::int64_t> last, std::int64_t every, Cube<float> found) {
    for (std::int64_t i = 0; i < ring.length; ++i) {
        for (std::int64_t step = 0; step < found.rows; ++step) {
            const Row<const float> place = ring[i][(last[i] + 1 + step * every) % ring.rows];
            std::copy_n(place.data, found.columns, found[i][step].data);
        }
    }
}

}  // namespace fg
