// A table of arrays, as fg_mujoco/native_arrays.py makes it: for each array its address, and its length along up
// to three axes.
#pragma once
#include "arrays.hpp"

namespace fg {

struct ArrayPlace {
    std::int64_t address, lengths[3];

    template <class T> Row<T> row() const { return {reinterpret_cast<T*>(address), lengths[0]}; }
    template <class T> Table<T> table() const { return {reinterpret_cast<T*>(address), lengths[0], lengths[1]}; }
    template <class T> Cube<T> cube() const {
        return {reinterpret_cast<T*>(address), lengths[0], lengths[1], lengths[2]};
    }
};

inline Row<const ArrayPlace> table_at(std::int64_t address, std::int64_t count) {
    return {reinterpret_cast<const ArrayPlace*>(address), count};
}

}  // namespace fg
