// Views of contiguous arrays: Row has one axis, Table two, Cube three. They own nothing.
// In a build with FG_CHECK_BOUNDS an index out of range throws, which Python sees as an IndexError. Other builds do not
// look at indices.
#pragma once
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <utility>

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
    operator Row<const T>() const requires(!std::is_const_v<T>) { return {data, length}; }
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

    operator Table<const T>() const requires(!std::is_const_v<T>) { return {data, rows, columns}; }
    Row<T> operator[](std::int64_t i) const {
        check(i, rows);
        return {data + i * columns, columns};
    }
};

template <class T>
struct Cube {
    T* data = nullptr;
    std::int64_t length = 0, rows = 0, columns = 0;

    operator Cube<const T>() const requires(!std::is_const_v<T>) { return {data, length, rows, columns}; }
    Table<T> operator[](std::int64_t i) const {
        check(i, length);
        return {data + i * rows * columns, rows, columns};
    }
};

// The arrays of a record.
template <class T, std::size_t Length> Row<T> row(T (&array)[Length]) { return {array, Length}; }
template <class T, std::size_t Rows, std::size_t Columns> Table<T> table(T (&array)[Rows][Columns]) {
    return {&array[0][0], Rows, Columns};
}

// Arrays of a function's own, zero at the beginning.
template <class T>
class OwnRow {
public:
    explicit OwnRow(std::int64_t length) : data_(new T[length]()), length_(length) {}
    // One whose elements have no values yet.
    static OwnRow unset(std::int64_t length) { return {std::make_unique_for_overwrite<T[]>(length), length}; }
    operator Row<T>() const { return {data_.get(), length_}; }
    operator Row<const T>() const { return {data_.get(), length_}; }
    T& operator[](std::int64_t i) const { return Row<T>(*this)[i]; }

private:
    OwnRow(std::unique_ptr<T[]> data, std::int64_t length) : data_(std::move(data)), length_(length) {}

    std::unique_ptr<T[]> data_;
    std::int64_t length_;
};

template <class T>
class OwnTable {
public:
    OwnTable(std::int64_t rows, std::int64_t columns) : data_(new T[rows * columns]()), rows_(rows), columns_(columns) {}
    operator Table<T>() const { return {data_.get(), rows_, columns_}; }
    operator Table<const T>() const { return {data_.get(), rows_, columns_}; }
    Row<T> operator[](std::int64_t i) const { return Table<T>(*this)[i]; }

private:
    std::unique_ptr<T[]> data_;
    std::int64_t rows_, columns_;
};

using Numbers = Row<const double>;
using Matrix = Table<const double>;

}  // namespace fg
