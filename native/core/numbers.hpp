// Arithmetic as Python does it. Of two numbers that do not compare, as NaN, min and max return the first.
#pragma once
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

namespace fg {

inline constexpr double inf = std::numeric_limits<double>::infinity();
inline constexpr double nan = std::numeric_limits<double>::quiet_NaN();
inline constexpr double pi = std::numbers::pi;

constexpr double min(double a, double b) { return b < a ? b : a; }
constexpr double max(double a, double b) { return b > a ? b : a; }
constexpr int min(int a, int b) { return b < a ? b : a; }
constexpr int max(int a, int b) { return b > a ? b : a; }
constexpr std::int64_t min(std::int64_t a, std::int64_t b) { return b < a ? b : a; }
constexpr std::int64_t max(std::int64_t a, std::int64_t b) { return b > a ? b : a; }

// A number cut to a whole number, within +-1e9; NaN gives -1e9.
constexpr std::int32_t whole(double value) {
    value = value > -1e9 ? value : -1e9;
    return static_cast<std::int32_t>(value < 1e9 ? value : 1e9);
}

// Return an angle [rad] turned by whole turns into +-pi. A number of turns that 64 bits do not hold counts as -2^63.
inline double within_turn(double angle) {
    const double turns = std::nearbyint(angle / (2.0 * pi)) + 0.0;  // no -0
    return angle - 2.0 * pi * (std::abs(turns) < 0x1p63 ? turns : -0x1p63);
}

}  // namespace fg
