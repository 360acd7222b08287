// Equiangular sampling (Kulla & Fajardo 2012): where light of a near lamp is scattered towards the
// eye. A distance along a ray is drawn such that the angle at a point of the lamp is uniform, which
// cancels the 1/r² of the light that arrives.
//
// One of three ways to make a path x0, z, x2 …, z being a point of a medium on the ray from x2:
//     p_B = p_D(x0 | x2) q(t | x0)            this one,
//     p_A = p(t) p_D(x0 | z)                  a collision, and next-event estimation there,
//     p_C = p(t) p_ω(x0 | z)                  a collision, and scattering that meets the lamp,
// combined by the power heuristic.
#pragma once

#include "paths/connect.hpp"

namespace usdmlt {

// The ray of one edge from the eye, up to the surface that it meets.
class EquiangularRay {
public:
    EquiangularRay() = default;  // makes nothing
    EquiangularRay(const Vertex& from, const Ray& ray)
        : active_(true),
          reference_(from.infinite ? ray.origin : from.position),
          origin_(ray.origin),
          direction_(ray.direction),
          t0_(ray.tnear),
          t1_(ray.tfar) {}

    // From where the light's point is chosen.
    Vec3f reference() const { return reference_; }

    float sample(Vec3f light, float u) const {
        const Angles a(*this, light);
        const double t = a.nearest + a.distance * std::tan(a.first + (a.last - a.first) * u);
        return static_cast<float>(std::clamp(t, double(t0_), double(t1_)));
    }
    // Per length, at the point z of the ray.
    double pdf(Vec3f light, Vec3f z) const {
        const Angles a(*this, light);
        const double s = dot(to_double(z - origin_), to_double(direction_)) - a.nearest;
        return a.distance / ((a.last - a.first) * (a.distance * a.distance + s * s));
    }
    // p_B of a path whose x0 and z were made otherwise.
    double density(const Lights& lights, const Vertex& x0, const Vertex& z) const {
        if (!active_ || x0.infinite) return 0;
        return pdf_direct(lights, x0.light, reference_) * pdf(x0.position, z.position);
    }

private:
    struct Angles {
        double nearest, distance, first, last;  // the point of the ray's line nearest to the light

        Angles(const EquiangularRay& ray, Vec3f light) {
            const Vec3d d = to_double(ray.direction_), to_light = to_double(light - ray.origin_);
            nearest = dot(to_light, d);
            distance = std::max(length(cross(to_light, d)), 1e-6 * length(to_light) + 1e-30);
            first = std::atan((ray.t0_ - nearest) / distance);
            last = std::atan((ray.t1_ - nearest) / distance);
        }
    };
    bool active_ = false;
    Vec3f reference_, origin_, direction_;
    float t0_ = 0, t1_ = 0;
};

// Light of a lamp scattered once on the ray, by p_B; the ray starts at `from` with `throughput`.
// Leaves the light's point in x0 and the medium's in z.
Spectrum equiangular_light(const Scene& scene, RandomStream& random,
                           const EquiangularRay& equiangular, const SubpathVertex& from,
                           const Ray& ray, const Spectrum& throughput, SubpathVertex& x0,
                           SubpathVertex& z, RayCounters& counters);

}  // namespace usdmlt
