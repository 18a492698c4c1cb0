// How rows of structured arrays of numpy become records, without a copy: `Held<Limiter>` is one of them, a row `array[0]`
// or an array of one; `Row<Car>` are all rows of an array. Their size is checked; native.py checks their fields.
#pragma once
#include "casters.hpp"

namespace fg {

template <class Record>
struct Held {
    Record* record = nullptr;
    operator Record&() const { return *record; }
};

}  // namespace fg

NAMESPACE_BEGIN(NB_NAMESPACE)
NAMESPACE_BEGIN(detail)

// The bytes of a contiguous buffer; they stay where they are as long as its owner, an argument of the call, is there.
inline bool find_bytes(handle source, std::size_t alignment, char*& bytes, std::size_t& size) noexcept {
    Py_buffer view;
    if (PyObject_GetBuffer(source.ptr(), &view, PyBUF_SIMPLE) != 0) {
        PyErr_Clear();
        return false;
    }
    bytes = (char*) view.buf, size = (std::size_t) view.len;
    PyBuffer_Release(&view);
    return (std::uintptr_t) bytes % alignment == 0;
}

template <class Record>
struct type_caster<fg::Held<Record>> {
    static constexpr auto Name = const_name("numpy.void | NDArray[numpy.void]");
    template <class> using Cast = fg::Held<Record>;
    template <class> static constexpr bool can_cast() { return true; }

    bool from_python(handle source, uint8_t, cleanup_list*) noexcept {
        char* bytes;
        std::size_t size;
        if (!find_bytes(source, alignof(Record), bytes, size) || size != sizeof(Record)) return false;
        held.record = (Record*) bytes;
        return true;
    }
    explicit operator fg::Held<Record>() { return held; }
    fg::Held<Record> held;
};

template <class Record>
struct record_row_caster {
    static constexpr auto Name = const_name("NDArray[numpy.void]");
    template <class> using Cast = fg::Row<Record>;
    template <class> static constexpr bool can_cast() { return true; }

    bool from_python(handle source, uint8_t, cleanup_list*) noexcept {
        char* bytes;
        std::size_t size;
        if (!find_bytes(source, alignof(Record), bytes, size) || size % sizeof(Record) != 0) return false;
        row = {(Record*) bytes, (std::int64_t)(size / sizeof(Record))};
        return true;
    }
    explicit operator fg::Row<Record>() { return row; }
    fg::Row<Record> row;
};

template <class T> requires std::is_class_v<T>
struct type_caster<fg::Row<T>> : record_row_caster<T> {};

NAMESPACE_END(detail)
NAMESPACE_END(NB_NAMESPACE)
