// The tire laws: the force over the load [-] at a slip without sign. `numbers` (NUMBERS,) are those of the law's class.
#pragma once
#include <cstdint>

#include "../core/arrays.hpp"
#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"

namespace fg {

inline double coulomb_force(Numbers numbers, double slip) { return numbers[0] * min(numbers[1] * slip, 1.0); }

constexpr int magic_formula_numbers = 5;

template <class Numbers, class T>
FG_INLINE T magic_formula_force(const Numbers& numbers, T slip) {
    const T x = numbers[0] * min(slip, numbers[4]);
    return numbers[2] * fg::sin(numbers[1] * fg::atan(x - numbers[3] * (x - fg::atan(x))));
}

inline double linear_force(Numbers numbers, double slip) { return numbers[1] * slip; }

inline double brush_force(Numbers numbers, double slip) {
    const double rest = 1.0 - min(numbers[1] * slip, 1.0);
    return numbers[0] * (1.0 - rest * rest * rest);
}

inline double friction_curve_force(Numbers numbers, double slip) {
    const double x = min(slip / numbers[0], 1.0);
    const double y = min(max((slip - numbers[0]) / (numbers[2] - numbers[0]), 0.0), 1.0);
    return numbers[1] * x * (1.0 + x * (1.0 - x)) - (numbers[1] - numbers[3]) * y * y * (3.0 - 2.0 * y);
}

// Of a table: its reach, peak and slip of the peak, then force and rise over a cell of each node.
inline double sampled_force(Numbers numbers, double slip) {
    constexpr int cells = 96, reach = 0, nodes = 3;
    const double place = cells * std::sqrt(min(slip / numbers[reach], 1.0));
    const int cell = place < cells - 1 ? static_cast<int>(place) : cells - 1;  // of NaN any: the force is NaN
    const int low = nodes + 2 * cell;
    const double part = place - cell, step = numbers[low + 2] - numbers[low], rise = numbers[low + 1];
    const double bend = 3.0 * step - 2.0 * rise - numbers[low + 3];
    return numbers[low] + part * (rise + part * (bend + part * (rise + numbers[low + 3] - 2.0 * step)));
}

enum { coulomb, magic_formula, linear, brush, friction_curve };  // their places in LAWS; behind them: sampled ones

// Return the force of a law's tire.
inline double curve_force(std::int64_t law, Numbers numbers, double slip) {
    switch (law) {
        case coulomb: return coulomb_force(numbers, slip);
        case magic_formula: return magic_formula_force(numbers, slip);
        case linear: return linear_force(numbers, slip);
        case brush: return brush_force(numbers, slip);
        case friction_curve: return friction_curve_force(numbers, slip);
        default: return sampled_force(numbers, slip);
    }
}

}  // namespace fg
