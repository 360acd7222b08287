#include "integrators/coarse_picture.hpp"

#include <cmath>

namespace usdmlt {
namespace {

constexpr float least_albedo = 0.01f;
// Sine of the angle between a surface and the line to a point that is still on it, roughly.
constexpr float tilt_of_surface = 0.2f;

// How far two cells show the same surface, 0 … 1.
float similarity(const SeenSurface& a, const SeenSurface& b) {
    const bool none_a = length_squared(a.normal) == 0, none_b = length_squared(b.normal) == 0;
    if (none_a || none_b) return none_a && none_b;
    const float cosine = dot(a.normal, b.normal);
    if (!(cosine > 0)) return 0;
    const Vec3f between = b.position - a.position;
    const float off =
        std::max(std::fabs(dot(a.normal, between)), std::fabs(dot(b.normal, between)));
    const float d2 = length_squared(between);
    const float tilt2 = d2 > 0 ? sqr(off / tilt_of_surface) / d2 : 0;
    const float ratio = std::min(a.albedo, b.albedo) / std::max(a.albedo, b.albedo);
    return sqr(sqr(sqr(sqr(cosine)))) * std::exp(-tilt2) * ratio;
}

}  // namespace

CoarsePicture::CoarsePicture(const RasterDomain& domain, double most_cells) : lower_(domain.lower) {
    const Vec2f size = domain.upper - domain.lower;
    const double fine = std::min(std::sqrt(most_cells / domain.area()), 1.0);
    across_ = std::max(static_cast<int>(size.x * fine), 1);
    down_ = std::max(static_cast<int>(size.y * fine), 1);
    scale_ = {float(across_) / size.x, float(down_) / size.y};
    sums_.resize(size_t(across_) * size_t(down_));
}

void CoarsePicture::smooth(const std::vector<SeenSurface>& seen, double cells) {
    constexpr float spline[3] = {6.0f / 16, 4.0f / 16, 1.0f / 16};
    for (size_t i = 0; i < sums_.size(); ++i) sums_[i] /= seen[i].albedo;
    std::vector<double> smoothed(sums_.size());
    for (int step = 1; sqr(2.0 * step) <= cells; step *= 2) {
        for (int y = 0; y < down_; ++y)
            for (int x = 0; x < across_; ++x) {
                const size_t here = size_t(y) * size_t(across_) + size_t(x);
                double sum = 0, total = 0;
                for (int dy = -2; dy <= 2; ++dy)
                    for (int dx = -2; dx <= 2; ++dx) {
                        const int i = x + dx * step, j = y + dy * step;
                        if (i < 0 || j < 0 || i >= across_ || j >= down_) continue;
                        const size_t there = size_t(j) * size_t(across_) + size_t(i);
                        const double weight = spline[std::abs(dx)] * spline[std::abs(dy)] *
                                              similarity(seen[here], seen[there]);
                        if (!(weight > 0)) continue;
                        sum += weight * sums_[there];
                        total += weight;
                    }
                smoothed[here] = total > 0 ? sum / total : sums_[here];
            }
        sums_.swap(smoothed);
    }
    for (size_t i = 0; i < sums_.size(); ++i) sums_[i] *= seen[i].albedo;
}

std::vector<SeenSurface> seen_surfaces(const Scene& scene, const CoarsePicture& picture,
                                       RayCounters& rays) {
    std::vector<SeenSurface> seen(picture.count());
    RandomStream random(0);
    Vertex eye, v;
    Edge edge;
    const Camera& camera = scene.camera;
    const Vec3f lens = camera.sample_lens({0.5f, 0.5f}, 0);
    camera_vertex(scene, lens, 0, eye);
    for (size_t i = 0; i < seen.size(); ++i) {
        const Ray ray = camera_ray(camera, picture.center(i), lens, 0);
        if (!trace_vertex(scene, eye, ray, Known::eye, false, random, rays, v, edge,
                          {MediaStop::Kind::nowhere}))
            continue;
        const bool front = dot(v.normal, ray.direction) < 0;
        seen[i] = {v.position, front ? v.normal : -v.normal,
                   std::clamp(luminance(v.closure.albedo(-ray.direction)), least_albedo, 1.0f)};
    }
    return seen;
}

}  // namespace usdmlt
