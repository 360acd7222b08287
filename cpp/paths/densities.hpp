// Densities with which one vertex of a path generates the next, in area measure: their only place.
// Integrators, weights and mutations call these.
#pragma once

#include "paths/vertex.hpp"
#include "scene/scene.hpp"

namespace usdmlt {

// p(x0 → x1): by the direction of a surface light, or the origin of a light at infinity. `edge` is
// the transmittance of the edge, which a traced ray survives with that probability.
inline double density_from_light(const Scene& scene, const Vertex& x0, const Vertex& x1,
                                 float edge) {
    const double pdf = x0.infinite ? pdf_origin(scene.lights)
                                   : pdf_direction(scene.lights, x0.light, direction_to(x0, x1));
    return area_density(pdf, x0, x1) * edge;
}

// p(lens → x): uniform over the film.
inline double density_from_lens(const Scene& scene, const Vertex& lens, const Vertex& x,
                                float edge) {
    const Camera& camera = scene.camera;
    const double pdf =
        camera.orthographic ? camera.pdf_origin() : camera.pdf_direction(direction_to(lens, x));
    return area_density(pdf, lens, x) * edge;
}

// p(from → v → to): by scattering of the component at v.
inline double density_by_scattering(const Vertex& v, const Vertex& from, const Vertex& to,
                                    Known role, float edge, Component component = non_delta) {
    const float pdf = v.closure.pdf(direction_to(v, from), direction_to(v, to), role, component);
    return area_density(pdf, v, to) * edge;
}

}  // namespace usdmlt
