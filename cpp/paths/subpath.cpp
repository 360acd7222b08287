#include "paths/subpath.hpp"

#include "paths/densities.hpp"
#include "paths/emission.hpp"

namespace usdmlt {
namespace {

// Scatterings before roulette starts.
constexpr int roulette_start = 2;

// Walks on from the last vertex of `path` along `ray`, whose direction (or origin, from infinity)
// has density `pdf`; the throughput that arrives is `emitted` × `scale`.
void walk(const Scene& scene, Sampler& sampler, Known role, Ray ray, double pdf, Spectrum emitted,
          float scale, int max_vertices, RayCounters& counters, Subpath& path) {
    Spectrum weight = emitted * scale;
    const float start = max_component(weight);
    float not_lost = 1;  // undoes what took throughput but no light
    float survival = 1;
    float left = start;  // what the walk had when it left the vertex before
    int rough = 0;       // non-Dirac scatterings
    for (;;) {
        SubpathVertex& previous = path[path.count - 1];
        SubpathVertex& v = path[path.count];
        counters.wants_glow = role == Known::eye;
        const bool found = trace_vertex(scene, previous, ray, role, role == Known::eye,
                                        sampler.stream(), counters, v, v.edge);
        if (role == Known::eye && scene.media.emit()) [[unlikely]] {
            path.glow[static_cast<size_t>(path.count - 1)] = weight * counters.glow;
            path.edges_with_glow = path.count;
            path.last_direction = ray.direction;
        }
        if (!found) return;
        if (role == Known::light && path.count == 1 && !scene.lights.links.empty()) {
            // What the light gives depends on what the ray has met.
            weight = emission(scene, previous, v, ray.direction) * scale;
            if (is_black(weight)) return;
        }
        if (!scene.media.empty()) [[unlikely]]
            weight *= v.edge.media_weight(role);
        v.throughput = weight;
        v.survival = survival;
        v.to_previous = -ray.direction;
        v.pdf_forward = area_density(pdf, previous, v, ray.direction) * v.edge.survival(role);
        v.pdf_reverse = 0;
        v.strategy_sum = 0;
        ++path.count;
        if (role == Known::light && path.count == 2)
            path.pdf_direct = pdf_direct(scene.lights, previous.light, v.position);
        if (path.count == max_vertices || v.infinite || v.closure.lobe_count == 0) return;

        const Vec3f known = v.to_previous;
        const Vec2f u = sampler.next_2d();
        const Vec2f choice = sampler.next_2d();
        ClosureSample sample;
        if (!v.closure.sample(known, role, choice.x, u, sample)) return;
        v.component = sample.component;
        const Known reverse = role == Known::eye ? Known::light : Known::eye;
        previous.pdf_reverse = density_by_scattering(v, sample.direction, previous, known, reverse,
                                                     v.edge, sample.component);
        // Strategy that would join the previous vertex to this one.
        const int n = path.count - 1;
        const bool joins =
            v.component == non_delta && previous.component == non_delta && previous.can_connect();
        double ratio = squared_ratio(previous.pdf_reverse, previous.pdf_forward);
        if (role == Known::light) {
            // x0 is sampled differently when it is joined to x1 (next-event estimation).
            if (n == 1) {
                ratio = squared_ratio(previous.pdf_reverse, path.pdf_direct);
            } else if (n == 2) {
                ratio *= squared_ratio(path.pdf_direct, path.pdf_point);
            }
        }
        v.strategy_sum = (joins ? 1 : 0) + ratio * previous.strategy_sum;

        const float before = max_component(weight);
        weight *= sampling_weight(v, known, role, sample);
        not_lost *= refraction_scale(v, known, role, sample);
        // A guide's density is high where the light is, not where little of it goes on.
        if (v.closure.guide && role == Known::eye && max_component(weight) > 0)
            not_lost *= before / max_component(weight);
        const float w = max_component(weight) * not_lost;
        if (!(w > 0)) return;
        float q = 1;
        if (path.roulette) {
            if (n > roulette_start) q = continuation_probability(w / start);
        } else if (sample.component == non_delta && ++rough > Continuation::certain) {
            q = static_cast<float>(path.continuation.probability);
            path.continuation.arrived += left / start;
            path.continuation.went_on += w / start;
        }
        left = w / q;
        if (q < 1) {
            if (choice.y >= q) return;
            weight *= 1 / q;
            survival *= q;
        }
        pdf = sample.pdf;
        ray = {offset_origin(v, sample.direction), 0, sample.direction, infinite_distance, v.time};
    }
}

}  // namespace

void trace_camera_subpath(const Scene& scene, Sampler& sampler, Vec2f raster, float time,
                          int max_vertices, RayCounters& counters, Subpath& path) {
    const Camera& camera = scene.camera;
    const Vec3f lens =
        camera.sample_lens(camera.lens_radius > 0 ? sampler.next_2d() : Vec2f{}, time);
    SubpathVertex& v = path[0];
    camera_vertex(scene, lens, time, v);
    v.throughput = Spectrum(1.0f);
    v.pdf_forward = camera.pdf_lens();
    v.pdf_reverse = 0;
    v.strategy_sum = 0;  // no light subpath meets the lens
    path.count = 1;
    path.edges_with_glow = 0;
    if (max_vertices < 2) return;
    const CameraRay ray = camera.ray(raster, lens, time);
    walk(scene, sampler, Known::eye, {ray.origin, ray.tnear, ray.direction, ray.tfar, time},
         camera.pdf_ray(ray.direction, time), Spectrum(1.0f), 1, max_vertices, counters, path);
}

void trace_light_subpath(const Scene& scene, Sampler& sampler, float time, int max_vertices,
                         RayCounters& counters, Subpath& path) {
    path.count = 0;
    const float u_select = sampler.next_1d();
    const Vec2f u_point = sampler.next_2d(), u_direction = sampler.next_2d();
    LightPoint point;
    if (max_vertices < 1 ||
        !sample_point(scene.lights, u_select, u_point, time, point, path.pdf_point))
        return;
    SubpathVertex& v = path[0];
    light_vertex(scene, point, time, v);
    v.throughput = Spectrum(static_cast<float>(1 / path.pdf_point));
    v.pdf_forward = path.pdf_point;
    v.pdf_reverse = 0;
    v.strategy_sum = point.delta ? 0 : 1;  // s = 0: found by a camera subpath
    path.count = 1;
    if (max_vertices < 2) return;

    Ray ray;
    double pdf;
    if (!sample_light_ray(scene, v, u_direction, ray, pdf)) return;
    const double cosine = point.infinite ? 1 : abs_dot(v.normal, ray.direction);
    const double weight = v.opacity / path.pdf_point * cosine / pdf;
    const Spectrum emitted = emission(scene, v, ray.direction);
    if (is_black(emitted)) return;
    walk(scene, sampler, Known::light, ray, pdf, emitted, static_cast<float>(weight), max_vertices,
         counters, path);
}

}  // namespace usdmlt
