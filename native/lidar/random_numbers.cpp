// Sources: O'Neill, PCG: A family of simple fast space-efficient statistically good algorithms for random number
// generation, 2014 (XSL-RR 128/64); Marsaglia and Tsang, The ziggurat method for generating random variables, 2000, as
// in numpy's distributions.c.
#include "random_numbers.hpp"

#include <bit>

#include "../core/numbers.hpp"
#include "../core/transcendental.hpp"

namespace fg {
namespace {

using Whole = unsigned __int128;

constexpr Whole joined(std::uint64_t high, std::uint64_t low) { return Whole{high} << 64 | low; }

constexpr Whole MULTIPLIER = joined(0x2360ED051FC65DA4, 0x4385DF649FCCF645);  // of PCG64
constexpr double TAIL = 3.6541528853610088;           // ziggurat_nor_r of numpy: where the lowest layer ends
constexpr double INVERSE_TAIL = 0.27366123732975828;  // ziggurat_nor_inv_r
constexpr double UNIT = 1.0 / 9007199254740992.0;     // 2^-53
constexpr std::uint64_t SIZES = (1ull << 52) - 1;     // mask of a size
constexpr int LOW_BITS = 11;                          // of a number, which a share from 0 to 1 leaves out

class Generator {
   public:
    explicit Generator(Row<std::int64_t> kept)
        : kept_(kept), state_(joined(kept[0], kept[1])), step_(joined(kept[2], kept[3])) {}
    ~Generator() {
        kept_.data[0] = static_cast<std::int64_t>(state_ >> 64);
        kept_.data[1] = static_cast<std::int64_t>(state_);
    }

    // The next number of 64 bits.
    std::uint64_t next() {
        state_ = state_ * MULTIPLIER + step_;
        const auto high = static_cast<std::uint64_t>(state_ >> 64), low = static_cast<std::uint64_t>(state_);
        return std::rotr(high ^ low, static_cast<int>(high >> 58));
    }
    // The next number from 0 to 1.
    double share() { return static_cast<double>(next() >> LOW_BITS) * UNIT; }

   private:
    Row<std::int64_t> kept_;
    Whole state_, step_;
};

// A number beyond the end of the lowest layer.
double beyond_tail(Generator& generator, double share) {
    while (true) {
        const double beyond = -INVERSE_TAIL * std::log1p(-share);
        const double depth = -std::log1p(-generator.share());
        if (depth + depth > beyond * beyond) return TAIL + beyond;
        share = generator.share();
    }
}

double normal(Generator& generator, const Ziggurat& ziggurat) {
    while (true) {
        const std::uint64_t drawn = generator.next(), layer = drawn & 255, size = drawn >> 9 & SIZES;
        double found = static_cast<double>(size) * ziggurat.widths[layer];
        if (drawn & 256) found = -found;
        if (size < static_cast<std::uint64_t>(ziggurat.limits[layer])) return found;
        const double share = generator.share();
        if (layer == 0) {
            const double beyond = beyond_tail(generator, share);
            return size & 256 ? -beyond : beyond;
        }
        const double below = ziggurat.heights[layer], above = ziggurat.heights[layer - 1];
        if ((above - below) * share + below < fg::exp(-0.5 * found * found)) return found;
    }
}

}  // namespace

void draw_shares(Row<std::int64_t> state, Row<double> out) {
    Generator generator(state);
    for (int k = 0; k < out.size(); ++k) out[k] = generator.share();
}

void draw_normals(Row<std::int64_t> state, const Ziggurat& ziggurat, Row<double> out) {
    Generator generator(state);
    for (int k = 0; k < out.size(); ++k) out[k] = normal(generator, ziggurat);
}

}  // namespace fg
