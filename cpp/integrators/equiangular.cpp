#include "integrators/equiangular.hpp"

#include "paths/densities.hpp"

namespace usdmlt {

Spectrum equiangular_light(const Scene& scene, RandomStream& random,
                           const EquiangularRay& equiangular, const SubpathVertex& from,
                           const Ray& ray, const Spectrum& throughput, SubpathVertex& x0,
                           SubpathVertex& z, RayCounters& counters) {
    double pdf_light;
    if (!sample_light(scene, random, equiangular.reference(), ray.time, x0, pdf_light) ||
        x0.infinite)
        return {};
    const float t = equiangular.sample(x0.position, random.next_1d());
    if (!medium_point(scene, from, ray, t, counters, z, z.edge)) return {};
    const double pdf = equiangular.pdf(x0.position, z.position);
    z.to_previous = -ray.direction;
    z.throughput = throughput * z.edge.media_transmittance() * static_cast<float>(1 / pdf);
    const Spectrum value = join(scene, x0, nullptr, z, &from);
    if (is_black(value)) return {};
    const Edge edge = edge_between(scene, x0, z, counters);
    if (edge.is_blocked()) return {};
    const double p_b = pdf_light * pdf, p_t = z.edge.media_from_eye;
    const double p_a = p_t * pdf_direct(scene.lights, x0.light, z.position);
    const double p_c = x0.light.delta
                           ? 0
                           : p_t * density_by_scattering(z, z.to_previous, x0, direction_to(z, x0),
                                                         Known::eye, edge);
    const double weight = 1 / (1 + squared_ratio(p_a, p_b) + squared_ratio(p_c, p_b));
    return edge.through(value, weight);
}

}  // namespace usdmlt
