#include "media/optical_depth.hpp"

namespace usdmlt {
namespace {

// Where ∫ density is `wanted`; it is not less in the whole piece. The integral grows with t, so
// that halving finds the place to the last bit or two.
float find_in_piece(const DensityGrid::Piece& piece, double wanted) {
    float low = piece.a, high = piece.b;
    for (int i = 0; i < 24 && low < high; ++i) {
        const float middle = 0.5f * (low + high);
        (piece.integral_to(middle) < wanted ? low : high) = middle;
    }
    return 0.5f * (low + high);
}

}  // namespace

double integrated_density(const Medium& medium, const Ray& ray, float t0, float t1) {
    if (medium.grid.empty()) return double(t1) - double(t0);
    double sum = 0;
    medium.grid.march(ray.origin, ray.direction, t0, t1, [&](const DensityGrid::Piece& piece) {
        sum += piece.integral();
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

Spectrum glow(const Media& media, const Ray& ray, double u, Media::Scratch& scratch) {
    double sum[3] = {0, 0, 0};
    OpticalDepth depth;
    // A piece of constant or of cubic density, whose integral up to t is density(t).
    const auto add_piece = [&](const Medium& medium, float a, float b, const auto& density,
                               const auto& emission) {
        if (medium.emits) {
            const auto t = static_cast<float>(a + (double(b) - a) * u);
            const double before = density(t);
            OpticalDepth there = depth;
            for (int c = 0; c < 3; ++c) {
                there.all[c] += medium.extinction[c] * before;
                if (medium.scatters) there.sampled[c] += medium.extinction[c] * before;
            }
            const Attenuation to(there);
            const std::array<double, 3> e = emission(t);
            if (to.probability() > 0)
                for (size_t c = 0; c < 3; ++c)
                    sum[c] += e[c] * to.transmittance[c] / to.probability() * (double(b) - a);
        }
        const double all = density(b);
        for (int c = 0; c < 3; ++c) {
            depth.all[c] += medium.extinction[c] * all;
            if (medium.scatters) depth.sampled[c] += medium.extinction[c] * all;
        }
    };
    media.for_each_stretch(ray, scratch, [&](const Medium& medium, float t0, float t1) {
        if (!medium.grid.empty())
            return medium.grid.march(
                ray.origin, ray.direction, t0, t1, [&](const DensityGrid::Piece& piece) {
                    add_piece(
                        medium, piece.a, piece.b, [&](float t) { return piece.integral_to(t); },
                        [&](float t) {
                            const Vec3f p = piece.at(t);
                            const double density = medium.grid.density(p);
                            std::array<double, 3> e{};
                            if (!medium.grid.emission.empty()) e = medium.grid.emission_at(p);
                            for (size_t c = 0; c < 3; ++c)
                                e[c] += density * medium.emission[int(c)];
                            return e;
                        });
                    return true;
                });
        if (medium.scatters) {
            add_piece(
                medium, t0, t1, [&](float t) { return double(t) - t0; },
                [&](float) {
                    return std::array<double, 3>{medium.emission[0], medium.emission[1],
                                                 medium.emission[2]};
                });
            return true;
        }
        const Attenuation to(depth);
        const double p = to.probability(), length = double(t1) - t0;
        for (int c = 0; c < 3; ++c) {
            const double sigma = medium.extinction[c];
            const double absorbed = sigma > 0 ? -std::expm1(-sigma * length) / sigma : length;
            if (p > 0) sum[c] += medium.emission[c] * to.transmittance[c] / p * absorbed;
            depth.all[c] += sigma * length;
        }
        return true;
    });
    return {static_cast<float>(sum[0]), static_cast<float>(sum[1]), static_cast<float>(sum[2])};
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
        return medium.grid.march(ray.origin, ray.direction, t0, t1,
                                 [&](const DensityGrid::Piece& piece) {
                                     const double depth = extinction * piece.integral();
                                     if (left < depth) {
                                         out = {&medium, find_in_piece(piece, left / extinction)};
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
