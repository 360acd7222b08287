#include "integrators/coarse_picture.hpp"

#include <cmath>

namespace usdmlt {
namespace {

constexpr float least_albedo = 0.01f;
// Sine of the angle between a surface and the line to a point that is still on it, roughly.
constexpr float tilt_of_surface = 0.2f;

// What is seen in all cells, in arrays that loops are vectorised over.
struct SeenArrays {
    std::vector<float> x, y, z, nx, ny, nz, albedo, nothing;  // nothing: 1 where nothing is seen

    explicit SeenArrays(const std::vector<SeenSurface>& seen) {
        for (const SeenSurface& s : seen) {
            x.push_back(s.position.x);
            y.push_back(s.position.y);
            z.push_back(s.position.z);
            nx.push_back(s.normal.x);
            ny.push_back(s.normal.y);
            nz.push_back(s.normal.z);
            albedo.push_back(s.albedo);
            nothing.push_back(length_squared(s.normal) == 0 ? 1.0f : 0.0f);
        }
    }
};

// Adds, for cells a + i and b + i, values[b + i] weighted by how far they show the same surface,
// and the weights; the normals' cosine is 0 where nothing is seen in one of them.
void add_similar(const SeenArrays& seen, size_t a, size_t b, size_t count, float share,
                 const double* values, double* __restrict sums, double* __restrict totals) {
    const float *x = seen.x.data(), *y = seen.y.data(), *z = seen.z.data();
    const float *nx = seen.nx.data(), *ny = seen.ny.data(), *nz = seen.nz.data();
    const float *albedo = seen.albedo.data(), *nothing = seen.nothing.data();
    for (size_t i = 0; i < count; ++i) {
        const size_t p = a + i, q = b + i;
        const float cosine = std::max(nx[p] * nx[q] + ny[p] * ny[q] + nz[p] * nz[q], 0.0f);
        const float dx = x[q] - x[p], dy = y[q] - y[p], dz = z[q] - z[p];
        const float off = std::max(std::fabs(nx[p] * dx + ny[p] * dy + nz[p] * dz),
                                   std::fabs(nx[q] * dx + ny[q] * dy + nz[q] * dz));
        const float distance2 = std::max(dx * dx + dy * dy + dz * dz, 1e-30f);
        // About exp(−tilt²).
        const float tilt2 = sqr(off * (1 / tilt_of_surface)) / distance2;
        const float flat = sqr(sqr(std::max(1 - 0.25f * tilt2, 0.0f)));
        const float ratio = std::min(albedo[p], albedo[q]) / std::max(albedo[p], albedo[q]);
        const float weight =
            share * (sqr(sqr(sqr(cosine))) * flat * ratio + nothing[p] * nothing[q]);
        sums[i] += double(weight) * values[q];
        totals[i] += double(weight);
    }
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
    const SeenArrays arrays(seen);
    for (size_t i = 0; i < sums_.size(); ++i) sums_[i] /= seen[i].albedo;
    std::vector<double> smoothed(sums_.size()), totals(sums_.size());
    for (int step = 1; sqr(2.0 * step) <= cells; step *= 2) {
        std::ranges::fill(smoothed, 0.0);
        std::ranges::fill(totals, 0.0);
        for (int y = 0; y < down_; ++y)
            for (int dy = -2; dy <= 2; ++dy)
                for (int dx = -2; dx <= 2; ++dx) {
                    const int row = y + dy * step, shift = dx * step;
                    const int first = std::max(-shift, 0),
                              last = std::min(across_ - shift, across_);
                    if (row < 0 || row >= down_ || first >= last) continue;
                    const auto here = size_t(y * across_ + first);
                    add_similar(arrays, here, size_t(row * across_ + first + shift),
                                size_t(last - first), spline[std::abs(dx)] * spline[std::abs(dy)],
                                sums_.data(), &smoothed[here], &totals[here]);
                }
        for (size_t i = 0; i < sums_.size(); ++i)
            if (totals[i] > 0) sums_[i] = smoothed[i] / totals[i];
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
