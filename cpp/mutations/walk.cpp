#include "mutations/walk.hpp"

#include "mutations/aim.hpp"

namespace usdmlt {

Walk find_walk(const Path& x, bool glossy) {
    Walk walk;
    walk.start = x.edges();
    walk.glossy = glossy;
    for (int i = walk.start - 1; i > 0; --i) {
        if (x.is_delta(i)) continue;
        if (is_passed(x, walk, i)) {
            ++walk.half_vectors;
            continue;
        }
        if (i == 1 || !is_passed(x, walk, i - 1)) {
            walk.end = i;
            return walk;
        }
        ++walk.chains;
    }
    if (!x[0].light.delta) walk.end = 0;
    return walk;
}

namespace {

Known role_of(int step) { return step < 0 ? Known::eye : Known::light; }

// Of a ray from `from` to a point of a medium: from an orthographic camera, from its plane.
double distance_between(const MutationContext& context, const Vertex& from, const Vertex& to) {
    if (!from.infinite) return length(to.position - from.position);
    const CameraPose pose = context.scene.camera.pose(to.time);
    return dot(to.position - pose.position, pose.forward);
}

// t e^{±r}: density p(r) / (2 t').
float perturb_distance(MutationContext& context, double distance, double& pdf) {
    const double r = context.distance_range.sample(context.random.next_double());
    const double moved = distance * std::exp(context.random.next_1d() < 0.5f ? r : -r);
    pdf = context.distance_range.pdf(r) / (2 * moved);
    return static_cast<float>(moved);
}

double distance_density(const MutationContext& context, const Path& x, const Path& y, int from,
                        int to) {
    const double old = distance_between(context, x[from], x[to]);
    const double moved = distance_between(context, y[from], y[to]);
    // 0 where points are so close that rounding has undone the move.
    return moved == old
               ? 0
               : context.distance_range.pdf(std::fabs(std::log(moved / old))) / (2 * moved);
}

}  // namespace

bool pass(const Path& x, int i, const Vertex& v, Vec3f known, Vec3f& direction, double& pdf) {
    if (x.is_delta(i)) {
        const Component component = x.at(i).component;
        if (!v.closure.delta_direction(known, component, direction)) return false;
        pdf = v.closure.delta_measure(direction, component);
        return true;
    }
    if (!v.can_connect() || !keep_half_vector(x, i, v, known, direction)) return false;
    pdf = half_vector_pdf(direction, known);
    return true;
}

bool trace_walk(MutationContext& context, const Path& x, const Walk& walk, const Ray& first,
                double pdf, Path& y) {
    const int step = walk.step();
    Ray ray = first;
    context.recorded = 1;
    for (int i = walk.start + step;; i += step) {
        PathVertex& vertex = y.at(i);
        PathVertex& edge = y.at(step > 0 ? i : i + 1);
        Vertex& v = fresh(y, i);
        MediaStop stop{MediaStop::Kind::nowhere};
        double pdf_distance = 1;
        if (x[i].is_medium())
            stop = {MediaStop::Kind::distance,
                    perturb_distance(context, distance_between(context, x[i - step], x[i]),
                                     pdf_distance)};
        if (!trace_vertex(context.scene, y[i - step], ray, walk.role, i == 0, context.random,
                          context.rays, v, edge.edge, stop))
            return false;
        edge.direction = step > 0 ? ray.direction : -ray.direction;
        context.recorded *= area_density(pdf, y[i - step], v, ray.direction) * pdf_distance *
                            edge.edge.survival_of_surfaces(walk.role);
        if (i == 0) return v.is_light;
        vertex.component = x.at(i).component;
        if (i == walk.end) return v.can_connect();
        Vec3f direction;
        if (is_passed(x, walk, i)) {
            if (!pass(x, i, v, -ray.direction, direction, pdf)) return false;
        } else if (!v.can_connect()) {
            return false;
        } else if (walk.aimed) {
            const AimedDirection aimed = aim(context, x, walk, i, v);
            if (!aimed.found) return false;
            direction = aimed.sample(context.random.next_2d());
            pdf = aimed.pdf(direction);
        } else {
            const double angle = context.direction_range.sample(context.random.next_double());
            direction = tilt(direction_along(x, i, step), angle, context.random.next_1d());
            pdf = context.direction_range.pdf_direction(angle);
        }
        ray = ray_from(v, direction);
    }
}

double step_density(const Path& y, int from, int step, double pdf) {
    const int to = from + step;
    return area_density(pdf, y[from], y[to], direction_along(y, from, step)) *
           y.at(std::max(from, to)).edge.survival(role_of(step));
}

double kept_step_density(const MutationContext& context, const Path& x, const Path& y, int from,
                         int step, double pdf) {
    const int to = from + step;
    if (x[to].is_medium() != y[to].is_medium()) return 0;
    if (y[to].is_medium()) pdf *= distance_density(context, x, y, from, to);
    return area_density(pdf, y[from], y[to], direction_along(y, from, step)) *
           y.at(std::max(from, to)).edge.survival_of_surfaces(role_of(step));
}

ScaledDouble walk_density(MutationContext& context, const Path& x, const Path& y, const Walk& walk,
                          double first) {
    const int step = walk.step();
    ScaledDouble density = first;
    for (int i = walk.start + step; i != walk.end; i += step) {
        const Vec3f direction = direction_along(y, i, step);
        double pdf;
        const bool keeps_half_vector = walk.glossy && is_near_specular(x, i);
        if (keeps_half_vector != (walk.glossy && is_near_specular(y, i))) return 0;
        if (y.is_delta(i)) {
            pdf = y[i].closure.delta_measure(direction, y.at(i).component);
        } else if (keeps_half_vector) {
            pdf = half_vector_pdf(direction, direction_along(y, i, -step));
        } else if (walk.aimed) {
            pdf = aim(context, x, walk, i, y[i]).pdf(direction);
        } else {
            const double angle = angle_between(direction, direction_along(x, i, step));
            pdf = context.direction_range.pdf_direction(angle);
        }
        density *= kept_step_density(context, x, y, i, step, pdf);
    }
    return density;
}

double angle_between(Vec3f a, Vec3f b) {
    const Vec3d p = to_double(a), q = to_double(b);
    return std::atan2(length(cross(p, q)), dot(p, q));
}

Vec3f tilt(Vec3f direction, double angle, float u) {
    const Frame frame = Frame::from_normal(direction);
    const float s = static_cast<float>(std::sin(angle)), c = static_cast<float>(std::cos(angle));
    const float phi = 2 * pi * u;
    return normalize(frame.x * (s * std::cos(phi)) + frame.y * (s * std::sin(phi)) + direction * c);
}

}  // namespace usdmlt
