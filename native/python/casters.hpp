// How arrays of numpy become Row, Table and Cube, without a copy. An array of another type, or one that would have to be
// copied, is refused with a TypeError: nanobind would else hand over a copy, and what is written to it would be lost.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "../core/arrays.hpp"

NAMESPACE_BEGIN(NB_NAMESPACE)
NAMESPACE_BEGIN(detail)

template <class View, class T, int Axes>
struct view_caster {
    using Array = ndarray<T, ndim<Axes>, c_contig, device::cpu>;
    using Caster = make_caster<Array>;
    static constexpr auto Name = Caster::Name;
    template <class U> using Cast = View;
    template <class U> static constexpr bool can_cast() { return true; }

    bool from_python(handle source, uint8_t flags, cleanup_list* cleanup) noexcept {
        Caster caster;
        if (!caster.from_python(source, flags & ~(uint8_t) cast_flags::convert, cleanup)) return false;
        const Array& array = caster.value;
        const auto length = [&](std::size_t i) { return (std::int64_t) array.shape(i); };
        if constexpr (Axes == 1) view = {array.data(), length(0)};
        else if constexpr (Axes == 2) view = {array.data(), length(0), length(1)};
        else view = {array.data(), length(0), length(1), length(2)};
        return true;
    }
    explicit operator View() { return view; }
    View view;
};

template <class T> requires(!std::is_class_v<T>)
struct type_caster<fg::Row<T>> : view_caster<fg::Row<T>, T, 1> {};
template <class T> struct type_caster<fg::Table<T>> : view_caster<fg::Table<T>, T, 2> {};
template <class T> struct type_caster<fg::Cube<T>> : view_caster<fg::Cube<T>, T, 3> {};

NAMESPACE_END(detail)
NAMESPACE_END(NB_NAMESPACE)
