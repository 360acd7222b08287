#include "mutations/caustic_perturbation.hpp"

namespace usdmlt {
namespace {

constexpr double direction_probability = 0.5;  // of a light at infinity
constexpr double largest_angle = 1.5;          // radians

// f(walk) for every walk from one rough vertex (or the light) to the next, if that can be joined to
// what follows.
template <bool glossy, typename F>
void for_each_walk(const Path& x, const F& f) {
    const int k = x.edges();
    Walk walk;
    walk.role = Known::light;
    walk.glossy = glossy;
    bool passed = k > 1 && is_passed(x, walk, 1);
    for (int i = 1; i < k; ++i) {
        const bool next_passed = i + 1 < k && is_passed(x, walk, i + 1);
        if (passed) {
            walk.half_vectors += !x.is_delta(i);
        } else {
            walk.end = i;
            // There is no distance from infinity to a point of a medium.
            if (!next_passed && (walk.half_vectors > 0) == glossy &&
                !(x[walk.start].infinite && x[walk.start + 1].is_medium()))
                f(walk);
            walk.start = i;
            walk.half_vectors = 0;
        }
        passed = next_passed;
    }
}

double length_of_edges(const Path& x, int first, int last) {
    double sum = 0;
    for (int i = first; i < last; ++i)
        if (!x[i].infinite && !x[i + 1].infinite) sum += length(x[i + 1].position - x[i].position);
    return sum;
}

// What a pixel is wide at x_n, in scene units.
double footprint(const MutationContext& context, const Path& x, int n) {
    const Camera& camera = context.scene.camera;
    const double pixel = camera.window_width / camera.width;
    return camera.orthographic ? pixel : pixel * length_of_edges(x, n, x.edges());
}

LogarithmicRange angles(const MutationContext& context, const Path& x, const Walk& walk) {
    const double scale = footprint(context, x, walk.end) / length_of_edges(x, walk.start, walk.end);
    return LogarithmicRange::of_a_decade_at_least(
        context.raster_range.min * scale,
        std::min(context.raster_range.max * scale, largest_angle));
}

LogarithmicRange offsets(const MutationContext& context, const Path& x, const Walk& walk) {
    const double scale = footprint(context, x, walk.end);
    return {context.raster_range.min * scale, context.raster_range.max * scale};
}

// Distance of p from the line through q along a unit direction.
double distance_from_line(Vec3f p, Vec3f q, Vec3f direction) {
    return length(cross(to_double(p - q), to_double(direction)));
}

// First ray from a light at infinity, and its density. Moves x_0 too if the change says so.
bool start_at_infinity(MutationContext& context, const Path& x, const Walk& walk, bool moves_light,
                       Path& y, Ray& ray, double& pdf) {
    RandomStream& random = context.random;
    const Lights& lights = context.scene.lights;
    if (moves_light) {
        const double angle = context.direction_range.sample(random.next_double());
        pdf *= context.direction_range.pdf_direction(angle);
        LightPoint point;
        const Vec3f direction = tilt(x[0].direction, angle, random.next_1d());
        if (!environment_point(lights, direction, x.time, point)) return false;
        light_vertex(context.scene, point, x.time, fresh(y, 0));
    }
    const LogarithmicRange range = offsets(context, x, walk);
    const double r = range.sample(random.next_double());
    pdf *= range.pdf_plane(r);
    const Vec3f direction = y[0].direction;
    const Frame frame = Frame::from_normal(direction);
    const float phi = 2 * pi * random.next_1d(), offset = static_cast<float>(r);
    const Vec3f on_plane =
        x[1].position + frame.x * (offset * std::cos(phi)) + frame.y * (offset * std::sin(phi));
    // From outside the scene's sphere.
    const float back =
        std::max(dot(lights.scene_center - on_plane, direction), 0.0f) + 2 * lights.scene_radius;
    ray = {on_plane + direction * back, 0, -direction, infinite_distance, x.time};
    return true;
}

}  // namespace

template <bool glossy>
bool CausticWalk<glossy>::applies(const MutationContext&, const Path& x) {
    return count_starts(x) > 0;
}

template <bool glossy>
int CausticWalk<glossy>::count_starts(const Path& x) {
    int count = 0;
    for_each_walk<glossy>(x, [&](const Walk&) { ++count; });
    return count;
}

template <bool glossy>
bool CausticWalk<glossy>::propose(MutationContext& context, const Path& x, Path& y,
                                  Change& change) {
    RandomStream& random = context.random;
    const int count = count_starts(x);
    int choice = std::min(static_cast<int>(random.next_double() * count), count - 1);
    Walk walk;
    for_each_walk<glossy>(x, [&](const Walk& w) {
        if (choice-- == 0) walk = w;
    });
    const int m = walk.start;

    const bool infinite = x[m].infinite;
    const bool moves_light =
        infinite && !x[0].light.delta && random.next_1d() < direction_probability;
    change = {moves_light ? -1 : m, walk.end + 1, 0, walk.end + 1};
    begin_replacement(context, x, change, walk.end - change.l, y);
    Ray ray;
    double pdf = 1;
    if (infinite) {
        if (!start_at_infinity(context, x, walk, moves_light, y, ray, pdf)) return false;
    } else {
        const LogarithmicRange range = angles(context, x, walk);
        const double angle = range.sample(random.next_double());
        pdf = range.pdf_direction(angle);
        ray = ray_from(x[m], tilt(x.to_eye(m), angle, random.next_1d()));
    }
    if (!trace_walk(context, x, walk, ray, pdf, y)) return false;
    if (infinite && !x[0].light.delta)
        context.recorded *= moves_light ? direction_probability : 1 - direction_probability;
    context.recorded *= 1.0 / count;
    y.at(walk.end + 1).edge = {};
    return walk.end + 1 < y.edges() || project_end(context, y);
}

template <bool glossy>
ScaledDouble CausticWalk<glossy>::density(MutationContext& context, const Path& x, const Path& y,
                                          const Change& change, const Path& range_of) {
    const bool moves_light = change.l == -1;
    const int start = moves_light ? 0 : change.l;
    Walk walk;
    int count = 0;
    for_each_walk<glossy>(x, [&](const Walk& w) {
        ++count;
        if (w.start == start) walk = w;
    });
    // Near-specular vertices may have become others.
    if (!walk.found() || walk.end + 1 != change.m) return 0;
    double pdf = 1.0 / count;
    if (x[walk.start].infinite) {
        if (!x[0].light.delta)
            pdf *= moves_light ? direction_probability : 1 - direction_probability;
        if (moves_light)
            pdf *= context.direction_range.pdf_direction(
                angle_between(x[0].direction, y[0].direction));
        const double r = distance_from_line(x[1].position, y[1].position, y[0].direction);
        const LogarithmicRange range = offsets(context, range_of, walk);
        if (!range.contains(r)) return 0;
        pdf *= range.pdf_plane(r);
    } else {
        const LogarithmicRange range = angles(context, range_of, walk);
        const double angle = angle_between(x.to_eye(walk.start), y.to_eye(walk.start));
        if (!range.contains(angle)) return 0;
        pdf *= range.pdf_direction(angle);
    }
    return walk_density(context, x, y, walk, kept_step_density(context, x, y, walk.start, 1, pdf));
}

template struct CausticWalk<false>;
template struct CausticWalk<true>;

}  // namespace usdmlt
