// Sines and the like, the same bits on every machine: libm's differ in the last bit by the processor. They are off by at
// most 3 units in the last place, for angles below 1e6 [rad]. Polynomials interpolate at Chebyshev nodes.
// Source of the reductions: Cody and Waite, Software Manual for the Elementary Functions (1980).
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>

#include "four.hpp"
#include "numbers.hpp"

namespace fg {
namespace transcendental {

// c[First] + x c[First + 1] + ..., by halves, which do not wait for each other (Estrin).
template <int First, int Count, class T, int All>
FG_INLINE T part_of_polynomial(T x, const double (&c)[All]) {
    if constexpr (Count == 1) {
        return all<T>(c[First]);
    } else {
        constexpr int low = Count > 8 ? 8 : Count > 4 ? 4 : Count > 2 ? 2 : 1;
        T power = x;
        for (int k = 1; k < low; k *= 2) power *= power;
        return part_of_polynomial<First, low>(x, c) + power * part_of_polynomial<First + low, Count - low>(x, c);
    }
}

template <class T, int Count>
FG_INLINE T polynomial(T x, const double (&c)[Count]) {
    return part_of_polynomial<0, Count>(x, c);
}

// To the nearest whole number, for |x| < 2^51.
template <class T>
FG_INLINE T nearest(T x) {
    constexpr double shift = 0x1.8p52;
    return (x + shift) - shift;
}

// 2^k for a whole k within +-1022.
template <class T>
FG_INLINE T power_of_two(T k) {
    return std::bit_cast<T>((std::bit_cast<Bits<T>>(k + 0x1.8p52) + 1023) << 52);
}

// The sine and the cosine of an angle less quarter turns, and the count of those.
template <class T>
struct Reduced {
    T sine, cosine;
    Bits<T> quarters;
};

template <class T>
FG_INLINE Reduced<T> reduced(T angle) {
    constexpr double sines[] = {-0.16666666666666666,   0.008333333333330936,    -0.00019841269836740532,
                                2.7557316093198404e-06, -2.5051129896450185e-08, 1.5917988979397435e-10};
    constexpr double cosines[] = {0.041666666666666664,    -0.0013888888888887389, 2.48015872987544e-05,
                                  -2.755731726587808e-07, 2.087614504941318e-09,  -1.138254464534925e-11};
    const T count = nearest(angle * (2.0 / pi));
    const T first = angle - count * 1.5707963267341256, second = count * 6.077100506303966e-11;
    const T r = first - second, lost = ((first - r) - second) - count * 2.0222662487959506e-21;
    const T s = r * r, half = 0.5 * s, rest = 1.0 - half;
    const T cosine = rest + (((1.0 - rest) - half) + (s * s * polynomial(s, cosines) - r * lost));
    return {r + (s * r * polynomial(s, sines) + lost * rest), cosine, std::bit_cast<Bits<T>>(count + 0x1.8p52)};
}

template <class T>
FG_INLINE T sine(T angle) {
    const auto [sine, cosine, quarters] = reduced(angle);
    const T size = (quarters & 1) != 0 ? cosine : sine;
    return (quarters & 2) != 0 ? -size : size;
}

template <class T>
FG_INLINE T arctangent(T x) {
    constexpr double terms[] = {-0.3333333333333333,  0.19999999999995513, -0.1428571428466482,  0.11111111015117626,
                                -0.09090904572487347, 0.07692183059894114, -0.06664509603255386, 0.05858132894427922,
                                -0.05085365922344248, 0.03922923713835943, -0.01917392228554793};
    const T size = size_of(x), zero{}, one = all<T>(1.0);
    const auto steep = size > 2.414213562373095, middle = size > 0.41421356237309503;
    // of the angle beyond a right angle, or half of one
    const T numerator = steep ? -one : middle ? size - 1.0 : size;
    const T denominator = steep ? size : middle ? size + 1.0 : one;
    const T whole = steep ? all<T>(pi / 2.0) : middle ? all<T>(pi / 4.0) : zero;
    const T lost = steep ? all<T>(6.123233995736766e-17) : middle ? all<T>(3.061616997868383e-17) : zero;
    const T t = numerator / denominator, s = t * t;
    return with_sign_of(whole + (t + (t * s * polynomial(s, terms) + lost)), x);
}

template <class T>
FG_INLINE T exponential(T x) {
    constexpr double terms[] = {0.5000000000000001,     0.16666666666666669,    0.041666666666623824,
                                0.008333333333330039,   0.0013888888917367081,  0.00019841269863171557,
                                2.4801521057868204e-05, 2.7557268276905696e-06, 2.7620201591031547e-07,
                                2.5100472505694996e-08};
    const T within = min(max(x, all<T>(-1400.0)), all<T>(1400.0));
    const T count = nearest(within * std::numbers::log2e);
    const T first = within - count * 0.6931471803691238, second = count * 1.9082149292705877e-10;
    const T r = first - second;
    const T grown = 1.0 + (r + (r * r * polynomial(r, terms) + ((first - r) - second)));
    const T half = nearest(0.5 * count);  // two factors reach subnormal numbers and infinity
    return grown * power_of_two(half) * power_of_two(count - half);
}

}  // namespace transcendental

inline double sin(double angle) { return transcendental::sine(angle); }
FG_INLINE Four sin(Four angle) { return transcendental::sine(angle); }
inline double atan(double x) { return transcendental::arctangent(x); }
FG_INLINE Four atan(Four x) { return transcendental::arctangent(x); }
inline double exp(double x) { return transcendental::exponential(x); }
FG_INLINE Four exp(Four x) { return transcendental::exponential(x); }

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

inline double atan2(double y, double x) {
    const double slope = std::abs(y) + std::abs(x) == 0.0 ? 0.0 : std::abs(y) / std::abs(x);
    const double angle = atan(std::isinf(x) && std::isinf(y) ? 1.0 : slope);
    return std::copysign(std::signbit(x) ? pi - (angle - 1.2246467991473532e-16) : angle, y);
}

inline double asin(double x) { return atan(x / std::sqrt((1.0 - x) * (1.0 + x))); }
inline double acos(double x) { return atan2(std::sqrt((1.0 - x) * (1.0 + x)), x); }

// The natural logarithm of a normal number; NaN of a negative one.
inline double log(double x) {
    constexpr double terms[] = {0.3333333333333335,  0.1999999999994969,  0.14285714313015532, 0.11111105562861405,
                                0.09091444893095521, 0.07665849816771929, 0.07308360589930908};
    const auto bits = std::bit_cast<std::int64_t>(x);
    const std::int64_t count = (bits - 0x3fe6a09e667f3bcd) >> 52;  // so that the rest is within sqrt(1/2) and sqrt(2)
    const double rest = std::bit_cast<double>(bits - (count << 52)), k = static_cast<double>(count);
    const double f = rest - 1.0, t = f / (2.0 + f), s = t * t, half = 0.5 * f * f;
    const double beyond = t * (half + 2.0 * s * transcendental::polynomial(s, terms)) + k * 1.9082149292705877e-10;
    const double value = k * 0.6931471803691238 - ((half - beyond) - f);
    return x > 0.0 ? (x < inf ? value : inf) : x == 0.0 ? -inf : nan;
}

// A positive base to a power.
inline double pow(double base, double power) { return exp(power * log(base)); }

inline double hypot(double x, double y) {
    const double size = max(std::abs(x), std::abs(y));
    if (size < 1e-150 || size > 1e150) [[unlikely]] {  // squares of these are no numbers
        const double scale = size > 1.0 ? 0x1p-600 : 0x1p600;
        return std::sqrt(x * scale * (x * scale) + y * scale * (y * scale)) / scale;
    }
    return std::sqrt(x * x + y * y);
}

}  // namespace fg
