#include "integrators/scheduler.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
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
    int running = limits.threads;

    const auto work = [&](int thread) {
        const FlushDenormals flush;
        while (!stop.load(std::memory_order_relaxed)) {
            if (late()) break;
            int64_t index = next.load();
            while (index < last && !next.compare_exchange_weak(index, index + 1)) {
            }
            if (index >= last) break;
            unit(index, thread);
        }
        const std::lock_guard lock(mutex);
        --running;
        finished.notify_one();
    };
    std::vector<std::thread> pool;
    for (int i = 0; i < limits.threads; ++i) pool.emplace_back(work, i);
    {
        std::unique_lock lock(mutex);
        while (!finished.wait_for(lock, std::chrono::milliseconds(100),
                                  [&] { return running == 0; })) {
            lock.unlock();
            if (limits.poll && limits.poll(next.load() - first)) stop = true;
            lock.lock();
        }
    }
    for (std::thread& t : pool) t.join();
    return next.load();
}

}  // namespace usdmlt
