#include "paths/connect.hpp"

#include "paths/densities.hpp"
#include "paths/emission.hpp"

namespace usdmlt {
double strategy_weight(const Scene& scene, const SubpathVertex* x, const SubpathVertex* x_previous,
                       int s, const SubpathVertex& z, const SubpathVertex* z_previous, int t,
                       const LightDensities& densities, const Edge& edge) {
    // k = 1: light seen directly has one strategy.
    if (s + t == 2) return 1;

    const Vec3f to_z = x ? direction_to(*x, z) : Vec3f{}, to_x = -to_z;
    double towards_light = 0;  // strategies with fewer light vertices than s
    if (s >= 1) {
        const double p_eye =
            z_previous ? density_by_scattering(z, z.to_previous, *x, to_x, Known::eye, edge)
                       : density_from_lens(scene, z, *x, to_x, edge);
        if (s == 1) {
            towards_light = x->light.delta ? 0 : squared_ratio(p_eye, densities.direct);
        } else {
            const double p_eye_previous =
                density_by_scattering(*x, to_z, *x_previous, x->to_previous, Known::eye, x->edge);
            double r1 = squared_ratio(p_eye, x->pdf_forward);
            double r2 = squared_ratio(p_eye_previous, x_previous->pdf_forward);
            const double direct = squared_ratio(densities.direct, densities.point);
            if (s == 2) {
                r1 *= direct;
                r2 = squared_ratio(p_eye_previous, densities.direct);
            } else if (s == 3) {
                r2 *= direct;
            }
            const bool joins = x_previous->component == non_delta && x_previous->can_connect();
            towards_light = r1 * ((joins ? 1 : 0) + r2 * x_previous->strategy_sum);
        }
    }

    double towards_eye = 0;  // strategies with fewer camera vertices than t
    if (t >= 2) {
        double p_light, p_light_previous;
        if (s == 0) {
            p_light = densities.direct;
            p_light_previous = density_from_light(scene, z, *z_previous, z.to_previous, z.edge) *
                               (densities.direct > 0 ? densities.point / densities.direct : 0);
        } else {
            if (s == 1)
                p_light = density_from_light(scene, *x, z, to_z, edge) *
                          (densities.direct > 0 ? densities.point / densities.direct : 0);
            else
                p_light = density_by_scattering(*x, x->to_previous, z, to_z, Known::light, edge);
            p_light_previous = t > 2 ? density_by_scattering(z, to_x, *z_previous, z.to_previous,
                                                             Known::light, z.edge)
                                     : 0;
        }
        const bool joins = z_previous->component == non_delta && z_previous->can_connect();
        towards_eye = squared_ratio(p_light, z.pdf_forward) *
                      ((joins ? 1 : 0) + squared_ratio(p_light_previous, z_previous->pdf_forward) *
                                             z_previous->strategy_sum);
    }
    return 1 / (1 + towards_light + towards_eye);
}

Spectrum emitted_contribution(const Scene& scene, const Subpath& camera, int t) {
    const SubpathVertex& z = camera[t - 1];
    return z.throughput * emission(scene, z, camera[t - 2], z.to_previous);
}

LightDensities light_densities(const Scene& scene, const SubpathVertex& x0,
                               const SubpathVertex& x1) {
    return {pdf_point(scene.lights, x0.light), pdf_direct(scene.lights, x0.light, x1.position)};
}

Spectrum join(const Scene& scene, const SubpathVertex& x, const SubpathVertex* x_previous,
              const SubpathVertex& z, const SubpathVertex* z_previous) {
    const Vec3f to_z = direction_to(x, z), to_x = -to_z;
    Spectrum value = x.throughput * z.throughput;
    if (z_previous)
        value *= scattering(z, to_x, z.to_previous);
    else
        value *=
            static_cast<float>(scene.camera.importance(to_x, z.time) / scene.camera.pdf_lens());
    if (is_black(value)) return {};
    if (x_previous)
        value *= scattering(x, x.to_previous, to_z);
    else
        value *= emission(scene, x, z, to_z) * x.opacity;
    if (is_black(value)) return {};
    return value * static_cast<float>(geometry_term(x, z, to_z));
}

}  // namespace usdmlt
