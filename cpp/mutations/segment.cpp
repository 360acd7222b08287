#include "mutations/segment.hpp"

namespace usdmlt {
namespace {

// Samples the direction in which y_i scatters, `known` being the other one.
bool scatter(MutationContext& context, Path& y, int i, Vec3f known, Known role, Vec3f& direction,
             double& pdf) {
    const Vec2f u = context.random.next_2d();
    ClosureSample sample;
    if (!y[i].closure.sample(known, role, context.random.next_1d(), u, sample)) return false;
    y.at(i).component = sample.component;
    direction = sample.direction;
    pdf = sample.pdf;
    return true;
}

// y_i, made from y_{i+1}.
bool extend_from_eye(MutationContext& context, Path& y, int i) {
    const Scene& scene = context.scene;
    const int k = y.edges();
    Vertex& v = fresh(y, i);
    if (i == k) {
        const Vec3f lens = scene.camera.sample_lens(context.random.next_2d(), y.time);
        camera_vertex(scene, lens, y.time, v);
        context.recorded *= scene.camera.pdf_lens();
        return true;
    }
    Ray ray;
    double pdf;
    if (i == k - 1) {
        y.raster = context.domain.sample(context.random.next_2d());
        ray = camera_ray(scene.camera, y.raster, y[k].position, y.time);
        pdf = scene.camera.pdf_ray(ray.direction, y.time) * context.domain.density_scale();
    } else {
        if (!y[i + 1].can_scatter()) return false;  // at infinity
        Vec3f direction;
        if (!scatter(context, y, i + 1, y.to_eye(i + 1), Known::eye, direction, pdf)) return false;
        ray = ray_from(y[i + 1], direction);
    }
    Edge& edge = y.at(i + 1).edge;
    if (!trace_vertex(scene, y[i + 1], ray, Known::eye, i == 0, context.random, context.rays, v,
                      edge))
        return false;
    y.at(i + 1).direction = -ray.direction;
    context.recorded *= area_density(pdf, y[i + 1], v, ray.direction) * edge.survival(Known::eye);
    return true;
}

// y_i, made from y_{i−1}; `direct`: x_0 by sampling the lights as seen from y_1.
bool extend_from_light(MutationContext& context, Path& y, int i, bool direct) {
    const Scene& scene = context.scene;
    RandomStream& random = context.random;
    Vertex& v = fresh(y, i);
    if (i == 0) {
        LightPoint point;
        double pdf;
        const float u_select = random.next_1d();
        const Vec2f u = random.next_2d();
        if (direct ? !sample_direct(scene.lights, y[1].position, u_select, u, y.time, point, pdf)
                   : !sample_point(scene.lights, u_select, u, y.time, point, pdf))
            return false;
        light_vertex(scene, point, y.time, v);
        context.recorded *= pdf;
        return true;
    }
    const Vertex& previous = y[i - 1];
    Ray ray;
    double pdf;
    if (i == 1) {
        if (!sample_light_ray(scene, previous, random.next_2d(), ray, pdf)) return false;
    } else {
        Vec3f direction;
        if (!scatter(context, y, i - 1, y.to_light(i - 1), Known::light, direction, pdf))
            return false;
        ray = ray_from(previous, direction);
    }
    Edge& edge = y.at(i).edge;
    if (!trace_vertex(scene, previous, ray, Known::light, false, random, context.rays, v, edge))
        return false;
    y.at(i).direction = ray.direction;
    context.recorded *= area_density(pdf, previous, v, ray.direction) * edge.survival(Known::light);
    return true;
}

}  // namespace

bool make_segment(MutationContext& context, const Path& x, Change& change, int from_light,
                  int from_eye, Path& y) {
    begin_replacement(context, x, change, from_light + from_eye, y);
    // What is all new has a new time, of density 1.
    if (context.scene.has_motion && change.l < 0 && change.m > x.edges())
        y.time = context.random.next_1d();
    const int k = y.edges(), s = change.l + 1 + from_light;
    context.recorded = 1;
    if (s > k || (s > 0 && k == 1)) return false;  // the lens is not hit; see has_strategy
    for (int i = change.m_y - 1; i >= s; --i)
        if (!extend_from_eye(context, y, i)) return false;
    for (int i = change.l + 1; i < s; ++i)
        if (!extend_from_light(context, y, i, s == 1)) return false;
    y.at(s).component = non_delta;
    if (s == 0) return y[0].is_light;
    y.at(s - 1).component = non_delta;
    change.join = s;
    y.at(s).edge = {};
    if (!has_strategy(y, s)) return false;
    return s < k || project_end(context, y);
}

}  // namespace usdmlt
