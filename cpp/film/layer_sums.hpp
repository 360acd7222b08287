// What the paths of one deposit give to the layers of a film: parts of its value, each with the set
// of layers that it belongs to.
#pragma once

#include <cstdint>
#include <vector>

#include "base/spectrum.hpp"

namespace usdmlt {

// Bit i: layer i.
using LayerMask = uint64_t;
inline constexpr int most_layers = 64;

struct LayerSums {
    struct Part {
        LayerMask mask;
        double value[3];
    };
    std::vector<Part> parts;  // of different masks; grows to what is needed, and stays

    void clear() { parts.clear(); }
    void add(LayerMask mask, const Spectrum& value) {
        for (Part& part : parts)
            if (part.mask == mask) {
                for (int c = 0; c < 3; ++c) part.value[c] += value[c];
                return;
            }
        parts.push_back({mask, {value[0], value[1], value[2]}});
    }
};

}  // namespace usdmlt
