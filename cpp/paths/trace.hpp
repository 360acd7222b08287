// Ray queries between vertices, and the vertices that rays meet.
//
// A surface of opacity α < 1 is passed with 1 − α: the edge's factor in f and in the density of
// traced edges alike. A traced ray stops there with probability α.
#pragma once

#include "base/rng.hpp"
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

// Follows a ray to the surface where it stops. `transmittance` is the product of 1 − α of the
// surfaces it passed. False: it escaped.
bool trace(const Scene& scene, Ray ray, RandomStream& random, RayCounters& counters, Hit& hit,
           float& opacity, float& transmittance);

// Follows a ray to the next vertex of a path: a surface or, where `environment` is set, the
// direction at infinity of a ray that escapes. False: there is none.
bool trace_vertex(const Scene& scene, const Ray& ray, bool environment, RandomStream& random,
                  RayCounters& counters, Vertex& v, float& transmittance);

// The first ray of a light subpath, from x0: by the direction of a surface light, or the origin of
// a light at infinity, whose density is `pdf`. False: there is none.
bool sample_light_ray(const Scene& scene, const Vertex& x0, Vec2f u, Ray& ray, double& pdf);

// Product of 1 − α along a segment: 1 where it is free, 0 where something opaque is in the way.
float transmittance(const Scene& scene, Ray ray, RayCounters& counters);

// The same between two vertices (one of them may be at infinity, or the lens).
float transmittance(const Scene& scene, const Vertex& a, const Vertex& b, RayCounters& counters);

}  // namespace usdmlt
