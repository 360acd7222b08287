// Participating media, and which of them is where.
//
// Bodies are closed meshes; their surfaces are kept in an acceleration structure of their own. What
// a ray is in is told by its geometry alone: all boundaries on its line are looked up, and a body
// holds the points beyond which an odd number of its boundaries follow. So neither paths nor their
// vertices carry a list of what they are in, and an edge looks the same from both sides.
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/spectrum.hpp"
#include "geometry/acceleration.hpp"
#include "media/density_grid.hpp"
#include "media/phase_function.hpp"

namespace usdmlt {

struct Medium {
    std::string name;
    Spectrum scattering, absorption;  // coefficients σ_s, σ_a, per scene unit; of density 1
    Spectrum emission;                // radiance per scene unit
    PhaseFunction phase;
    DensityGrid grid;  // empty: the same everywhere

    // Set by finish.
    Spectrum extinction;     // σ_s + σ_a
    bool scatters = false;   // else light only passes
    bool interacts = false;  // else it is clear
    bool emits = false;

    void finish();
};

// Which medium a closed mesh is filled with. Where bodies overlap the highest priority counts, and
// among equals the smaller body: it is inside the other.
struct Body {
    uint32_t medium = 0;
    int priority = 0;
    float ior = 1;  // of its surface, if that refracts
    double volume = 0;

    bool outranks(const Body& other) const {
        return priority > other.priority || (priority == other.priority && volume < other.volume);
    }
};

// What is around a body at a point of its surface. Within a body that outranks it the surface is
// not there (nested dielectrics; Schmidt & Budge 2002); elsewhere it bounds on a medium of index
// `ior`.
struct Surroundings {
    bool hides = false;
    float ior = 1;
};

class Media {
public:
    std::vector<Medium> media;
    uint32_t world = invalid_index;  // the medium outside all bodies
    std::vector<Body> bodies;
    std::vector<Mesh> boundaries;  // of the bodies, in the scene's space
    // Some body has a priority: interfaces go by what they are in, else each by itself.
    bool nested = false;
    std::unordered_map<uint64_t, uint32_t> body_of_surface;  // by surface_key

    static uint64_t surface_key(uint32_t mesh, uint32_t instance) {
        return uint64_t(instance) << 32 | mesh;
    }
    // In nested scenes; for what is no body, nothing is special.
    Surroundings surroundings(const Hit& hit, Vec3f position) const;

    bool empty() const { return media.empty(); }
    bool emit() const { return emit_; }
    bool scatter() const { return scatter_; }

    // To be called once everything above is in place.
    void commit(std::shared_ptr<const embree::Library> library, const std::string& isa);

    // Memory of one thread.
    struct Crossing {
        float t;
        uint32_t body, triangle;
        bool front;  // from the side that the triangle faces
    };
    struct Scratch {
        // Where a ray is looked for collisions, then for its optical depth, its boundaries are
        // looked up once: these are the ones of the last line.
        struct Line {
            Vec3f origin, direction;  // none goes in no direction
            float tnear = 0, time = 0;

            bool is_of(const Ray& ray) const {
                return origin == ray.origin && direction == ray.direction && tnear == ray.tnear &&
                       time == ray.time;
            }
        } line;
        std::vector<Crossing> crossings;
        std::vector<uint32_t> inside;  // bodies
    };

    // f(medium, t0, t1) for the stretches of a ray that lie in media that interact, in order, until
    // f is false. `direction` is unit.
    template <typename F>
    void for_each_stretch(const Ray& ray, Scratch& scratch, const F& f) const {
        if (bodies.empty()) {
            if (world != invalid_index && media[world].interacts)
                f(media[world], ray.tnear, ray.tfar);
            return;
        }
        begin_line(ray, scratch);
        float t = ray.tnear;
        for (size_t next = 0; t < ray.tfar; ++next) {
            const bool last = next == scratch.crossings.size();
            const float end = last ? ray.tfar : std::min(scratch.crossings[next].t, ray.tfar);
            const uint32_t medium = medium_of(scratch.inside);
            if (end > t && medium != invalid_index && media[medium].interacts &&
                !f(media[medium], t, end))
                return;
            if (last) return;
            t = std::max(t, end);
            toggle(scratch.inside, scratch.crossings[next].body);
        }
    }

private:
    // All boundaries on the ray's line, and what it starts in.
    void begin_line(const Ray& ray, Scratch& scratch) const;
    void find_crossings(const Ray& ray, std::vector<Crossing>& crossings) const;
    const Body* innermost(const std::vector<uint32_t>& inside,
                          uint32_t except = invalid_index) const;
    uint32_t medium_of(const std::vector<uint32_t>& inside) const {
        const Body* body = innermost(inside);
        return body ? body->medium : world;
    }
    static void toggle(std::vector<uint32_t>& inside, uint32_t body) {
        const auto found = std::find(inside.begin(), inside.end(), body);
        if (found == inside.end())
            inside.push_back(body);
        else
            inside.erase(found);
    }

    std::unique_ptr<Acceleration> acceleration_;
    bool emit_ = false, scatter_ = false;
};

}  // namespace usdmlt
