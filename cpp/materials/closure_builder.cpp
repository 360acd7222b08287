#include "materials/closure_builder.hpp"

#include "materials/layering.hpp"
#include "materials/lobes/sheen.hpp"
#include "materials/microfacet.hpp"

namespace usdmlt {

namespace {

Spectrum at_most_one(const Spectrum& s) {
    return Spectrum(std::min(s[0], 1.0f), std::min(s[1], 1.0f), std::min(s[2], 1.0f));
}

// Two media of the same index: nothing bends, microfacets or not, so the lobe is Dirac. Nearby,
// refraction is too concentrated for the half vector to be found in float.
constexpr float same_index = 1e-3f;

void set_roughness(Lobe& lobe) {
    lobe.alpha_x = unit_interval(lobe.alpha_x);
    lobe.alpha_y = unit_interval(lobe.alpha_y);
    lobe.delta = (lobe.alpha_x < smooth_alpha && lobe.alpha_y < smooth_alpha) ||
                 (lobe.transmits && std::fabs(lobe.eta - 1) < same_index);
    if (lobe.delta) return;
    lobe.alpha_x = std::max(lobe.alpha_x, smooth_alpha);
    lobe.alpha_y = std::max(lobe.alpha_y, smooth_alpha);
}

}  // namespace

void ClosureBuilder::push_operand(const Spectrum& emission) {
    operands_[count_++] = {closure_.lobe_count, closure_.cover_count, emission};
}

void ClosureBuilder::push_nothing() { push_operand(Spectrum()); }

void ClosureBuilder::push_emission(const Spectrum& radiance) {
    push_operand(non_negative(radiance));
}

void ClosureBuilder::push_lobe(Lobe lobe) {
    push_operand(Spectrum());
    lobe.weight = non_negative(lobe.weight);
    lobe.tint_transmission = at_most_one(non_negative(lobe.tint_transmission));
    lobe.coverage = unit_interval(lobe.coverage);
    lobe.cover = no_cover;
    lobe.is_interface |= lobe.transmits;
    switch (lobe.type) {
        case LobeType::phase:  // no surface has it
            break;
        case LobeType::diffuse:
        case LobeType::translucent:
            lobe.transmits = lobe.is_interface = false;
            lobe.alpha_x = unit_interval(lobe.alpha_x);
            break;
        case LobeType::conductor:
            // An index of 0 without extinction is no material; the floor keeps 0/0 away.
            for (int i = 0; i < 3; ++i) lobe.color0[i] = std::max(lobe.color0[i], 1e-3f);
            lobe.color90 = non_negative(lobe.color90);
            set_roughness(lobe);
            break;
        case LobeType::schlick:
            lobe.color0 = at_most_one(non_negative(lobe.color0));
            lobe.color90 = at_most_one(non_negative(lobe.color90));
            lobe.edge = non_negative(lobe.edge);
            lobe.exponent = lobe.exponent > 0 ? lobe.exponent : 0.0f;
            set_roughness(lobe);
            break;
        case LobeType::dielectric:
            lobe.color0 = at_most_one(non_negative(lobe.color0));
            set_roughness(lobe);
            break;
        case LobeType::eon:
            lobe.transmits = lobe.is_interface = false;
            lobe.color0 = at_most_one(non_negative(lobe.color0));
            lobe.alpha_x = unit_interval(lobe.alpha_x);
            break;
        case LobeType::sheen:
            lobe.transmits = lobe.is_interface = false;
            lobe.alpha_x = unit_interval(lobe.alpha_x);
            sheen_lobe::prepare(lobe);
            break;
    }
    closure_.lobes[closure_.lobe_count++] = lobe;
}

void ClosureBuilder::scale(Part& operand, int lobe_last, int cover_last, const Spectrum& factor) {
    // Layers inside keep what they let through: only how much of it all there is changes.
    const float share = max_component(factor);
    for (int i = operand.lobe_first; i < lobe_last; ++i) {
        closure_.lobes[i].weight *= factor;
        closure_.lobes[i].coverage *= share;
    }
    for (int c = operand.cover_first; c < cover_last; ++c)
        closure_.covers[c].inverse_scale *= share > 0 ? 1 / share : 0.0f;
    operand.emission *= factor;
}

void ClosureBuilder::multiply(const Spectrum& factor) {
    scale(operand(1), closure_.lobe_count, closure_.cover_count, non_negative(factor));
}

void ClosureBuilder::add() {
    operand(2).emission += operand(1).emission;
    --count_;
}

void ClosureBuilder::mix(float foreground_share) {
    const float share = unit_interval(foreground_share);
    Part &foreground = operand(2), &background = operand(1);
    scale(foreground, background.lobe_first, background.cover_first, Spectrum(share));
    scale(background, closure_.lobe_count, closure_.cover_count, Spectrum(1 - share));
    add();
}

// Emission passes layers unchanged: a closure emits the same in all directions.
void ClosureBuilder::layer() {
    const Part &top = operand(2), &base = operand(1);
    if (top.lobe_first < base.lobe_first && base.lobe_first < closure_.lobe_count) {
        const int c = closure_.cover_count++;
        closure_.covers[c] =
            Cover{static_cast<uint8_t>(top.lobe_first), static_cast<uint8_t>(base.lobe_first)};
        for (int i = base.lobe_first; i < closure_.lobe_count; ++i)
            if (closure_.lobes[i].cover == no_cover)
                closure_.lobes[i].cover = static_cast<uint8_t>(c);
        for (int k = base.cover_first; k < c; ++k)
            if (closure_.covers[k].above == no_cover)
                closure_.covers[k].above = static_cast<uint8_t>(c);
    }
    add();
}

void ClosureBuilder::drop_black_lobes() {
    int kept = 0;
    for (int i = 0; i < closure_.lobe_count; ++i) {
        const Lobe& lobe = closure_.lobes[i];
        bool covers = false;  // a black layer still hides what is below
        for (int c = 0; c < closure_.cover_count; ++c)
            covers |= closure_.covers[c].lobe_first <= kept && kept < closure_.covers[c].lobe_last;
        if (!is_black(lobe.weight) || (covers && lobe.coverage > 0)) {
            closure_.lobes[kept++] = lobe;
            continue;
        }
        for (int c = 0; c < closure_.cover_count; ++c) {
            Cover& cover = closure_.covers[c];
            if (cover.lobe_first > kept) --cover.lobe_first;
            if (cover.lobe_last > kept) --cover.lobe_last;
        }
    }
    closure_.lobe_count = kept;
    const auto is_covered = [](const Lobe& lobe) { return lobe.cover != no_cover; };
    if (std::none_of(closure_.lobes, closure_.lobes + kept, is_covered)) closure_.cover_count = 0;
}

void ClosureBuilder::finish() {
    closure_.emission = count_ > 0 ? operand(1).emission : Spectrum();
    drop_black_lobes();
    closure_.has_non_delta = false;
    for (int i = 0; i < closure_.lobe_count; ++i) {
        Lobe& lobe = closure_.lobes[i];
        // More than everything cannot be scattered.
        lobe.weight = at_most_one(lobe.weight);
        closure_.has_non_delta |= !lobe.delta && !is_black(lobe.weight);
    }
    const Lobe& first = closure_.lobes[0];
    closure_.is_lambert = closure_.lobe_count == 1 && first.type == LobeType::diffuse &&
                          first.alpha_x == 0 && first.cover == no_cover;
    if (closure_.cover_count > 0) average_covers(closure_);
}

}  // namespace usdmlt
