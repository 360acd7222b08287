#include "mutations/lens_perturbation.hpp"

namespace usdmlt {
namespace {

// Distances that the lens point moves, in scene units.
LogarithmicRange lens_range(const Camera& camera) {
    return {0.01 * camera.lens_radius, 0.5 * camera.lens_radius};
}

constexpr double lens_probability = 0.5;

Vec2f polar(double r, float u) {
    return Vec2f{std::cos(2 * pi * u), std::sin(2 * pi * u)} * static_cast<float>(r);
}

double distance(Vec2f a, Vec2f b) {
    return std::sqrt(sqr(double(a.x) - b.x) + sqr(double(a.y) - b.y));
}

}  // namespace

template <LensWalkKind kind>
bool LensWalk<kind>::propose(MutationContext& context, const Path& x, Path& y, Change& change) {
    const Walk walk = walk_of(x);
    const Scene& scene = context.scene;
    const Camera& camera = scene.camera;
    RandomStream& random = context.random;
    const int k = x.edges();
    const double r = context.raster_range.sample(random.next_double());
    const Vec2f raster = x.raster + polar(r, random.next_1d());
    if (!context.domain.contains(raster)) return false;
    // Per pixel², and from there to the density of raster points uniform over the image.
    double pdf = context.raster_range.pdf_plane(r) * context.domain.image_area;
    Vec3f lens = x[k].position;
    bool moves_lens = false;
    if (camera.lens_radius > 0) {
        moves_lens = random.next_1d() < lens_probability;
        pdf *= moves_lens ? lens_probability : 1 - lens_probability;
    }
    if (moves_lens) {
        const double move = lens_range(camera).sample(random.next_double());
        const Vec2f d = polar(move, random.next_1d());
        pdf *= lens_range(camera).pdf_plane(move);
        const CameraPose pose = camera.pose(x.time);
        lens = lens + pose.right * d.x + pose.up * d.y;
        if (length(lens - pose.position) >= camera.lens_radius) return false;
    }
    change = {walk.end - 1, moves_lens ? k + 1 : k, 0, walk.end > 0 ? walk.end : -1};
    begin_replacement(context, x, change, k - walk.end + (moves_lens ? 1 : 0), y);
    if (moves_lens) camera_vertex(scene, lens, x.time, fresh(y, k));
    y.raster = raster;
    const Ray ray = camera_ray(camera, raster, lens, x.time);
    pdf *= camera.pdf_ray(ray.direction, x.time);
    if (!trace_walk(context, x, walk, ray, pdf, y)) return false;
    if (walk.end > 0) y.at(walk.end).edge = {};
    return true;
}

template <LensWalkKind kind>
ScaledDouble LensWalk<kind>::density(MutationContext& context, const Path& x, const Path& y,
                                     const Change& change) {
    const Walk walk = walk_of(x);
    if (walk.end != change.l + 1) return 0;  // near-specular vertices became others
    const Camera& camera = context.scene.camera;
    const int k = y.edges();
    const double r = distance(x.raster, y.raster);
    double first = context.raster_range.pdf_plane(r) * context.domain.image_area *
                   kept_step_density(context, x, y, k, -1, camera.pdf_ray(y.to_light(k), y.time));
    if (camera.lens_radius > 0) {
        first *= change.m == k + 1
                     ? lens_probability *
                           lens_range(camera).pdf_plane(length(y[k].position - x[k].position))
                     : 1 - lens_probability;
    }
    return walk_density(context, x, y, walk, first);
}

template struct LensWalk<LensWalkKind::plain>;
template struct LensWalk<LensWalkKind::inner_chains>;
template struct LensWalk<LensWalkKind::glossy>;
template struct LensWalk<LensWalkKind::aimed>;

}  // namespace usdmlt
