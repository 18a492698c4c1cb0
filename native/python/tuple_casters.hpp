// How named tuples of Python become structures: field by field, in their order, each by its own caster.
#pragma once
#include <tuple>
#include <utility>

#include "record_casters.hpp"

NAMESPACE_BEGIN(NB_NAMESPACE)
NAMESPACE_BEGIN(detail)

// Of a structure whose fields, in their order, are made from what these casters return.
template <class Struct, class... Fields>
struct tuple_caster {
    static constexpr auto Name = const_name("tuple");
    template <class> using Cast = Struct;
    template <class> static constexpr bool can_cast() { return true; }

    bool from_python(handle source, uint8_t flags, cleanup_list* cleanup) noexcept {
        if (!PyTuple_Check(source.ptr()) || PyTuple_Size(source.ptr()) != sizeof...(Fields)) return false;
        const auto takes = [&]<std::size_t... I>(std::index_sequence<I...>) {
            return (std::get<I>(casters).from_python(PyTuple_GetItem(source.ptr(), I), flags, cleanup) && ...);
        };
        return takes(std::index_sequence_for<Fields...>());
    }
    explicit operator Struct() {
        return std::apply([](auto&... each) { return Struct{each.operator cast_t<Fields>()...}; }, casters);
    }
    std::tuple<make_caster<Fields>...> casters;
};

NAMESPACE_END(detail)
NAMESPACE_END(NB_NAMESPACE)
