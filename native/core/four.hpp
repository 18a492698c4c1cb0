// Four numbers at once, by the vectors that g++ and clang have; the bits are those of one after the other. In what takes
// numbers or fours, T, a condition chooses by `condition ? a : b` for either.
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>
#include <type_traits>

namespace fg {

using Four = double __attribute__((vector_size(32)));
using FourFlags = std::int64_t __attribute__((vector_size(32)));  // -1: true, 0: false

// What holds the bits of a T.
template <class T>
using Bits = std::conditional_t<std::is_same_v<T, Four>, FourFlags, std::int64_t>;

#define FG_INLINE [[gnu::always_inline]] inline  // else fours are passed on the stack

template <class T>
FG_INLINE T all(double number) {
    return T{} + number;
}
template <class T>
FG_INLINE T size_of(T x) {
    return std::bit_cast<T>(std::bit_cast<Bits<T>>(x) & ~(std::int64_t{1} << 63));
}
template <class T>
FG_INLINE T with_sign_of(T size, T of) {
    constexpr std::int64_t sign = std::int64_t{1} << 63;
    return std::bit_cast<T>((std::bit_cast<Bits<T>>(size) & ~sign) | (std::bit_cast<Bits<T>>(of) & sign));
}
FG_INLINE double root_of(double x) { return std::sqrt(x); }
FG_INLINE Four root_of(Four x) { return Four{std::sqrt(x[0]), std::sqrt(x[1]), std::sqrt(x[2]), std::sqrt(x[3])}; }
FG_INLINE Four min(Four a, Four b) { return b < a ? b : a; }
FG_INLINE Four max(Four a, Four b) { return b > a ? b : a; }
FG_INLINE bool any(FourFlags flags) { return (flags[0] | flags[1] | flags[2] | flags[3]) != 0; }

}  // namespace fg
