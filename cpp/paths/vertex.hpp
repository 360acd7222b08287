// A vertex of a path: x0 on a light, xk on the lens, points of surfaces and media between.
#pragma once

#include <cstdint>

#include "geometry/acceleration.hpp"
#include "lights/light.hpp"
#include "materials/closure.hpp"

namespace usdmlt {

enum class VertexKind : uint8_t { camera, light, surface, medium };

struct Vertex {
    VertexKind kind = VertexKind::surface;
    bool infinite = false;            // a direction, not a point: `direction`
    bool is_light = false;            // `light` is set: the vertex can be a path's x0
    bool one_sided = false;           // it is there only where the eye sees its front
    Component component = non_delta;  // how the path scatters here
    Vec3f position;
    Vec3f normal;              // geometric; the view axis on the lens; of no meaning in media
    Vec3f direction;           // infinite: unit, from the scene towards it
    float position_error = 0;  // bound of the position's rounding error, scene units
    float opacity = 1;         // fraction of the surface that is there
    float time = 0;            // of the path; see motion.hpp
    uint32_t mesh = invalid_index, triangle = 0, instance = invalid_index;
    Vec2f uv;  // barycentrics, or a shape's parameters
    LightPoint light;
    Spectrum collision;  // media only: density, per length, of the stop of a traced ray
    Closure closure;     // surfaces and media only

    bool is_surface() const { return kind == VertexKind::surface; }
    bool is_medium() const { return kind == VertexKind::medium; }
    bool can_scatter() const { return kind >= VertexKind::surface; }
    // Whether it is there for what is on that side.
    bool is_seen_from(Vec3f direction) const { return !one_sided || dot(normal, direction) > 0; }
    bool can_connect() const { return !can_scatter() || closure.has_non_delta; }
};

// Unit direction from a to b.
inline Vec3f direction_to(const Vertex& a, const Vertex& b) {
    if (b.infinite) return b.direction;
    if (a.infinite) return -a.direction;
    const Vec3f d = b.position - a.position;
    const float r2 = length_squared(d);
    return r2 > 0 ? d * (1 / std::sqrt(r2)) : Vec3f{0, 0, 1};  // where G = 0, any
}

// A point of the surface pushed off it by its rounding error, to the side of `direction`.
inline Vec3f offset_origin(const Vertex& v, Vec3f direction) {
    const float d = dot(v.normal, direction) < 0 ? -v.position_error : v.position_error;
    return v.position + v.normal * d;
}

// ---- densities and geometry terms: their only place ------------------------------------------

// Points of media count in volume: they have no normal, and no cosine.
inline float abs_cosine(const Vertex& v, Vec3f direction) {
    return v.is_medium() ? 1 : abs_dot(v.normal, direction);
}

// Both take the edge's unit direction (of either sign), which callers have at hand.

// Geometry term of the edge a–b in area measure:
//     G = |cosθa cosθb| / r²,   and |cosθb| where a is at infinity (a direction, solid angle).
inline double geometry_term(const Vertex& a, const Vertex& b, Vec3f direction) {
    if (a.infinite) return abs_cosine(b, direction);
    if (b.infinite) return abs_cosine(a, direction);
    const double r2 = length_squared(b.position - a.position);
    if (r2 == 0) return 0;
    return double(abs_cosine(a, direction)) * abs_cosine(b, direction) / r2;
}

// Converts the density with which `from` generates `to` into area measure:
//     p_A(to) = p_ω |cosθ_to| / r²;
// from a vertex at infinity, p is the area density of the ray's origin: p_A = p |cosθ_to|; towards
// infinity it stays in solid angle. The stop at a partly opaque surface is part of it; that at a
// point of a medium is the edge's.
inline double area_density(double pdf, const Vertex& from, const Vertex& to, Vec3f direction) {
    if (to.infinite) return pdf;
    const double projected = pdf * abs_cosine(to, direction) * to.opacity;
    if (from.infinite) return projected;
    const double r2 = length_squared(to.position - from.position);
    return r2 > 0 ? projected / r2 : 0;
}

// Scattering at a vertex in the area-product measure: f·|cosθ_s|/|cosθ_g| at the light's side. The
// ratio is Veach's adjoint correction for shading normals (1997, §5.3), written for light that
// travels from `to_light` to `to_eye`; geometry terms use geometric normals.
inline Spectrum scattering(const Vertex& v, Vec3f to_light, Vec3f to_eye,
                           Component component = non_delta) {
    if (!v.is_seen_from(to_eye)) return {};
    const Spectrum f = v.closure.evaluate(to_light, to_eye, component);
    if (v.is_medium()) return f;
    const float cos_g = abs_dot(to_light, v.normal);
    if (is_black(f) || cos_g == 0) return {};
    return f * (abs_dot(to_light, v.closure.shading.z) / cos_g);
}

// Throughput factor of sampling a direction at a vertex: scattering·|cosθ_g(sampled)|/p.
inline Spectrum sampling_weight(const Vertex& v, Vec3f known, Known role,
                                const ClosureSample& sample) {
    if (v.is_medium()) return sample.value * (1 / sample.pdf);
    if (role == Known::eye)
        return sample.value * (abs_dot(sample.direction, v.closure.shading.z) / sample.pdf);
    const float cos_g = abs_dot(known, v.normal);
    if (cos_g == 0 || !v.is_seen_from(sample.direction)) return {};
    return sample.value * (abs_dot(known, v.closure.shading.z) *
                           abs_dot(sample.direction, v.normal) / (cos_g * sample.pdf));
}

// (η_sampled/η_known)² of a Dirac refraction traced from the eye, else 1: undoes the scaling of
// radiance, which is no loss of light and must not end walks that enter glass.
inline float refraction_scale(const Vertex& v, Vec3f known, Known role,
                              const ClosureSample& sample) {
    if (role == Known::light || sample.component == non_delta) return 1;
    return sqr(v.closure.eta_of_side(sample.direction, sample.component) /
               v.closure.eta_of_side(known, sample.component));
}

}  // namespace usdmlt
