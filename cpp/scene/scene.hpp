// The scene: owns geometry, materials, lights and camera; immutable once built.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cameras/camera.hpp"
#include "geometry/acceleration.hpp"
#include "lights/lights.hpp"
#include "materials/material.hpp"
#include "media/media.hpp"

namespace usdmlt {

struct Scene {
    Vec3d origin;      // world position of the core's origin: positions below are relative to it
    float radius = 1;  // of a sphere about the core's origin that holds everything

    std::vector<Mesh> meshes;  // world meshes first, then those of the prototypes
    uint32_t world_meshes = 0;
    std::vector<MeshRange> prototypes;
    std::vector<Instance> instances;
    std::vector<Affine3f> instance_steps;  // further transforms of those that move
    bool has_motion = false;               // anything moves while the shutter is open

    Materials materials;
    Lights lights;
    Media media;
    Camera camera;
    double exposure = 1;     // multiplies the developed image
    bool background = true;  // the camera sees environments directly

    std::unique_ptr<Acceleration> acceleration;
    bool all_opaque = true;  // no ray passes any surface,
    bool all_whole = true;   // or does so by chance

    // Light of each mesh of the world; of each emissive mesh of each instance. invalid_index: none.
    std::vector<uint32_t> mesh_lights;
    std::vector<uint32_t> instance_first_light;
    std::vector<uint32_t>
        emissive_rank;  // by mesh: its place among its prototype's emissive meshes

    uint32_t light_of(uint32_t mesh, uint32_t instance) const {
        if (instance == invalid_index) return mesh_lights[mesh];
        return emissive_rank[mesh] == invalid_index
                   ? invalid_index
                   : instance_first_light[instance] + emissive_rank[mesh];
    }

    // What lights are linked to of a surface; mesh: invalid_index for a light's own shape.
    uint32_t receiver_of(uint32_t mesh) const {
        return lights.links.empty() || mesh == invalid_index ? every_receiver
                                                             : meshes[mesh].receiver;
    }

    Affine3f placement(uint32_t instance, float time) const {
        const Instance& placed = instances[instance];
        return transform_at(placed.to_world, placed.later(instance_steps), time);
    }

    // To be called once everything above but the acceleration structure and the lights of meshes
    // is in place: builds both and finishes the lights.
    void commit(const std::shared_ptr<const embree::Library>& library, const std::string& isa);
};

}  // namespace usdmlt
