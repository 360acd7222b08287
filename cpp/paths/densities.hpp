// Densities with which one vertex of a path generates the next, in area measure: their only place.
// Integrators, weights and mutations call these.
#pragma once

#include "paths/edge.hpp"
#include "paths/vertex.hpp"
#include "scene/scene.hpp"

namespace usdmlt {

// p(x0 → x1): by the direction of a surface light, or the origin of a light at infinity.
// `direction` is unit, from x0 to x1; `edge` is what a traced ray has to get through.
inline double density_from_light(const Scene& scene, const Vertex& x0, const Vertex& x1,
                                 Vec3f direction, const Edge& edge) {
    const double pdf =
        x0.infinite ? pdf_origin(scene.lights) : pdf_direction(scene.lights, x0.light, direction);
    return area_density(pdf, x0, x1, direction) * edge.survival(Known::light);
}

// p(lens → x): uniform over the film.
inline double density_from_lens(const Scene& scene, const Vertex& lens, const Vertex& x,
                                Vec3f direction, const Edge& edge) {
    return area_density(scene.camera.pdf_ray(direction, lens.time), lens, x, direction) *
           edge.survival(Known::eye);
}

// p(known → v → to): by scattering of the component at v; `known` and `direction` leave v, the
// latter towards `to`.
inline double density_by_scattering(const Vertex& v, Vec3f known, const Vertex& to, Vec3f direction,
                                    Known role, const Edge& edge, Component component = non_delta) {
    const float pdf = v.closure.pdf(known, direction, role, component);
    return area_density(pdf, v, to, direction) * edge.survival(role);
}

}  // namespace usdmlt
