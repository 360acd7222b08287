// All lights of a scene: selection, sampling, densities and radiance, as paths ask for them. See
// light.hpp for what a light point is.
//
// A light is chosen with probability ∝ its power (importance-weighted flux Φ):
//     one-sided surface    Φ = L ∫∫ S(ω) max(0, n·ω) dω dA,  = πAL without shaping
//     emissive triangle    Φ = 2πAL, both sides
//     infinite             Φ = πR² ∫ L dω,  R: radius of the scene's bounding sphere
// with all infinite lights that are not Dirac being one choice, the environment. To add a family:
// one file, one alternative of `Light`.
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "base/distribution.hpp"
#include "geometry/parallelogram.hpp"
#include "lights/cylinder.hpp"
#include "lights/disk.hpp"
#include "lights/distant.hpp"
#include "lights/dome.hpp"
#include "lights/light.hpp"
#include "lights/light_links.hpp"
#include "lights/light_motion.hpp"
#include "lights/mesh_light.hpp"
#include "lights/rect.hpp"
#include "lights/sphere.hpp"

namespace usdmlt {

using Light = std::variant<RectLight, DiskLight, SphereLight, CylinderLight, MeshLight,
                           DistantLight, DomeLight>;

// What a family is told by: shapes are analytic surfaces that emit from one side.
template <typename L>
concept Shape = requires(const L& light) { light.shaping; };
template <typename L>
concept Infinite = requires(const L& light) { incoming_radiance(light, Vec3f{}); };

struct Lights {
    std::vector<Light> lights;
    LightLinks links;
    std::vector<LightMotion> motions;
    std::vector<uint32_t> motion_of_light;  // invalid_index: it stays, or is a mesh

    // Filled by finish().
    struct Choice {
        uint32_t light;      // or environment_light
        uint32_t primitive;  // triangle, for meshes
    };
    std::vector<double> power;           // of each light
    std::vector<Choice> choices;         // one per light, but one per triangle of a mesh
    std::vector<uint32_t> first_choice;  // of each light
    DiscreteDistribution selection;      // of choices
    std::vector<uint32_t> environment;   // lights that make up the environment
    DiscreteDistribution environment_selection;
    double environment_probability = 0;
    std::vector<uint32_t> shapes;  // light of each analytic shape
    Vec3f scene_center;
    float scene_radius = 1;

    bool empty() const { return selection.empty(); }  // nothing emits
    LightPose pose(uint32_t light, float time) const {
        if (motions.empty()) return {};
        const uint32_t motion = motion_of_light[light];
        return motion == invalid_index ? LightPose{} : motions[motion].at(time);
    }
    // Whether u_select decides anything: the environment is one choice, but may be several lights.
    bool has_choice() const { return choices.size() > 1 || environment.size() > 1; }

    // Once, after the last light was added. The sphere bounds all that can be lit.
    void finish(Vec3f center, float radius);
};

// ---------------------------------------------------------------------------------------------
// Building. Transforms are local to recentred world; the result is the light's index.

uint32_t add_rect(Lights& lights, const Affine3f& transform, float width, float height,
                  const Spectrum& radiance, const Texture* texture = nullptr,
                  const ShapingParameters* shaping = nullptr);
uint32_t add_disk(Lights& lights, const Affine3f& transform, float radius, const Spectrum& radiance,
                  const ShapingParameters* shaping = nullptr);
uint32_t add_sphere(Lights& lights, const Affine3f& transform, float radius,
                    const Spectrum& radiance, const ShapingParameters* shaping = nullptr);
uint32_t add_cylinder(Lights& lights, const Affine3f& transform, float radius, float length,
                      const Spectrum& radiance, const ShapingParameters* shaping = nullptr);
uint32_t add_distant(Lights& lights, const Affine3f& transform, float angle_degrees,
                     const Spectrum& radiance);
uint32_t add_dome(Lights& lights, const Affine3f& transform, const Spectrum& radiance,
                  const Texture* texture = nullptr);
// The light moves: its transforms when the shutter opens, as given above, and at further
// equidistant times. See light_motion.hpp.
void set_motion(Lights& lights, uint32_t light, const Affine3f& transform,
                const std::vector<Affine3f>& later);
// Mesh, materials and `later` transforms (see motion.hpp) must outlive the lights, as textures
// must.
uint32_t add_mesh(Lights& lights, const Mesh& mesh, const Affine3f& to_world,
                  std::span<const Affine3f> later, const Materials& materials);

// ---------------------------------------------------------------------------------------------
// x0. Densities are in area measure or, at infinity, in solid angle; discrete for Dirac lights.
// All samplers return false where they find no light; that is a sample of value zero. `time` is the
// path's, and in the point.

// A density that depends on nothing.
bool sample_point(const Lights& lights, float u_select, Vec2f u, float time, LightPoint& point,
                  double& pdf);
double pdf_point(const Lights& lights, const LightPoint& point);

// A density that depends on the point that is to be lit.
bool sample_direct(const Lights& lights, Vec3f reference, float u_select, Vec2f u, float time,
                   LightPoint& point, double& pdf);
double pdf_direct(const Lights& lights, const LightPoint& point, Vec3f reference);

// `direction`: unit, leaving the light; ignored at infinity, where the point is the direction. The
// environment: the sum over its lights. Dirac lights: irradiance. `receiver`: the kind of what it
// arrives at, see LightLinks.
Spectrum radiance(const Lights& lights, const LightPoint& point, Vec3f direction,
                  uint32_t receiver = every_receiver);
// The part that one light of the environment has in it.
Spectrum environment_radiance(const Lights& lights, uint32_t light, const LightPoint& point,
                              uint32_t receiver = every_receiver);

// ---------------------------------------------------------------------------------------------
// The first edge of a light subpath.

// Surface lights: a direction that leaves the light, in solid angle.
bool sample_direction(const Lights& lights, const LightPoint& point, Vec2f u, Vec3f& direction,
                      double& pdf);
double pdf_direction(const Lights& lights, const LightPoint& point, Vec3f direction);

// Infinite lights: an origin outside the scene on the disk that faces `direction` (towards the
// light, as LightPoint::direction); light travels along −direction. Density 1/(πR²) on the disk.
void sample_origin(const Lights& lights, Vec3f direction, Vec2f u, Vec3f& origin, double& pdf_area);
double pdf_origin(const Lights& lights);

// ---------------------------------------------------------------------------------------------
// Points that rays find.

// The x0 of a ray that escapes; false without an environment.
bool environment_point(const Lights& lights, Vec3f direction, float time, LightPoint& point);

// Analytic shapes: rects, disks, spheres and cylinders. Both sides are hit; a back side is black.
int shape_count(const Lights& lights);
// At all times.
void shape_bounds(const Lights& lights, int shape, Vec3f& lower, Vec3f& upper);
// False where it is not flat, or moves.
bool flat_shape(const Lights& lights, int shape, Parallelogram& out);
bool intersect_shape(const Lights& lights, int shape, Vec3f origin, Vec3f direction, float time,
                     float tnear, float tfar, float& t, Vec2f& uv);
LightPoint shape_point(const Lights& lights, int shape, Vec2f uv, float time);

LightPoint mesh_point(const Lights& lights, uint32_t light, uint32_t triangle, float b1, float b2,
                      float time);

}  // namespace usdmlt
