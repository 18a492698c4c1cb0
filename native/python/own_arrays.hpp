// How arrays that a function of the native core made become arrays of numpy, without a copy.
#pragma once
#include <array>
#include <memory>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "../core/arrays.hpp"

namespace fg {

// Return an array of numpy of elements that `own` has, which is kept as long as it.
template <class Own, class T, std::size_t Axes>
nanobind::ndarray<nanobind::numpy, T, nanobind::ndim<Axes>> owned(Own own, T* data,
                                                                  std::array<std::int64_t, Axes> lengths) {
    auto kept = std::make_unique<Own>(std::move(own));
    const nanobind::capsule owner(kept.get(), [](void* of) noexcept { delete static_cast<Own*>(of); });
    kept.release();
    std::array<std::size_t, Axes> shape;
    for (std::size_t axis = 0; axis < Axes; ++axis) shape[axis] = static_cast<std::size_t>(lengths[axis]);
    return {data, Axes, shape.data(), owner};
}

template <class T> auto to_numpy(OwnRow<T>&& own) {
    const Row<T> row = own;
    return owned(std::move(own), row.data, std::array{row.length});
}

template <class T> auto to_numpy(OwnTable<T>&& own) {
    const Table<T> table = own;
    return owned(std::move(own), table.data, std::array{table.rows, table.columns});
}

}  // namespace fg
