// Builds a closure: lobes are pushed, then combined by layering, mixing, adding and scaling. Each
// push makes one operand, each combination takes its operands from the end and leaves one.
#pragma once

#include "materials/closure.hpp"

namespace usdmlt {

// What is no number, negative or infinite is 0: a value that scales light.
inline Spectrum non_negative(const Spectrum& s) {
    Spectrum out;
    for (int i = 0; i < 3; ++i) out[i] = s[i] > 0 && std::isfinite(s[i]) ? s[i] : 0.0f;
    return out;
}
inline float unit_interval(float x) { return x > 0 ? std::min(x, 1.0f) : 0.0f; }

// A relative index that is none (zero, negative, no number) is that of ordinary glass, 1.5, the
// default of UsdPreviewSurface and MaterialX.
inline float sane_index(float ior) {
    return ior > 0 && std::isfinite(ior) ? std::clamp(ior, 0.01f, 100.0f) : 1.5f;
}

class ClosureBuilder {
public:
    static constexpr int max_operands = 32;

    // Starts `closure` anew; its normals stay.
    explicit ClosureBuilder(Closure& closure) : closure_(closure) {
        closure.emission = Spectrum();
        closure.lobe_count = closure.cover_count = 0;
    }

    void push_nothing();
    // A weight, coverage or colour out of range is brought into it; GGX lobes become Dirac where
    // they are smooth.
    void push_lobe(Lobe lobe);
    void push_emission(const Spectrum& radiance);

    void layer();                      // top, base
    void mix(float foreground_share);  // foreground, background
    void add();
    void multiply(const Spectrum& factor);

    // Completes the closure: drops black lobes, sets flags and the means of covers.
    void finish();

private:
    // Not the Operand of pattern programs: a closure in the making.
    struct Part {
        int lobe_first, cover_first;
        Spectrum emission;
    };
    Part& operand(int from_end) { return operands_[count_ - from_end]; }
    void push_operand(const Spectrum& emission);
    void scale(Part& operand, int lobe_last, int cover_last, const Spectrum& factor);
    void drop_black_lobes();

    Closure& closure_;
    int count_ = 0;
    Part operands_[max_operands];
};

}  // namespace usdmlt
