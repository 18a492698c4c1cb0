// Views of contiguous arrays: Row has one axis, Table two, Cube three. They own nothing.
// In a build with FG_CHECK_BOUNDS an index out of range throws, which Python sees as an IndexError. Other builds do not
// look at indices.
#pragma once
#include <cstdint>
#include <stdexcept>

namespace fg {

#ifdef FG_CHECK_BOUNDS
inline void check(std::int64_t index, std::int64_t length) {
    if (index < 0 || index >= length) throw std::out_of_range("index out of range");
}
#else
inline void check(std::int64_t, std::int64_t) {}
#endif

// Throw what Python sees as a ValueError unless arrays fit together.
inline void require(bool holds, const char* message) {
    if (!holds) throw std::invalid_argument(message);
}

template <class T>
struct Row {
    T* data = nullptr;
    std::int64_t length = 0;

    int size() const { return static_cast<int>(length); }
    T& operator[](std::int64_t i) const {
        check(i, length);
        return data[i];
    }
    // The elements from `first` to the one before `behind`.
    Row part(std::int64_t first, std::int64_t behind) const {
        if (first < behind) check(first, length), check(behind - 1, length);
        return {data + first, behind - first};
    }
};

template <class T>
struct Table {
    T* data = nullptr;
    std::int64_t rows = 0, columns = 0;

    Row<T> operator[](std::int64_t i) const {
        check(i, rows);
        return {data + i * columns, columns};
    }
};

template <class T>
struct Cube {
    T* data = nullptr;
    std::int64_t length = 0, rows = 0, columns = 0;

    Table<T> operator[](std::int64_t i) const {
        check(i, length);
        return {data + i * rows * columns, rows, columns};
    }
};

using Numbers = Row<const double>;
using Matrix = Table<const double>;

}  // namespace fg
