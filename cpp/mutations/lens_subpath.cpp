#include "mutations/lens_subpath.hpp"

#include "base/sampler.hpp"
#include "mutations/walk.hpp"

namespace usdmlt {
namespace {

// Where a walk from the eye can go on at a vertex: the Dirac components with their probabilities,
// or stop there. The closure's own choice, conditional on Dirac where nothing else scatters.
struct Continuations {
    Component component[2 * max_lobes];
    Vec3f direction[2 * max_lobes];
    double probability[2 * max_lobes];
    int count = 0;
    double stop = 0;

    Continuations(const Closure& closure, Vec3f to_eye) {
        double sum = 0;
        for (int lobe = 0; lobe < closure.lobe_count; ++lobe) {
            if (!closure.lobes[lobe].delta) continue;
            for (const Component c : {delta_reflection(lobe), delta_transmission(lobe)}) {
                if (!closure.delta_direction(to_eye, c, direction[count])) continue;
                const double measure = closure.delta_measure(direction[count], c);
                const double pdf = closure.pdf(to_eye, direction[count], Known::eye, c);
                if (!(pdf > 0 && measure > 0)) continue;
                component[count] = c;
                probability[count] = pdf / measure;
                sum += probability[count++];
            }
        }
        if (closure.has_non_delta) {
            stop = std::max(1 - sum, 0.0);
            sum += stop;
        }
        if (!(sum > 0)) return;
        stop /= sum;
        for (int i = 0; i < count; ++i) probability[i] /= sum;
    }

    double of(Component c) const {
        for (int i = 0; i < count; ++i)
            if (component[i] == c) return probability[i];
        return 0;
    }
};

// Only the coin of a vertex without Dirac lobes is known in advance.
bool always_stops(const Closure& closure) {
    if (closure.is_lambert) return true;
    for (int i = 0; i < closure.lobe_count; ++i)
        if (closure.lobes[i].delta) return false;
    return closure.has_non_delta;
}

}  // namespace

bool LensSubpath::applies(const MutationContext&, const Path& x) {
    const Walk walk = find_walk(x);
    return walk.found() && walk.chains == 0 && !walk.hits_light();
}

bool LensSubpath::propose(MutationContext& context, const Path& x, Path& y, Change& change) {
    const Scene& scene = context.scene;
    const Camera& camera = scene.camera;
    RandomStream& random = context.random;
    const int k = x.edges(), l = find_walk(x).end - 1;
    const Vec2f stratum =
        Sampler(hash_key(context.unit_key, context.lens_proposals++), context.chain, 1).next_2d();
    const Vec2f raster = context.domain.sample(stratum);

    // The walk's length is known at its end only: it is traced into the longest path there can be,
    // backwards from the lens, and closed up.
    const int longest = context.max_edges - l - 1;  // new vertices
    if (longest < 1) return false;
    change = {l, k, 0, l + 1};
    begin_replacement(context, x, change, longest, y);
    y.raster = raster;
    const int lens = y.edges();
    Ray ray = camera_ray(camera, raster, x[k].position, x.time);
    double pdf = camera.pdf_ray(ray.direction, x.time) * context.domain.density_scale();
    context.recorded = 1;
    int i = lens - 1;
    for (;; --i) {
        if (i == l) return false;  // too long
        Vertex& v = fresh(y, i);
        Edge& edge = y.at(i + 1).edge;
        if (!trace_vertex(scene, y[i + 1], ray, Known::eye, false, random, context.rays, v, edge))
            return false;
        y.at(i + 1).direction = -ray.direction;
        context.recorded *=
            area_density(pdf, y[i + 1], v, ray.direction) * edge.survival(Known::eye);
        if (always_stops(v.closure)) break;
        const Continuations next(v.closure, -ray.direction);
        double u = random.next_double();
        if ((u -= next.stop) < 0) {
            context.recorded *= next.stop;
            break;
        }
        int choice = 0;
        while (choice < next.count && (u -= next.probability[choice]) >= 0) ++choice;
        if (choice >= next.count) return false;
        y.at(i).component = next.component[choice];
        pdf = next.probability[choice] *
              v.closure.delta_measure(next.direction[choice], next.component[choice]);
        ray = ray_from(v, next.direction[choice]);
    }
    // Vertices l + 1 … i − 1 were not needed.
    context.arena.give(y, l + 1, i);
    y.vertices.erase(y.vertices.begin() + l + 1, y.vertices.begin() + i);
    change.m_y = y.edges();
    y.at(l + 1).component = non_delta;
    y.at(l + 1).edge = {};
    return y.edges() >= context.min_edges;
}

ScaledDouble LensSubpath::density(MutationContext& context, const Path&, const Path& y,
                                  const Change& change) {
    const int k = y.edges();
    ScaledDouble density = density_from_eye(context, y, k - 1);
    for (int i = k - 1; i > change.l; --i) {
        const Closure& closure = y[i].closure;
        if (always_stops(closure)) continue;
        const Continuations next(closure, y.to_eye(i));
        if (i == change.l + 1) {
            density *= next.stop;
        } else {
            const Component c = y.at(i).component;
            density *= step_density(y, i, -1, next.of(c) * closure.delta_measure(y.to_light(i), c));
        }
    }
    return density;
}

}  // namespace usdmlt
