// The clock of time.perf_counter.
#pragma once
#ifdef __APPLE__
#include <time.h>
#else
#include <chrono>
#endif

namespace fg {

// Return the time of the clock [s].
inline double seconds() {
#ifdef __APPLE__  // steady_clock counts the time asleep there
    return 1e-9 * static_cast<double>(clock_gettime_nsec_np(CLOCK_UPTIME_RAW));
#else
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    return 1e-9 * static_cast<double>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
#endif
}

}  // namespace fg
