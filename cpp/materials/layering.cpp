#include "materials/layering.hpp"

#include <algorithm>

#include "materials/directional_albedo.hpp"

namespace usdmlt {

namespace {

bool lets_nothing_pass(const Lobe& lobe) {
    return lobe.transmits || is_diffuse(lobe.type) || lobe.type == LobeType::conductor;
}

Spectrum min(const Spectrum& a, const Spectrum& b) {
    Spectrum m;
    for (int i = 0; i < 4; ++i) m[i] = std::min(a[i], b[i]);
    return m;
}
Spectrum max(const Spectrum& a, const Spectrum& b) {
    Spectrum m;
    for (int i = 0; i < 4; ++i) m[i] = std::max(a[i], b[i]);
    return m;
}

// One layer, the same from all azimuths and both sides: the mean of T from the mean albedos.
void average_single_cover(Closure& closure) {
    Cover& cover = closure.covers[0];
    Spectrum through(1.0f);
    for (int i = cover.lobe_first; i < cover.lobe_last; ++i) {
        const Lobe& lobe = closure.lobes[i];
        Spectrum taken(lobe.coverage * cover.inverse_scale);
        if (!lets_nothing_pass(lobe)) taken *= average_reflection_albedo(lobe);
        through = through - taken;
    }
    cover.average[0] = cover.average[1] = max(through, Spectrum());
}

// ∫ T |cosθ| dω / π = ∫₀¹ T 2c dc by Gauss–Legendre quadrature in c, between the angles at which
// total reflection sets in (across them it would be off by a tenth); two azimuths for anisotropic
// layers, which are symmetric in each quadrant.
constexpr int nodes = 8;
constexpr float node_cosines[nodes] = {0.0198550718f, 0.1016667613f, 0.2372337950f, 0.4082826788f,
                                       0.5917173212f, 0.7627662050f, 0.8983332387f, 0.9801449282f};
constexpr float node_weights[nodes] = {0.0506142681f, 0.1111905172f, 0.1568533229f, 0.1813418917f,
                                       0.1813418917f, 0.1568533229f, 0.1111905172f, 0.0506142681f};

// The cosines in (0, 1) beyond which lobes reflect totally on one side, ascending, between 0 and 1:
// T has kinks there. Returns how many.
int kinks(const Closure& closure, bool above, float out[max_lobes + 2]) {
    int count = 0;
    out[count++] = 0;
    for (int i = 0; i < closure.lobe_count; ++i) {
        const Lobe& lobe = closure.lobes[i];
        const float m = above ? lobe.eta : 1 / lobe.eta;
        if (lobe.is_interface && m < 1) out[count++] = std::sqrt(1 - sqr(m));
    }
    out[count++] = 1;
    std::sort(out, out + count);
    return static_cast<int>(std::unique(out, out + count) - out);
}

void average_by_quadrature(Closure& closure, bool sided, bool anisotropic) {
    const int azimuths = anisotropic ? 2 : 1;
    for (int side = 0; side < 2; ++side)
        for (int c = 0; c < closure.cover_count; ++c) closure.covers[c].average[side] = Spectrum();
    for (int side = 0; side < (sided ? 2 : 1); ++side) {
        float ends[max_lobes + 2];
        const int count = kinks(closure, side == 0, ends);
        for (int part = 0; part + 1 < count; ++part)
            for (int k = 0; k < nodes; ++k)
                for (int a = 0; a < azimuths; ++a) {
                    const float width = ends[part + 1] - ends[part];
                    const float cosine = ends[part] + width * node_cosines[k];
                    const float sine = safe_sqrt(1 - sqr(cosine));
                    const float phi = pi / 8 * float(1 + 2 * a);
                    const Passage p(closure, {sine * std::cos(phi), sine * std::sin(phi),
                                              side == 0 ? cosine : -cosine});
                    const float weight = width * node_weights[k] * 2 * cosine / float(azimuths);
                    for (int c = 0; c < closure.cover_count; ++c)
                        closure.covers[c].average[side] += p.through[c] * weight;
                }
    }
    if (sided) return;
    for (int c = 0; c < closure.cover_count; ++c)
        closure.covers[c].average[1] = closure.covers[c].average[0];
}

}  // namespace

void Passage::compute(const Closure& closure, Vec3f w) {
    // First each layer alone; inner ones come before those they lie under …
    for (int c = 0; c < closure.cover_count; ++c) {
        const Cover& cover = closure.covers[c];
        Spectrum alone(1.0f);
        for (int i = cover.lobe_first; i < cover.lobe_last; ++i) {
            const Lobe& lobe = closure.lobes[i];
            Spectrum taken(lobe.coverage * cover.inverse_scale);
            if (!lets_nothing_pass(lobe)) {
                if (!(has_albedo >> i & 1)) {
                    albedo[i] = reflection_albedo(lobe, w);
                    has_albedo |= static_cast<uint8_t>(1 << i);
                }
                taken *= albedo[i];
            }
            // A layer may itself be layered.
            for (uint8_t k = lobe.cover; k != cover.above; k = closure.covers[k].above)
                taken *= through[k];
            alone = alone - taken;
        }
        through[c] = max(alone, Spectrum());
    }
    // … then with all that is above.
    for (int c = closure.cover_count - 1; c >= 0; --c) {
        const uint8_t above = closure.covers[c].above;
        if (above != no_cover) through[c] *= through[above];
    }
}

Spectrum coupling(const Closure& closure, const Lobe& lobe, Vec3f l, const Passage& of_l, Vec3f e,
                  const Passage& of_e) {
    const Spectrum &t_l = of_l.through[lobe.cover], &t_e = of_e.through[lobe.cover];
    if (!is_diffuse(lobe.type)) return min(t_l, t_e);
    const Cover& cover = closure.covers[lobe.cover];
    // Across the surface the sides may differ: the greater mean keeps both directions within 1.
    const Spectrum average = max(cover.average[l.z > 0 ? 0 : 1], cover.average[e.z > 0 ? 0 : 1]);
    Spectrum factor;
    for (int i = 0; i < 3; ++i) factor[i] = average[i] > 0 ? t_l[i] * t_e[i] / average[i] : 0.0f;
    return factor;
}

void average_covers(Closure& closure) {
    bool wanted = false, sided = false, anisotropic = false;
    for (int i = 0; i < closure.lobe_count; ++i) {
        const Lobe& lobe = closure.lobes[i];
        if (is_diffuse(lobe.type)) {
            wanted |= lobe.cover != no_cover;
        } else {
            sided |= lobe.is_interface;
            anisotropic |= lobe.type != LobeType::sheen && lobe.alpha_x != lobe.alpha_y;
        }
    }
    if (!wanted) return;
    if (closure.cover_count == 1 && !sided && !anisotropic)
        average_single_cover(closure);
    else
        average_by_quadrature(closure, sided, anisotropic);
}

}  // namespace usdmlt
