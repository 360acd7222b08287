#include "integrators/scheduler.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "base/floating_point.hpp"

namespace usdmlt {

int64_t run_units(int64_t first, int64_t last, const RunLimits& limits,
                  const std::function<void(int64_t, int)>& unit) {
    using Clock = std::chrono::steady_clock;
    const auto start = Clock::now();
    const auto late = [&] {
        return limits.seconds > 0 &&
               std::chrono::duration<double>(Clock::now() - start).count() >= limits.seconds;
    };

    // Units are handed out in order by one counter, so what is done is always a prefix.
    std::atomic<int64_t> next{first};
    std::atomic<bool> stop{false};
    std::mutex mutex;
    std::condition_variable finished;
    int running = 0;
    std::exception_ptr failure;  // the first

    const auto work = [&](int thread) {
        const FlushDenormals flush;
        std::exception_ptr caught;
        try {
            while (!stop.load(std::memory_order_relaxed)) {
                if (late()) break;
                int64_t index = next.load();
                while (index < last && !next.compare_exchange_weak(index, index + 1)) {
                }
                if (index >= last) break;
                unit(index, thread);
            }
        } catch (...) {
            caught = std::current_exception();
            stop = true;
        }
        const std::lock_guard lock(mutex);
        if (!failure) failure = caught;
        --running;
        finished.notify_one();
    };
    std::vector<std::thread> pool;
    pool.reserve(static_cast<size_t>(limits.threads));
    {
        std::unique_lock lock(mutex);
        for (int i = 0; i < limits.threads; ++i) {
            try {
                pool.emplace_back(work, i);
                ++running;
            } catch (const std::system_error&) {
                break;  // no memory for its stack: fewer do the same
            }
        }
        if (pool.empty()) throw std::bad_alloc();
        while (!finished.wait_for(lock, std::chrono::milliseconds(100),
                                  [&] { return running == 0; })) {
            lock.unlock();
            if (limits.poll && limits.poll(next.load() - first)) stop = true;
            lock.lock();
        }
    }
    for (std::thread& t : pool) t.join();
    if (failure) std::rethrow_exception(failure);
    return next.load();
}

}  // namespace usdmlt
