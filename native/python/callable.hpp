// How functions of the native core become functions of Python: records are taken as Held, arrays that a function made
// become arrays of numpy, and pairs become tuples.
#pragma once
#include <array>
#include <tuple>
#include <type_traits>

#include <nanobind/stl/tuple.h>

#include "own_arrays.hpp"
#include "record_casters.hpp"

namespace fg {

template <class T> struct FromPython { using Type = T; };
template <class Record> requires std::is_class_v<Record> && std::is_trivially_default_constructible_v<Record>
struct FromPython<Record&> { using Type = Held<Record>; };

template <class T> T to_python(T result) { return result; }
template <class T, std::size_t N> auto to_python(const std::array<T, N>& result) { return std::tuple_cat(result); }
template <class T> auto to_python(OwnRow<T>&& own) { return to_numpy(std::move(own)); }
template <class T> auto to_python(OwnTable<T>&& own) { return to_numpy(std::move(own)); }

template <class Result, class... Arguments>
auto callable(Result (*function)(Arguments...)) {
    return [function](typename FromPython<Arguments>::Type... arguments) {
        if constexpr (std::is_void_v<Result>) function(arguments...);
        else return to_python(function(arguments...));
    };
}

}  // namespace fg
