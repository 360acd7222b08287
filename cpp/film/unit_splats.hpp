// What one unit has splatted, in the film's fixed point: added to the film at its end. Sums that
// one thread adds to need no locks, and their squares are those of the unit.
//
// A unit touches few of a large film's pixels, so blocks of 4×4 pixels are found by a hash table:
// a chain stays near its place, so that most of what it needs is in the cache.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace usdmlt {

class UnitSplats {
public:
    static constexpr int side = 4;
    using Sum = std::array<int64_t, 3>;

    explicit UnitSplats(int width) : blocks_across_((width + side - 1) / side) { grow(); }

    Sum& at(int x, int y) {
        const uint32_t name = name_of(x, y);
        Slot* slot = &find(name);
        if (slot->name != name) slot = &add(name);
        return blocks_[slot->block].sums[(y % side) * side + x % side];
    }
    void prefetch(int x, int y) const {
        const Slot& slot = slots_[home(name_of(x, y))];
        __builtin_prefetch(&blocks_[slot.block].sums[(y % side) * side + x % side], 1);
    }

    // f(x, y, sum) for each pixel that was splatted to, and forgets them.
    template <typename F>
    void take(F&& f) {
        for (size_t i = 0; i < used_; ++i) {
            Block& block = blocks_[i];
            const int x0 = static_cast<int>(block.name % blocks_across_) * side;
            const int y0 = static_cast<int>(block.name / blocks_across_) * side;
            for (int j = 0; j < side * side; ++j)
                if (Sum& sum = block.sums[j]; sum != Sum{}) {
                    f(x0 + j % side, y0 + j / side, std::as_const(sum));
                    sum = {};
                }
            slots_[block.slot] = {};
        }
        used_ = 0;
    }

private:
    static constexpr uint32_t none = ~0u;
    struct Slot {
        uint32_t name = none;
        uint32_t block = 0;
    };
    struct Block {
        Sum sums[side * side];
        uint32_t name, slot;
    };

    uint32_t name_of(int x, int y) const {
        return uint32_t(y / side) * blocks_across_ + uint32_t(x / side);
    }
    // Multiplicative hashing, by the golden ratio.
    size_t home(uint32_t name) const { return (name * 0x9e3779b97f4a7c15ull) >> shift_; }
    Slot& find(uint32_t name) {
        size_t i = home(name);
        while (slots_[i].name != name && slots_[i].name != none) i = (i + 1) & (slots_.size() - 1);
        return slots_[i];
    }
    Slot& add(uint32_t name) {
        if (used_ == blocks_.size()) grow();
        Slot& slot = find(name);
        slot = {name, static_cast<uint32_t>(used_)};
        blocks_[used_].name = name;
        blocks_[used_++].slot = static_cast<uint32_t>(&slot - slots_.data());
        return slot;
    }
    void grow() {
        slots_.assign(size_t(1) << (64 - --shift_), {});
        blocks_.resize(slots_.size() / 2);
        for (uint32_t i = 0; i < used_; ++i) {
            Slot& slot = find(blocks_[i].name);
            slot = {blocks_[i].name, i};
            blocks_[i].slot = static_cast<uint32_t>(&slot - slots_.data());
        }
    }

    uint32_t blocks_across_;
    int shift_ = 64 - 7;         // 64 − log2 of the number of slots
    std::vector<Slot> slots_;    // a power of two, at most half of them used
    std::vector<Block> blocks_;  // the first used_ of them; their sums are 0 beyond
    size_t used_ = 0;
};

}  // namespace usdmlt
