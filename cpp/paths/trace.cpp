#include "paths/trace.hpp"

#include "paths/guide.hpp"

namespace usdmlt {
namespace {

// Position, geometric normal and rounding error of a hit on a mesh.
// |error| ≤ γ Σ bᵢ|vᵢ| for the interpolation (Pharr, Jakob & Humphreys 2016, §3.9); the factor also
// covers the traversal's own rounding.
struct HitPoint {
    Vec3f position, normal;  // normal: unit
    float error;
    bool mirrored;  // the instance's transform flips handedness
};

constexpr float error_factor = 0x1p-19f;

Vec3f abs(Vec3f v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }

float max_component(Vec3f v) { return std::max({v.x, v.y, v.z}); }

// Where a segment ends, as a fraction of it. The traversal's distances are rounded in proportion to
// their length, whereas the ends are pushed off their surfaces by a bound that is proportional to
// their coordinates: close to the origin that would not keep the far surface out.
constexpr float segment_end = 1 - 0x1p-20f;

HitPoint position_on_mesh(const Scene& scene, const Hit& hit) {
    const Mesh& mesh = scene.meshes[hit.mesh];
    Vec3f p0 = mesh.corner(hit.primitive, 0, hit.time);
    Vec3f p1 = mesh.corner(hit.primitive, 1, hit.time);
    Vec3f p2 = mesh.corner(hit.primitive, 2, hit.time);
    HitPoint out;
    out.mirrored = false;
    float extra = 0;
    if (hit.instance != invalid_index) {
        const Affine3f m = scene.placement(hit.instance, hit.time);
        // Rounding of the local coordinates, seen through the transform.
        const Vec3f local = max(abs(p0), max(abs(p1), abs(p2)));
        extra = max_component(abs(m.x) * local.x + abs(m.y) * local.y + abs(m.z) * local.z +
                              abs(m.origin));
        p0 = m.point(p0);
        p1 = m.point(p1);
        p2 = m.point(p2);
        out.mirrored = m.determinant() < 0;
    }
    const float b0 = 1 - hit.u - hit.v;
    out.position = p0 * b0 + p1 * hit.u + p2 * hit.v;
    const Vec3f n = normalize(cross(p1 - p0, p2 - p0));
    out.normal = out.mirrored ? -n : n;
    out.error =
        (max_component(abs(p0) * b0 + abs(p1) * hit.u + abs(p2) * hit.v) + extra) * error_factor;
    return out;
}

Vec3f interpolate(const float* a, const float* b, const float* c, float u, float v) {
    const float b0 = 1 - u - v;
    return {b0 * a[0] + u * b[0] + v * c[0], b0 * a[1] + u * b[1] + v * c[1],
            b0 * a[2] + u * b[2] + v * c[2]};
}

// The mesh's normals at a hit, not of unit length.
Vec3f interpolated_normal(const Mesh& mesh, const Hit& hit) {
    const auto at = [&](int corner, const float* values) {
        return values + mesh.normals.offset(mesh.triangles[hit.primitive], hit.primitive, corner);
    };
    const auto of = [&](const float* values) {
        return interpolate(at(0, values), at(1, values), at(2, values), hit.u, hit.v);
    };
    const float* first = mesh.normals.values.data();
    if (mesh.later_normals.empty()) return of(first);
    const TimeSegment t(hit.time, mesh.later_normals.size() + 1);
    const auto& later = mesh.later_normals;
    return interpolate(of(t.first == 0 ? first : later[t.first - 1].data()),
                       of(later[t.first].data()), t.fraction);
}

float opacity_of(const Scene& scene, const Mesh& mesh, uint32_t triangle, float u, float v) {
    const uint32_t material = mesh.material_of(triangle);
    if (is_opaque(scene.materials, material)) return 1;
    return opacity(scene.materials, material, mesh, triangle, u, v);
}

// A body's surface within one that outranks it.
bool is_hidden(const Scene& scene, const Hit& hit) {
    return scene.media.nested && hit.mesh != invalid_index &&
           scene.media.surroundings(hit, position_on_mesh(scene, hit).position).hides;
}

// The index of what is outside divides that of the inside.
void set_outside(const Media& media, const Hit& hit, Vertex& v) {
    const float outside = media.surroundings(hit, v.position).ior;
    if (outside == 1) return;
    for (int i = 0; i < v.closure.lobe_count; ++i) {
        Lobe& lobe = v.closure.lobes[i];
        if (lobe.is_interface && lobe.type == LobeType::dielectric) lobe.eta /= outside;
    }
}

// A surface in a ray's way.
struct Crossing {
    HitPoint point;
    bool from_behind;  // on the way from the eye to the light

    Crossing(const Scene& scene, const Hit& hit, Vec3f direction, Known role)
        : point(position_on_mesh(scene, hit)),
          from_behind((dot(point.normal, direction) > 0) == (role == Known::eye)) {}

    // Where the ray goes on.
    Vec3f other_side(Vec3f direction) const {
        const float side = dot(point.normal, direction) < 0 ? -point.error : point.error;
        return point.position + point.normal * side;
    }
};

}  // namespace

void surface_vertex(const Scene& scene, const Hit& hit, Vertex& v) {
    v.kind = VertexKind::surface;
    v.infinite = false;
    v.component = non_delta;
    v.mesh = hit.mesh;
    v.triangle = hit.primitive;
    v.instance = hit.instance;
    v.uv = {hit.u, hit.v};
    v.time = hit.time;
    v.closure.guide = nullptr;
    v.closure.is_phase = false;
    if (hit.mesh == invalid_index) {
        // A light's own shape: emits, scatters nothing.
        v.light = shape_point(scene.lights, hit.primitive, v.uv, hit.time);
        v.is_light = true;
        v.one_sided = false;
        v.position = v.light.position;
        v.normal = v.light.normal;
        v.position_error = max_component(abs(v.position)) * error_factor;
        v.closure.geometric_normal = v.normal;
        v.closure.shading.z = v.normal;
        v.closure.emission = {};
        v.closure.lobe_count = v.closure.cover_count = 0;
        v.closure.has_non_delta = v.closure.is_lambert = false;
        return;
    }
    const Mesh& mesh = scene.meshes[hit.mesh];
    const HitPoint p = position_on_mesh(scene, hit);
    v.one_sided = mesh.one_sided;
    v.position = p.position;
    v.normal = p.normal;
    v.position_error = p.error;
    v.closure.geometric_normal = p.normal;
    Vec3f n = p.normal;
    if (!mesh.normals.empty()) {
        n = interpolated_normal(mesh, hit);
        if (hit.instance != invalid_index) n = scene.placement(hit.instance, hit.time).normal(n);
        const float n2 = length_squared(n);
        n = n2 > 0 ? n * (1 / std::sqrt(n2)) : p.normal;
        if (dot(n, p.normal) < 0) n = -n;
    }
    const uint32_t material = mesh.material_of(hit.primitive);
    const uint32_t primvar = scene.materials.materials[material].tangent_primvar;
    Vec3f dpds;
    if (primvar != invalid_index) {
        dpds = tangent_along_s(mesh, hit.primitive, primvar, hit.time);
        if (hit.instance != invalid_index)
            dpds = scene.placement(hit.instance, hit.time).vector(dpds);
    }
    v.closure.shading = Frame::from_normal(n);
    evaluate_material(scene.materials, material, mesh, hit.primitive, hit.u, hit.v, dpds, v.closure,
                      p.mirrored);
    if (scene.media.nested) [[unlikely]]
        set_outside(scene.media, hit, v);
    v.is_light = false;
    if (is_emissive(scene.materials, material)) {
        const uint32_t light = scene.light_of(hit.mesh, hit.instance);
        if (light != invalid_index) {
            v.light = mesh_point(scene.lights, light, hit.primitive, hit.u, hit.v, hit.time);
            v.is_light = true;
        }
    }
}

void light_vertex(const Scene& scene, const LightPoint& point, float time, Vertex& v) {
    v.time = time;
    v.kind = VertexKind::light;
    v.component = non_delta;
    v.is_light = true;
    v.infinite = point.infinite;
    v.light = point;
    v.position = point.position;
    v.normal = point.normal;
    v.direction = point.direction;
    v.position_error = point.infinite ? 0 : max_component(abs(point.position)) * error_factor;
    v.opacity = 1;
    v.one_sided = false;
    if (scene.all_opaque || point.infinite) return;
    // Only meshes let rays pass.
    if (const auto* light = std::get_if<MeshLight>(&scene.lights.lights[point.light])) {
        v.one_sided = light->mesh->one_sided;
        v.opacity = opacity_of(scene, *light->mesh, point.primitive, point.uv.x, point.uv.y);
    }
}

void camera_vertex(const Scene& scene, Vec3f lens_point, float time, Vertex& v) {
    const Vec3f forward = scene.camera.pose(time).forward;
    v.kind = VertexKind::camera;
    v.component = non_delta;
    v.is_light = v.one_sided = false;
    v.infinite = scene.camera.orthographic;
    v.position = lens_point;
    v.normal = forward;
    v.direction = -forward;
    v.time = time;
    v.position_error = 0;
    v.opacity = 1;
}

Met trace(const Scene& scene, Ray ray, Known role, RandomStream& random, RayCounters& counters,
          Hit& hit, float& opacity_out, Edge& edge) {
    edge = {};
    opacity_out = 1;
    float passed = 0;
    for (;;) {
        counters.count_closest(ray);
        if (!scene.acceleration->intersect(ray, hit)) return Met::nothing;
        hit.t += passed;
        if (scene.all_opaque || hit.mesh == invalid_index) return Met::surface;
        const Mesh& mesh = scene.meshes[hit.mesh];
        const float alpha =
            is_hidden(scene, hit) ? 0 : opacity_of(scene, mesh, hit.primitive, hit.u, hit.v);
        if (alpha >= 1 && !mesh.one_sided) return Met::surface;
        const Crossing crossing(scene, hit, ray.direction, role);
        const bool unseen = mesh.one_sided && crossing.from_behind;
        if (unseen && role == Known::eye) {
            edge.from_light = 0;
        } else {
            if (alpha >= 1 || (alpha > 0 && random.next_1d() < alpha)) {
                opacity_out = alpha;
                return Met::surface;
            }
            if (unseen) return Met::lost;
            edge.attenuate(1 - alpha);
        }
        ray.origin = crossing.other_side(ray.direction);
        ray.tnear = 0;
        ray.tfar -= hit.t - passed;
        passed = hit.t;
    }
}

bool Surfaces::next(Hit& hit, float& opacity) {
    while (scene_.acceleration->intersect(ray_, hit)) {
        opacity = 1;
        if (scene_.all_opaque || hit.mesh == invalid_index) {
            ray_.tfar = 0;  // nothing behind is seen
            return true;
        }
        const Mesh& mesh = scene_.meshes[hit.mesh];
        opacity =
            is_hidden(scene_, hit) ? 0 : opacity_of(scene_, mesh, hit.primitive, hit.u, hit.v);
        const Crossing crossing(scene_, hit, ray_.direction, Known::eye);
        ray_.origin = crossing.other_side(ray_.direction);
        ray_.tnear = 0;
        ray_.tfar -= hit.t;
        if (opacity > 0 && !(mesh.one_sided && crossing.from_behind)) return true;
    }
    return false;
}

bool sample_light_ray(const Scene& scene, const Vertex& x0, Vec2f u, Ray& ray, double& pdf) {
    ray.tnear = 0;
    ray.tfar = infinite_distance;
    ray.time = x0.time;
    if (x0.infinite) {
        sample_origin(scene.lights, x0.direction, u, ray.origin, pdf);
        ray.direction = -x0.direction;
        return true;
    }
    if (!sample_direction(scene.lights, x0.light, u, ray.direction, pdf)) return false;
    ray.origin = offset_origin(x0, ray.direction);
    return true;
}

namespace {

bool medium_vertex(const Ray& ray, const Collision& collision, Vertex& v) {
    const Medium& medium = *collision.medium;
    v.kind = VertexKind::medium;
    v.infinite = v.is_light = v.one_sided = false;
    v.component = non_delta;
    v.position = ray.origin + ray.direction * collision.t;
    v.normal = {0, 0, 1};
    v.position_error = 0;
    v.opacity = 1;
    v.time = ray.time;
    v.mesh = v.instance = invalid_index;
    const float density =
        medium.grid.empty() ? 1 : medium.grid.density(medium.grid.to_grid.point(v.position));
    v.collision = medium.extinction * density;
    Closure& closure = v.closure;
    closure.shading = Frame::from_normal(v.normal);
    closure.geometric_normal = v.normal;
    closure.emission = {};
    closure.lobe_count = 1;
    closure.cover_count = 0;
    closure.has_non_delta = closure.is_phase = true;
    closure.is_lambert = false;
    closure.guide = nullptr;
    closure.phase = medium.phase;
    closure.lobes[0] = Lobe{};
    closure.lobes[0].type = LobeType::phase;
    closure.lobes[0].reflects = false;
    closure.lobes[0].weight = medium.scattering * density;
    return density > 0;
}

// x is nearer to the light, z to the eye; either may be what a ray only passed on its way out.
void set_media(const Scene& scene, const Ray& stretch, const Vertex* x, const Vertex* z,
               RayCounters& counters, Edge& edge) {
    const Attenuation on_the_way(optical_depth(scene.media, stretch, counters.media));
    for (int c = 0; c < 3; ++c) edge.media[c] = static_cast<float>(on_the_way.transmittance[c]);
    const auto made = [&](const Vertex* v) {
        return static_cast<float>(v && v->is_medium() ? on_the_way.density(v->collision)
                                                      : on_the_way.probability());
    };
    edge.media_from_eye = made(x);
    edge.media_from_light = made(z);
}

}  // namespace

Met trace_next(const Scene& scene, const Vertex& from, const Ray& ray, Known role, MediaStop stop,
               RandomStream& random, RayCounters& counters, Vertex& v, Edge& edge) {
    counters.glow = {};
    Hit hit;
    Ray limited = ray;
    Collision collision;
    const bool has_media = !scene.media.empty();
    if (has_media) [[unlikely]] {
        if (stop.kind == MediaStop::Kind::random)
            collision = sample_collision(scene.media, ray, random, counters.media);
        else if (stop.kind == MediaStop::Kind::distance)
            collision = collision_at(scene.media, ray, stop.distance, counters.media);
        if (collision.medium)
            limited.tfar = collision.t;
        else if (stop.kind == MediaStop::Kind::distance)
            return Met::lost;
    }
    Met met = trace(scene, limited, role, random, counters, hit, v.opacity, edge);
    if (met == Met::surface) {
        surface_vertex(scene, hit, v);
        if (counters.guide && v.can_connect()) v.closure.guide = counters.guide->at(v.position);
    }
    if (!has_media || met == Met::lost) return met;

    if (met == Met::surface && stop.kind == MediaStop::Kind::distance) return Met::lost;
    if (met == Met::nothing && collision.medium) {
        if (!medium_vertex(ray, collision, v)) return Met::lost;
        met = Met::medium;
    }
    const Vertex* next = met == Met::nothing ? nullptr : &v;
    Ray stretch = ray;
    if (from.infinite && role == Known::light) {
        if (next)
            stretch = {offset_origin(v, from.direction), 0, from.direction, infinite_distance,
                       ray.time};
    } else if (next) {
        stretch.tfar = met == Met::medium ? collision.t : length(v.position - ray.origin);
    }
    if (counters.wants_glow && scene.media.emit())
        counters.glow = glow(scene.media, stretch, random.next_double(), counters.media);
    set_media(scene, stretch, role == Known::eye ? next : &from, role == Known::eye ? &from : next,
              counters, edge);
    return met;
}

bool medium_point(const Scene& scene, const Vertex& from, const Ray& ray, float t,
                  RayCounters& counters, Vertex& v, Edge& edge) {
    const Collision collision = collision_at(scene.media, ray, t, counters.media);
    if (!collision.medium || !medium_vertex(ray, collision, v)) return false;
    edge = {};
    Ray stretch = ray;
    stretch.tfar = t;
    set_media(scene, stretch, &v, &from, counters, edge);
    return true;
}

bool trace_vertex(const Scene& scene, const Vertex& from, const Ray& ray, Known role,
                  bool environment, RandomStream& random, RayCounters& counters, Vertex& v,
                  Edge& edge, MediaStop stop) {
    const Met met = trace_next(scene, from, ray, role, stop, random, counters, v, edge);
    if (met != Met::nothing) return met != Met::lost;
    LightPoint point;
    if (!environment || !environment_point(scene.lights, ray.direction, ray.time, point))
        return false;
    light_vertex(scene, point, ray.time, v);
    v.opacity = 1;
    return true;
}

namespace {

// A segment that starts on the eye's or the light's side.
Edge follow(const Scene& scene, Ray ray, Known role, RayCounters& counters) {
    Edge edge;
    if (scene.all_opaque) {
        counters.count_shadow(ray);
        if (scene.acceleration->occluded(ray)) edge.attenuate(0);
        return edge;
    }
    Hit hit;
    while (!edge.is_blocked()) {
        counters.count_shadow(ray);
        if (!scene.acceleration->intersect(ray, hit)) return edge;
        if (hit.mesh == invalid_index) {
            edge.attenuate(0);
            return edge;
        }
        const Mesh& mesh = scene.meshes[hit.mesh];
        const float alpha =
            is_hidden(scene, hit) ? 0 : opacity_of(scene, mesh, hit.primitive, hit.u, hit.v);
        if (alpha >= 1 && !mesh.one_sided) {
            edge.attenuate(0);
            return edge;
        }
        const Crossing crossing(scene, hit, ray.direction, role);
        if (mesh.one_sided && crossing.from_behind)
            edge.from_light = 0;
        else
            edge.attenuate(1 - alpha);
        const Vec3f origin = crossing.other_side(ray.direction);
        // Keeps the end of the segment where it was.
        const Vec3f end = ray.origin + ray.direction * ray.tfar;
        if (ray.tfar < infinite_distance / 2) {
            ray.direction = end - origin;
            ray.tfar = segment_end;
        }
        ray.origin = origin;
        ray.tnear = 0;
    }
    return edge;
}

}  // namespace

Edge edge_between(const Scene& scene, const Vertex& x, const Vertex& z, RayCounters& counters) {
    // `reach`: of the ray, in its direction's lengths.
    const auto follow_in_media = [&](const Ray& ray, Known role, float reach) {
        Edge edge = follow(scene, ray, role, counters);
        if (!scene.media.empty() && !edge.is_blocked()) [[unlikely]] {
            const float size = length(ray.direction);
            set_media(scene, {ray.origin, 0, ray.direction * (1 / size), reach * size, ray.time},
                      &x, &z, counters, edge);
        }
        return edge;
    };
    if (x.infinite) {
        const Vec3f from = offset_origin(z, x.direction);
        return follow_in_media({from, 0, x.direction, infinite_distance, z.time}, Known::eye,
                               infinite_distance);
    }
    const Vec3f direction = direction_to(x, z);
    const Vec3f from = offset_origin(x, direction);
    if (z.kind == VertexKind::camera) {
        const Camera& camera = scene.camera;
        const float depth = dot(from - camera.pose(z.time).position, z.normal);
        // Up to where the camera starts to see only.
        const Vec3f path = camera.orthographic ? direction : z.position - from;
        const float near = camera.orthographic ? depth - camera.near : 1 - camera.near / depth;
        const float far = camera.seen_until(from, path, near, z.time);
        return follow_in_media({from, 0, path, far, z.time}, Known::light, far);
    }
    const Vec3f to = offset_origin(z, -direction);
    return follow_in_media({from, 0, to - from, segment_end, x.time}, Known::light, 1);
}

}  // namespace usdmlt
