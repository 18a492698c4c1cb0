// Python's % of numbers: it has the sign of the divisor, and so has a zero.
#pragma once
#include <cmath>

namespace fg {

inline double modulo(double value, double divisor) {
    const double rest = std::fmod(value, divisor);
    if (rest == 0.0) return divisor < 0.0 ? -0.0 : 0.0;
    return (divisor < 0.0) != (rest < 0.0) ? rest + divisor : rest;
}

}  // namespace fg
