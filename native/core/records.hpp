// Records: structures that numpy keeps as rows of a structured array. FG_RECORD lists the fields of one, so that Python
// can check that its own type has the same fields at the same places (fg_mujoco/native.py).
#pragma once
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

namespace fg {

// The size [bytes] of a record, and where its fields are.
struct Layout {
    std::size_t size;
    std::vector<std::pair<const char*, std::size_t>> fields;
};

template <class Record> Layout layout_of();

}  // namespace fg

#define FG_AGAIN ()
#define FG_MORE4(...) FG_MORE3(FG_MORE3(FG_MORE3(__VA_ARGS__)))
#define FG_MORE3(...) FG_MORE2(FG_MORE2(FG_MORE2(__VA_ARGS__)))
#define FG_MORE2(...) FG_MORE1(FG_MORE1(FG_MORE1(__VA_ARGS__)))
#define FG_MORE1(...) FG_MORE0(FG_MORE0(FG_MORE0(__VA_ARGS__)))
#define FG_MORE0(...) __VA_ARGS__
#define FG_FIELD(Record, field, ...) {#field, offsetof(Record, field)}, __VA_OPT__(FG_NEXT FG_AGAIN(Record, __VA_ARGS__))
#define FG_NEXT() FG_FIELD
#define FG_RECORD(Record, ...)                                                                  \
    template <> inline Layout layout_of<Record>() {                                             \
        return {sizeof(Record), {FG_MORE4(FG_FIELD(Record, __VA_ARGS__))}};                     \
    }                                                                                           \
    static_assert(std::is_trivially_copyable_v<Record>)
// FG_RECORD_AFTER is for a record whose first member has the fields of another record: it lists those that follow.
#define FG_RECORD_AFTER(Record, first, ...)                                                     \
    template <> inline Layout layout_of<Record>() {                                             \
        Layout layout = layout_of<decltype(Record::first)>();                                   \
        static_assert(offsetof(Record, first) == 0);                                            \
        layout.size = sizeof(Record);                                                           \
        layout.fields.insert(layout.fields.end(), {FG_MORE4(FG_FIELD(Record, __VA_ARGS__))});   \
        return layout;                                                                          \
    }                                                                                           \
    static_assert(std::is_trivially_copyable_v<Record>)
