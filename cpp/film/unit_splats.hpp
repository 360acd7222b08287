// The luminance that one unit has splatted, by pixel, in the film's fixed point. A unit touches few
// of a large film's pixels, so these are a hash table. One thread adds in one order, so that floats
// will do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace usdmlt {

class UnitSplats {
public:
    UnitSplats() { grow(); }

    void add(uint32_t pixel, float luminance) {
        Slot& slot = find(pixel);
        if (slot.pixel == none) {
            slot.pixel = pixel;
            used_.push_back(static_cast<uint32_t>(&slot - slots_.data()));
        }
        slot.luminance += luminance;
        if (used_.size() * 2 > slots_.size()) grow();
    }
    void prefetch(uint32_t pixel) const { __builtin_prefetch(&slots_[home(pixel)], 1); }

    // f(pixel, luminance) for each pixel that was splatted to, and forgets them; `soon` is called
    // with a pixel some time before.
    template <typename F, typename Soon>
    void take(F&& f, Soon&& soon) {
        constexpr size_t ahead = 16;
        for (size_t i = 0; i < used_.size() + ahead; ++i) {
            if (i < used_.size()) soon(slots_[used_[i]].pixel);
            if (i < ahead) continue;
            Slot& slot = slots_[used_[i - ahead]];
            f(slot.pixel, slot.luminance);
            slot = {};
        }
        used_.clear();
    }

private:
    static constexpr uint32_t none = ~0u;
    struct Slot {
        uint32_t pixel = none;
        float luminance = 0;
    };

    // Multiplicative hashing, by the golden ratio.
    size_t home(uint32_t pixel) const { return (pixel * 0x9e3779b97f4a7c15ull) >> shift_; }
    Slot& find(uint32_t pixel) {
        size_t i = home(pixel);
        while (slots_[i].pixel != pixel && slots_[i].pixel != none)
            i = (i + 1) & (slots_.size() - 1);
        return slots_[i];
    }
    void grow() {
        std::vector<Slot> old(size_t(1) << (64 - --shift_));
        old.swap(slots_);
        for (uint32_t& i : used_) {
            Slot& slot = find(old[i].pixel);
            slot = old[i];
            i = static_cast<uint32_t>(&slot - slots_.data());
        }
    }

    int shift_ = 64 - 11;      // 64 − log2 of the number of slots
    std::vector<Slot> slots_;  // a power of two, at most half of them used
    std::vector<uint32_t> used_;
};

}  // namespace usdmlt
