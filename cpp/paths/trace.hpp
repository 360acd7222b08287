// Ray queries between vertices, and the vertices that rays meet: points of surfaces, and points of
// media where they collide.
//
// A surface of opacity α < 1 is passed with 1 − α: the edge's factor in f and in the density of
// traced edges alike. A traced ray stops there with probability α.
//
// One-sided surfaces are there for what sees their front, the eye being where one looks from: rays
// from the eye's side pass their backs, as do the edges of f. Rays from the light's side would have
// to stop at a front and go on as well; they only stop, and paths on which they go on are left to
// the other strategies.
#pragma once

#include "base/rng.hpp"
#include "media/optical_depth.hpp"
#include "paths/edge.hpp"
#include "paths/vertex.hpp"
#include "scene/scene.hpp"

namespace usdmlt {

// Rays as they were asked for, to be replayed by the acceleration structure alone.
struct RayRecorder {
    struct Entry {
        Ray ray;
        bool shadow;
    };
    std::vector<Entry> entries;
};

class Guide;

// Of one thread: rays counted by kind, and what goes along with tracing them.
struct RayCounters {
    uint64_t closest = 0, shadow = 0;
    RayRecorder* recorder = nullptr;
    const Guide* guide = nullptr;  // of the vertices that trace_vertex makes
    Media::Scratch media;
    bool wants_glow = false;
    Spectrum glow;  // if wanted and if media emit: what they add along the last traced ray

    void count_closest(const Ray& ray) {
        ++closest;
        if (recorder) recorder->entries.push_back({ray, false});
    }
    void count_shadow(const Ray& ray) {
        ++shadow;
        if (recorder) recorder->entries.push_back({ray, true});
    }
};

inline constexpr float infinite_distance = 1e30f;

// Fills a surface vertex from a hit: frames, closure, light.
void surface_vertex(const Scene& scene, const Hit& hit, Vertex& v);

// Makes the vertex of a point of a light (a surface point or a direction at infinity).
void light_vertex(const Scene& scene, const LightPoint& point, float time, Vertex& v);

// Makes the lens vertex of a perspective camera, or the direction of an orthographic one.
void camera_vertex(const Scene& scene, Vec3f lens_point, float time, Vertex& v);

enum class Met : uint8_t {
    nothing,  // the ray escaped
    lost,     // it found nothing that is there for the eye
    surface,
    medium
};

// Follows a ray from the eye's or the light's side to the surface where it stops; hit.t is the
// distance from the ray's start.
Met trace(const Scene& scene, Ray ray, Known role, RandomStream& random, RayCounters& counters,
          Hit& hit, float& opacity, Edge& edge);

// Where a ray stops in media: at random, nowhere, or at a given distance.
struct MediaStop {
    enum class Kind : uint8_t { random, nowhere, distance } kind = Kind::random;
    float distance = 0;
};

// Follows a ray from a vertex to the next one, and fills in the edge. Where the ray escapes, v is
// left as it was and the edge is that to infinity.
Met trace_next(const Scene& scene, const Vertex& from, const Ray& ray, Known role, MediaStop stop,
               RandomStream& random, RayCounters& counters, Vertex& v, Edge& edge);

// The surfaces in the way of a ray from the eye, one after the other: those that a ray may pass
// too, each with its opacity.
class Surfaces {
public:
    Surfaces(const Scene& scene, const Ray& ray) : scene_(scene), ray_(ray) {}
    // False: there is none left.
    bool next(Hit& hit, float& opacity);

private:
    const Scene& scene_;
    Ray ray_;
};

// The same, where `environment` is set with the direction at infinity of a ray that escapes. False:
// there is no next vertex.
bool trace_vertex(const Scene& scene, const Vertex& from, const Ray& ray, Known role,
                  bool environment, RandomStream& random, RayCounters& counters, Vertex& v,
                  Edge& edge, MediaStop stop = {});

// The point of a ray at distance t in a medium that scatters, and the edge to it; false where there
// is none.
bool medium_point(const Scene& scene, const Vertex& from, const Ray& ray, float t,
                  RayCounters& counters, Vertex& v, Edge& edge);

// The first ray of a light subpath, from x0: by the direction of a surface light, or the origin of
// a light at infinity, whose density is `pdf`. False: there is none.
bool sample_light_ray(const Scene& scene, const Vertex& x0, Vec2f u, Ray& ray, double& pdf);

// The edge from x to z, which is nearer to the eye (x may be at infinity, z the lens).
Edge edge_between(const Scene& scene, const Vertex& x, const Vertex& z, RayCounters& counters);

}  // namespace usdmlt
