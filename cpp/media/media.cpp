#include "media/media.hpp"

#include <cmath>

namespace usdmlt {

void Medium::finish() {
    extinction = scattering + absorption;
    scatters = max_component(scattering) > 0;
    interacts =
        max_component(extinction) > 0 || max_component(emission) > 0 || !grid.emission.empty();
    emits = max_component(emission) > 0 || !grid.emission.empty();
}

void Media::commit(std::shared_ptr<const embree::Library> library, const std::string& isa) {
    for (Medium& medium : media) {
        medium.finish();
        emit_ = emit_ || medium.emits;
        scatter_ = scatter_ || medium.scatters;
    }
    if (bodies.empty()) return;
    for (size_t i = 0; i < bodies.size(); ++i) {
        // Signed volume: a sixth of the sum over triangles.
        const Mesh& mesh = boundaries[i];
        double volume = 0;
        for (uint32_t t = 0; t < mesh.triangles.size(); ++t)
            volume += dot(to_double(mesh.corner(t, 0)),
                          cross(to_double(mesh.corner(t, 1)), to_double(mesh.corner(t, 2))));
        bodies[i].volume = std::fabs(volume) / 6;
    }
    acceleration_ = std::make_unique<Acceleration>(
        std::move(library), isa, boundaries, static_cast<uint32_t>(boundaries.size()),
        std::vector<MeshRange>{}, std::vector<Instance>{}, std::vector<Affine3f>{},
        ShapeCallbacks{});
}

void Media::begin_line(const Ray& ray, Scratch& scratch) const {
    if (!scratch.line.is_of(ray)) {
        find_crossings(ray, scratch.crossings);
        scratch.line = {ray.origin, ray.direction, ray.tnear, ray.time};
    }
    scratch.inside.clear();
    for (const Crossing& crossing : scratch.crossings) toggle(scratch.inside, crossing.body);
}

void Media::find_crossings(const Ray& ray, std::vector<Crossing>& crossings) const {
    crossings.clear();
    acceleration_->for_each_hit(ray, [&](float t, uint32_t body, uint32_t triangle, bool front) {
        crossings.push_back({t, body, triangle, front});
    });
    std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
        if (a.t != b.t) return a.t < b.t;
        return a.body != b.body ? a.body < b.body : a.triangle < b.triangle;
    });
    // Through an edge all triangles may be met that share it, at distances that differ by rounding:
    // those that face the same way are one crossing.
    const Vec3f o = ray.origin;
    const float size = std::max({std::fabs(o.x), std::fabs(o.y), std::fabs(o.z)});
    size_t count = 0;
    for (const Crossing& crossing : crossings) {
        const float rounding = 1e-5f * (crossing.t + size);
        bool known = false;
        for (size_t i = count; i > 0 && crossing.t - crossings[i - 1].t <= rounding && !known; --i)
            known =
                crossings[i - 1].body == crossing.body && crossings[i - 1].front == crossing.front;
        if (!known) crossings[count++] = crossing;
    }
    crossings.resize(count);
}

const Body* Media::innermost(const std::vector<uint32_t>& inside, uint32_t except) const {
    const Body* best = nullptr;
    for (const uint32_t i : inside)
        if (i != except && (!best || bodies[i].outranks(*best))) best = &bodies[i];
    return best;
}

Surroundings Media::surroundings(const Hit& hit, Vec3f position) const {
    const auto found = body_of_surface.find(surface_key(hit.mesh, hit.instance));
    if (found == body_of_surface.end()) return {};
    static thread_local Scratch scratch;
    scratch.line = {};  // the thread may have seen other scenes
    begin_line({position, 0, {0.36f, 0.48f, 0.8f}, 0, hit.time}, scratch);
    const Body* around = innermost(scratch.inside, found->second);
    if (!around) return {};
    return {around->outranks(bodies[found->second]), around->ior};
}

}  // namespace usdmlt
