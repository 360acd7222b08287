#include "media/optical_depth.hpp"

namespace usdmlt {
namespace {

// Where ∫ density from a on is `wanted`; it is not less up to b. The integral grows with t, so that
// halving finds the place to the last bit or two.
float find_in_piece(const DensityGrid& grid, const DensityGrid::Ray& ray, float a, float b,
                    double wanted) {
    float low = a, high = b;
    for (int i = 0; i < 24 && low < high; ++i) {
        const float middle = 0.5f * (low + high);
        (grid.integral(ray, a, middle) < wanted ? low : high) = middle;
    }
    return 0.5f * (low + high);
}

}  // namespace

double integrated_density(const Medium& medium, const Ray& ray, float t0, float t1) {
    if (medium.grid.empty()) return double(t1) - double(t0);
    double sum = 0;
    medium.grid.march(ray.origin, ray.direction, t0, t1,
                      [&](const DensityGrid::Ray& in_grid, float a, float b) {
                          sum += medium.grid.integral(in_grid, a, b);
                          return true;
                      });
    return sum;
}

OpticalDepth optical_depth(const Media& media, const Ray& ray, Media::Scratch& scratch) {
    OpticalDepth depth;
    media.for_each_stretch(ray, scratch, [&](const Medium& medium, float t0, float t1) {
        const double density = integrated_density(medium, ray, t0, t1);
        for (int c = 0; c < 3; ++c) {
            const double tau = medium.extinction[c] * density;
            depth.all[c] += tau;
            if (medium.scatters) depth.sampled[c] += tau;
        }
        return true;
    });
    return depth;
}

Collision sample_collision(const Media& media, const Ray& ray, RandomStream& random,
                           Media::Scratch& scratch) {
    Collision out;
    const int channel = std::min(static_cast<int>(random.next_double() * 3), 2);
    double left = -std::log1p(-random.next_double());  // optical depth
    media.for_each_stretch(ray, scratch, [&](const Medium& medium, float t0, float t1) {
        const double extinction = medium.extinction[channel];
        if (!medium.scatters || extinction == 0) return true;
        if (medium.grid.empty()) {
            const double t = t0 + left / extinction;
            if (t < t1) {
                out = {&medium, static_cast<float>(t)};
                return false;
            }
            left -= extinction * (double(t1) - double(t0));
            return true;
        }
        return medium.grid.march(
            ray.origin, ray.direction, t0, t1,
            [&](const DensityGrid::Ray& in_grid, float a, float b) {
                const double depth = extinction * medium.grid.integral(in_grid, a, b);
                if (left < depth) {
                    out = {&medium,
                           find_in_piece(medium.grid, in_grid, a, b, left / extinction)};
                    return false;
                }
                left -= depth;
                return true;
            });
    });
    return out;
}

Collision collision_at(const Media& media, const Ray& ray, float t, Media::Scratch& scratch) {
    Collision out;
    media.for_each_stretch(ray, scratch, [&](const Medium& medium, float t0, float t1) {
        if (t >= t0 && t < t1 && medium.scatters) out = {&medium, t};
        return t >= t1;
    });
    return out;
}

}  // namespace usdmlt
