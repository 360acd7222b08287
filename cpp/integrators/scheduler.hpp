// Runs numbered work units on a pool of threads.
#pragma once

#include <cstdint>
#include <functional>

namespace usdmlt {

struct RunLimits {
    int threads = 1;
    double seconds = 0;                 // no unit starts later than this; 0: no limit
    std::function<bool(int64_t)> poll;  // called ten times a second by the calling thread with the
                                        // number of units handed out; true stops
};

// Runs unit(index, thread) for index = first, first + 1, … < last. Every unit that was started is
// finished: the result n means that exactly the units first … n − 1 are done. What a unit throws is
// thrown when those that were started have ended; std::bad_alloc where no thread can be.
int64_t run_units(int64_t first, int64_t last, const RunLimits& limits,
                  const std::function<void(int64_t index, int thread)>& unit);

}  // namespace usdmlt
