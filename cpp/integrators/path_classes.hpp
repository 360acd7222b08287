// Energy by class of path: L, then for every vertex between D or S, by the component through which
// the path scatters there, or M for a point of a medium, then E.
#pragma once

#include <array>
#include <string>

#include "paths/path.hpp"

namespace usdmlt {

enum class ClassLetter : uint8_t { D, S, M };

// The vertices between, two bits each, x_1 lowest; a leading 1 marks the length. Paths of more than
// `longest` edges share one class per length.
inline constexpr int longest_class = 24;

template <typename Letter>
uint64_t class_of(int edges, const Letter& letter) {
    if (edges > longest_class) return (uint64_t(1) << 63) | uint64_t(edges);
    uint64_t bits = uint64_t(1) << (2 * (edges - 1));
    for (int i = 1; i < edges; ++i) bits |= uint64_t(letter(i)) << (2 * (i - 1));
    return bits;
}

inline uint64_t class_of(const Path& path) {
    return class_of(path.edges(), [&](int i) {
        if (path.is_delta(i)) return ClassLetter::S;
        return path[i].is_medium() ? ClassLetter::M : ClassLetter::D;
    });
}

// Vertices between through which the path scatters otherwise than by a Dirac component.
template <typename IsDelta>
int rough_vertices(int edges, const IsDelta& is_delta) {
    int count = 0;
    for (int i = 1; i < edges; ++i) count += !is_delta(i);
    return count;
}

inline int rough_vertices(const Path& path) {
    return rough_vertices(path.edges(), [&](int i) { return path.is_delta(i); });
}

inline std::string class_name(uint64_t key) {
    if (key >> 63) return std::to_string(key & 0xffffffffu) + " edges";
    std::string name = "L";
    for (; key > 1; key >>= 2) name += "DSM"[key & 3];
    return name + "E";
}

inline int edges_of_class(uint64_t key) {
    if (key >> 63) return static_cast<int>(key & 0xffffffffu);
    int k = 1;
    while (key >>= 2) ++k;
    return k;
}

// A fixed table, so that nothing is allocated while chains run; what does not fit goes into key 0.
class PathClasses {
public:
    static constexpr size_t capacity = 1024;

    void reset() {
        keys_.fill(0);
        energy_.fill(0);
        other_ = 0;
    }
    void add(uint64_t key, double energy) {
        size_t i = (key * 0x9e3779b97f4a7c15ull) >> 54;
        for (size_t probes = 0; probes < 16; ++probes, i = (i + 1) % capacity) {
            if (keys_[i] == 0) keys_[i] = key;
            if (keys_[i] == key) {
                energy_[i] += energy;
                return;
            }
        }
        other_ += energy;
    }
    template <typename F>
    void for_each(F&& f) const {
        for (size_t i = 0; i < capacity; ++i)
            if (keys_[i] != 0) f(keys_[i], energy_[i]);
        if (other_ != 0) f(uint64_t(0), other_);
    }

private:
    std::array<uint64_t, capacity> keys_{};
    std::array<double, capacity> energy_{};
    double other_ = 0;
};

}  // namespace usdmlt
