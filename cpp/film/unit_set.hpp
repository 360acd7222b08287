// A set of numbered work units, as the ranges that it is made of.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

namespace usdmlt {

class UnitSet {
public:
    using Range = std::pair<int64_t, int64_t>;  // first, and one beyond the last

    // Disjoint, ascending, and with gaps between them.
    const std::vector<Range>& ranges() const { return ranges_; }
    bool empty() const { return ranges_.empty(); }
    int64_t count() const {
        int64_t n = 0;
        for (const auto& [first, last] : ranges_) n += last - first;
        return n;
    }
    // n, where the units 0 … n − 1 are all in it and n is not.
    int64_t prefix() const {
        return !ranges_.empty() && ranges_.front().first == 0 ? ranges_.front().second : 0;
    }
    bool overlaps(const Range& range) const {
        return std::ranges::any_of(ranges_, [&](const Range& other) {
            return range.first < other.second && other.first < range.second;
        });
    }
    // A range that does not overlap the set.
    void add(const Range& range) {
        if (range.first >= range.second) return;
        auto at = ranges_.insert(std::ranges::lower_bound(ranges_, range), range);
        if (at + 1 != ranges_.end() && (at + 1)->first == at->second) {
            at->second = (at + 1)->second;
            ranges_.erase(at + 1);
        }
        if (at != ranges_.begin() && (at - 1)->second == at->first) {
            (at - 1)->second = at->second;
            ranges_.erase(at);
        }
    }

private:
    std::vector<Range> ranges_;
};

}  // namespace usdmlt
