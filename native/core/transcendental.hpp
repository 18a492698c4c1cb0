// Sines and the like, the same bits on every machine: libm's differ in the last bit by the processor. They have no
// branches, so that loops over them are vectorised, and are off by at most 2 units in the last place (4: pow). Angles of
// sine, cosine and tangent are below 1e6 [rad]. Polynomials interpolate at Chebyshev nodes.
// Source of the reductions: Cody and Waite, Software Manual for the Elementary Functions (1980).
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>

#include "numbers.hpp"

namespace fg {
namespace transcendental {

// c[First] + x c[First + 1] + ..., by halves, which do not wait for each other (Estrin).
template <int First, int Count, int All>
constexpr double part_of_polynomial(double x, const double (&c)[All]) {
    if constexpr (Count == 1) {
        return c[First];
    } else {
        constexpr int low = Count > 8 ? 8 : Count > 4 ? 4 : Count > 2 ? 2 : 1;
        double power = x;
        for (int k = 1; k < low; k *= 2) power *= power;
        return part_of_polynomial<First, low>(x, c) + power * part_of_polynomial<First + low, Count - low>(x, c);
    }
}

template <int Count>
constexpr double polynomial(double x, const double (&c)[Count]) {
    return part_of_polynomial<0, Count>(x, c);
}

// To the nearest whole number, for |x| < 2^51.
inline double nearest(double x) {
    constexpr double shift = 0x1.8p52;
    return (x + shift) - shift;
}

// 2^k for a whole k within +-1022.
inline double power_of_two(double k) {
    return std::bit_cast<double>((std::bit_cast<std::int64_t>(k + 0x1.8p52) + 1023) << 52);
}

// The sine and the cosine of an angle less quarter turns, and the count of those.
struct Reduced {
    double sine, cosine;
    std::int64_t quarters;
};

inline Reduced reduced(double angle) {
    constexpr double sines[] = {-0.16666666666666666,   0.008333333333330936,    -0.00019841269836740532,
                                2.7557316093198404e-06, -2.5051129896450185e-08, 1.5917988979397435e-10};
    constexpr double cosines[] = {0.041666666666666664,    -0.0013888888888887389, 2.48015872987544e-05,
                                  -2.755731726587808e-07, 2.087614504941318e-09,  -1.138254464534925e-11};
    const double count = nearest(angle * (2.0 / pi));
    const double first = angle - count * 1.5707963267341256, second = count * 6.077100506303966e-11;
    const double r = first - second, lost = ((first - r) - second) - count * 2.0222662487959506e-21;
    const double s = r * r, half = 0.5 * s, rest = 1.0 - half;
    const double cosine = rest + (((1.0 - rest) - half) + (s * s * polynomial(s, cosines) - r * lost));
    return {r + (s * r * polynomial(s, sines) + lost * rest), cosine,
            std::bit_cast<std::int64_t>(count + 0x1.8p52)};
}

}  // namespace transcendental

inline double sin(double angle) {
    const auto [sine, cosine, quarters] = transcendental::reduced(angle);
    const double size = quarters & 1 ? cosine : sine;
    return quarters & 2 ? -size : size;
}

inline double cos(double angle) {
    const auto [sine, cosine, quarters] = transcendental::reduced(angle);
    const double size = quarters & 1 ? sine : cosine;
    return (quarters + 1) & 2 ? -size : size;
}

inline double tan(double angle) {
    const auto [sine, cosine, quarters] = transcendental::reduced(angle);
    const bool odd = quarters & 1;
    return (odd ? -cosine : sine) / (odd ? sine : cosine);
}

inline double atan(double x) {
    constexpr double terms[] = {-0.3333333333333333,  0.19999999999995513,  -0.1428571428466482,  0.11111111015117626,
                                -0.09090904572487347, 0.07692183059894114,  -0.06664509603255386, 0.05858132894427922,
                                -0.05085365922344248, 0.03922923713835943, -0.01917392228554793};
    const double size = std::abs(x);
    const bool steep = size > 2.414213562373095, middle = size > 0.41421356237309503;
    // of the angle beyond a right angle, or half of one
    const double numerator = steep ? -1.0 : middle ? size - 1.0 : size;
    const double denominator = steep ? size : middle ? size + 1.0 : 1.0;
    const double whole = steep ? pi / 2.0 : middle ? pi / 4.0 : 0.0;
    const double lost = steep ? 6.123233995736766e-17 : middle ? 3.061616997868383e-17 : 0.0;
    const double t = numerator / denominator, s = t * t;
    return std::copysign(whole + (t + (t * s * transcendental::polynomial(s, terms) + lost)), x);
}

inline double atan2(double y, double x) {
    const double least = std::abs(y) + std::abs(x) == 0.0 ? 0.0 : std::abs(y) / std::abs(x);
    const double angle = atan(std::isinf(x) && std::isinf(y) ? 1.0 : least);
    return std::copysign(std::signbit(x) ? pi - (angle - 1.2246467991473532e-16) : angle, y);
}

inline double asin(double x) { return atan(x / std::sqrt((1.0 - x) * (1.0 + x))); }

inline double exp(double x) {
    constexpr double terms[] = {0.5000000000000001,     0.16666666666666669,    0.041666666666623824,
                                0.008333333333330039,   0.0013888888917367081,  0.00019841269863171557,
                                2.4801521057868204e-05, 2.7557268276905696e-06, 2.7620201591031547e-07,
                                2.5100472505694996e-08};
    const double within = min(max(x, -1400.0), 1400.0);
    const double count = transcendental::nearest(within * std::numbers::log2e);
    const double first = within - count * 0.6931471803691238, second = count * 1.9082149292705877e-10;
    const double r = first - second;
    const double grown = 1.0 + (r + (r * r * transcendental::polynomial(r, terms) + ((first - r) - second)));
    const double half = transcendental::nearest(0.5 * count);  // two factors reach subnormal numbers and infinity
    return grown * transcendental::power_of_two(half) * transcendental::power_of_two(count - half);
}

// The natural logarithm of a normal number; NaN of a negative one.
inline double log(double x) {
    constexpr double terms[] = {0.3333333333333335,  0.1999999999994969,  0.14285714313015532, 0.11111105562861405,
                                0.09091444893095521, 0.07665849816771929, 0.07308360589930908};
    const std::int64_t bits = std::bit_cast<std::int64_t>(x);
    const std::int64_t count = (bits - 0x3fe6a09e667f3bcd) >> 52;  // so that the rest is within sqrt(1/2) and sqrt(2)
    const double rest = std::bit_cast<double>(bits - (count << 52)), k = static_cast<double>(count);
    const double f = rest - 1.0, t = f / (2.0 + f), s = t * t, half = 0.5 * f * f;
    const double value = k * 0.6931471803691238 -
                         ((half - (t * (half + 2.0 * s * transcendental::polynomial(s, terms)) + k * 1.9082149292705877e-10)) - f);
    return x > 0.0 ? (x < inf ? value : inf) : x == 0.0 ? -inf : nan;
}

inline double log1p(double x) {
    const double more = 1.0 + x, lost = more - 1.0;
    return lost == 0.0 || more <= 0.0 || more == inf ? (more > 0.0 ? min(x, more) : log(more)) : log(more) * (x / lost);
}

// A positive base to a power.
inline double pow(double base, double power) { return exp(power * log(base)); }

inline double hypot(double x, double y) { return std::sqrt(x * x + y * y); }

}  // namespace fg
