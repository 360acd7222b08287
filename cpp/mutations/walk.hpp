// Perturbed walks: a run of vertices traced again from x_start, towards the light or the eye, with
// the class string of the old ones.
//
// A walk goes through Dirac vertices by the old component, and ends
//   – at the first non-Dirac vertex whose next one on the way is non-Dirac or an end of the path:
//     the new vertex is connected to the old next one; or
//   – on the light, where nothing is left to connect to.
// At non-Dirac vertices between Dirac chains the old direction is perturbed. A glossy walk passes
// near-specular vertices as well, see near_specular.hpp. Densities in area
// measure, per traced vertex: solid angle × |cosθ| / r²; Dirac vertices have probability 1 and the
// unit of closure.hpp.
//
// Points of media stay such, and surfaces are reached through media: nothing is left to chance
// there. The distance t that a ray goes to a point of a medium becomes t e^{±r}, r log-uniform, of
// which the density is p(r) / (2 t').
#pragma once

#include "mutations/context.hpp"
#include "mutations/near_specular.hpp"

namespace usdmlt {

struct Walk {
    Known role = Known::eye;  // eye: from the eye's side towards the light
    int start = 0, end = -1;  // x_start is kept (or made by the mutation); x_end is the last traced
    int chains = 0;           // non-Dirac vertices between, whose direction is perturbed
    bool glossy = false;
    int half_vectors = 0;  // near-specular vertices that it passes
    bool aimed = false;    // inner chains

    int step() const { return role == Known::eye ? -1 : 1; }
    bool found() const { return end >= 0; }
    bool hits_light() const { return role == Known::eye && end == 0; }
};

// The walk of x from the lens; not found where it would have to end on a light that cannot be hit.
Walk find_walk(const Path& x, bool glossy = false);

// Traces the walk in y, whose y_start and first ray are made; the ray's direction (from infinity:
// its origin) has density `pdf`. False: the class string changes. context.recorded becomes the
// density of what was traced.
bool trace_walk(MutationContext& context, const Path& x, const Walk& walk, const Ray& ray,
                double pdf, Path& y);

// Whether the walk passes x_i on its way: a Dirac vertex, or a near-specular one.
inline bool is_passed(const Path& x, const Walk& walk, int i) {
    return x.is_delta(i) || (walk.glossy && is_near_specular(x, i));
}

// The direction into which v, met from `known`, scatters as x_i does, and its density. False: there
// is none.
bool pass(const Path& x, int i, const Vertex& v, Vec3f known, Vec3f& direction, double& pdf);

// Density of y's walk, given `first`, that of y_{start+step} in area measure; 0 where y's own walk
// would pass other vertices.
ScaledDouble walk_density(MutationContext& context, const Path& x, const Path& y, const Walk& walk,
                          double first);

// Density in area measure of the vertex after `from` (towards +1 or −1), whose direction or, from
// infinity, origin has density `pdf`: where it stops in media at random,
double step_density(const Path& y, int from, int step, double pdf);
// and where that follows x.
double kept_step_density(const MutationContext& context, const Path& x, const Path& y, int from,
                         int step, double pdf);

// ---- Perturbed directions

// Angle between unit vectors, which float's arc cosine cannot resolve below 1e−3.
double angle_between(Vec3f a, Vec3f b);

// A unit direction at `angle` from `direction`, azimuth by u.
Vec3f tilt(Vec3f direction, double angle, float u);

// Direction of the edge of x from x_i towards x_{i+step}.
inline Vec3f direction_along(const Path& x, int i, int step) {
    return step > 0 ? x.to_eye(i) : x.to_light(i);
}

}  // namespace usdmlt
