// The scattering closure of one surface point: weighted lobes, textures already evaluated.
//
// Roles, not directions of tracing: every value is written for light that arrives from
// `to_light` and leaves towards `to_eye` (unit vectors pointing away from the surface), so a path
// has one value of f whichever side it was traced from. Refraction scales radiance by
// (η_eye / η_light)²; it is part of the value.
//
// Dirac components. Their values and densities are coefficients of one symmetric unit: the Dirac
// measure with respect to dσ⊥·η² (projected solid angle × squared index), which reflection and
// refraction leave invariant (Veach 1997, §5.2). So, in solid angle at `sampled`,
//     value = R·η² or T·η_eye²,     pdf = P·|cosθ_sampled|·η_sampled²,
// with P the discrete probability, and value·|cosθ|/pdf, pdf(a→b)/pdf(b→a) and all conversions to
// area measure are formed as for any other component; the unit cancels in every ratio.
// η is relative: 1 on the outside (the side the normal points to), the lobe's index inside.
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/frame.hpp"
#include "base/spectrum.hpp"
#include "base/vec.hpp"
#include "base/warps.hpp"
#include "materials/direction_guide.hpp"
#include "media/phase_function.hpp"

namespace usdmlt {

enum class LobeType : uint8_t {
    diffuse,      // Lambert, or Oren–Nayar where roughness > 0; reflection
    translucent,  // Lambert transmission
    dielectric,   // Fresnel of a real index; reflection and/or transmission
    conductor,    // Fresnel of a complex index; reflection
    schlick,      // generalised Schlick; reflection and/or transmission
    eon,          // rough diffuse that keeps energy; reflection
    sheen,        // standing fibres; reflection
    phase,        // of a medium: see Closure::phase
};

// A component of a vertex: all non-Dirac lobes together, or one Dirac lobe's reflection or
// transmission. Part of the state of a path.
using Component = uint8_t;
inline constexpr Component non_delta = 0;
inline constexpr Component delta_reflection(int lobe) {
    return static_cast<Component>(1 + 2 * lobe);
}
inline constexpr Component delta_transmission(int lobe) {
    return static_cast<Component>(2 + 2 * lobe);
}
inline constexpr int lobe_of(Component component) { return (component - 1) / 2; }
inline constexpr bool is_transmission(Component component) { return (component & 1) == 0; }

// Lambert-like: broad, sampled by the cosine.
inline constexpr bool is_diffuse(LobeType type) {
    return type == LobeType::diffuse || type == LobeType::translucent || type == LobeType::eon;
}

inline constexpr int max_lobes = 8;
inline constexpr uint8_t no_cover = 0xff;

struct Lobe {
    LobeType type = LobeType::diffuse;
    bool reflects = true, transmits = false;
    bool delta = false;         // both alphas below the smooth threshold
    bool is_interface = false;  // bounds a medium of index eta: the side matters; otherwise
                                // the lobe is two-sided and looks the same from below
    uint8_t cover = no_cover;   // innermost layer on top of this lobe (index into covers)
    // GGX; for diffuse and eon, alpha_x is the roughness; for sheen see sheen.hpp.
    float alpha_x = 0, alpha_y = 0;
    float eta = 1;       // relative index of the inside (refraction, dielectric Fresnel)
    float exponent = 5;  // schlick
    float coverage = 1;  // scalar part of the weight: what it takes from layers below
    Spectrum weight{1.0f};
    Spectrum tint_transmission{1.0f};
    // Schlick: reflectances; conductor: eta and k; eon: albedo; dielectric: color0 tints
    // reflection.
    Spectrum color0{1.0f}, color90{};
    Spectrum edge{};  // schlick: what is taken off towards 82°, see fresnel.hpp
};

// A layer on top: what lies below is scaled by what it lets through both ways; see layering.hpp.
struct Cover {
    uint8_t lobe_first = 0, lobe_last = 0;  // [first, last): the lobes of the layer
    uint8_t above = no_cover;               // next layer on top of this one
    float inverse_scale = 1;                // undoes factors that scaled layer and base together
    // Cosine-weighted mean of what this layer and all above it let through: from outside, inside.
    Spectrum average[2] = {};
};

struct ClosureSample {
    Vec3f direction;  // world; unit
    Spectrum value;   // the component's value, roles as in evaluate
    float pdf = 0;    // solid angle at `direction`, given the known direction
    Component component = non_delta;
};

// Which of the two directions is known when the other is sampled.
enum class Known : uint8_t { eye, light };

struct Closure {
    Frame shading;           // z: shading normal, same side as the geometric normal
    Vec3f geometric_normal;  // unit
    Spectrum emission;       // radiance, the same in all directions
    int lobe_count = 0;
    int cover_count = 0;
    bool has_non_delta = false;  // some lobe is not Dirac: the point can be connected
    bool is_lambert = false;     // one Lambert lobe and nothing else: the short way
    bool is_phase = false;       // a point of a medium: its one lobe is σ_s times `phase`
    PhaseFunction phase;
    // Where walks from the eye look for light, besides where the lobes send them; null: nowhere.
    const DirectionGuide* guide = nullptr;
    // In unions so that a closure is made without touching the lobes that it does not use.
    union {
        Lobe lobes[max_lobes];
    };
    union {
        Cover covers[max_lobes];
    };

    Closure() {}
    Closure(const Closure& other) { *this = other; }
    Closure& operator=(const Closure& other) {
        shading = other.shading;
        geometric_normal = other.geometric_normal;
        return copy_scattering(other);
    }
    // Everything but the normals.
    Closure& copy_scattering(const Closure& other) {
        emission = other.emission;
        lobe_count = other.lobe_count;
        cover_count = other.cover_count;
        has_non_delta = other.has_non_delta;
        is_lambert = other.is_lambert;
        is_phase = other.is_phase;
        phase = other.phase;
        guide = other.guide;
        if (lobe_count == 1)  // mostly, and not worth a call of memcpy
            lobes[0] = other.lobes[0];
        else
            std::copy_n(other.lobes, lobe_count, lobes);
        std::copy_n(other.covers, cover_count, covers);
        return *this;
    }

    // f(to_light → to_eye) of the component, without cosine. Zero where the geometric and the
    // shading normal disagree about the side of either direction.
    Spectrum evaluate(Vec3f to_light, Vec3f to_eye, Component component = non_delta) const {
        if (!is_lambert) return evaluate_lobes(to_light, to_eye, component);
        return component == non_delta && same_side(to_light, to_eye) ? lobes[0].weight * inv_pi
                                                                     : Spectrum();
    }

    // Of the non-Dirac component, the part of its diffuse lobes.
    Spectrum evaluate_diffuse(Vec3f to_light, Vec3f to_eye) const;

    // About the share of the light from all around that is scattered to the eye, or let through.
    Spectrum albedo(Vec3f to_eye) const;

    // Density of `sampled` in solid angle given `known`; selection probabilities included.
    float pdf(Vec3f known, Vec3f sampled, Known role, Component component = non_delta) const {
        if (guide && role == Known::eye) return pdf_guided(known, sampled, component);
        return pdf_scattering(known, sampled, role, component);
    }
    // The same without guide.
    float pdf_scattering(Vec3f known, Vec3f sampled, Known role, Component component) const {
        if (!is_lambert) return pdf_lobes(known, sampled, role, component);
        return component == non_delta && same_side(known, sampled)
                   ? abs_dot(sampled, shading.z) * inv_pi
                   : 0.0f;
    }

    // Samples the missing direction. u: lobe choice and Fresnel choice by u_lobe (rescaled), the
    // direction by u. False where nothing is scattered (absorbed, or sides disagree).
    bool sample(Vec3f known, Known role, float u_lobe, Vec2f u, ClosureSample& out) const {
        if (guide && role == Known::eye) return sample_guided(known, u_lobe, u, out);
        return sample_scattering(known, role, u_lobe, u, out);
    }
    bool sample_scattering(Vec3f known, Known role, float u_lobe, Vec2f u,
                           ClosureSample& out) const {
        if (!is_lambert) return sample_lobes(known, role, u_lobe, u, out);
        Vec3f local = square_to_cosine_hemisphere(u);
        if (dot(known, shading.z) < 0) local.z = -local.z;
        out.direction = shading.to_world(local);
        out.value = lobes[0].weight * inv_pi;
        out.pdf = std::fabs(local.z) * inv_pi;
        out.component = non_delta;
        return out.pdf > 0 && same_side(known, out.direction);
    }

    // The one direction into which a Dirac component scatters light from (or importance to)
    // `known`; false where it does not.
    bool delta_direction(Vec3f known, Component component, Vec3f& sampled) const;

    // |cosθ|·η² of a direction: what turns a discrete probability of a Dirac component into pdf.
    float delta_measure(Vec3f sampled, Component component) const {
        return abs_dot(sampled, shading.z) * sqr(eta_of_side(sampled, component));
    }

    // Relative index on the side of `direction` for a Dirac component (1 outside).
    float eta_of_side(Vec3f direction, Component component) const {
        if (component == non_delta || dot(direction, geometric_normal) >= 0) return 1;
        const Lobe& lobe = lobes[lobe_of(component)];
        return lobe.is_interface ? lobe.eta : 1;
    }

private:
    // Both on the same side, by both normals.
    bool same_side(Vec3f a, Vec3f b) const {
        const float a_s = dot(a, shading.z), b_s = dot(b, shading.z);
        const float a_g = dot(a, geometric_normal), b_g = dot(b, geometric_normal);
        return a_s * a_g > 0 && b_s * b_g > 0 && a_s * b_s > 0;
    }
    float pdf_guided(Vec3f known, Vec3f sampled, Component component) const;
    bool sample_guided(Vec3f known, float u_lobe, Vec2f u, ClosureSample& out) const;
    Spectrum evaluate_lobes(Vec3f to_light, Vec3f to_eye, Component component) const;
    float pdf_lobes(Vec3f known, Vec3f sampled, Known role, Component component) const;
    bool sample_lobes(Vec3f known, Known role, float u_lobe, Vec2f u, ClosureSample& out) const;
};

}  // namespace usdmlt
