// Inputs of materials: constants, textures, primvars.
#pragma once

#include <cstdint>
#include <vector>

#include "base/spectrum.hpp"
#include "geometry/mesh.hpp"
#include "materials/texture.hpp"

namespace usdmlt {

// A texture read at a primvar's (s, t); parameters that read the same place share it.
struct TextureRead {
    uint32_t texture = 0;
    uint32_t primvar = 0;                     // slot
    float transform[6] = {1, 0, 0, 0, 1, 0};  // rows of A in A·(s, t, 1)

    bool operator==(const TextureRead&) const = default;
};

inline constexpr int max_texture_reads = 64;  // of one material

struct Parameter {
    enum class Source : uint8_t { constant, texture, primvar };
    enum class Channel : uint8_t { r, g, b, a, rgb };

    Source source = Source::constant;
    Channel channel = Channel::rgb;                         // texture
    uint32_t index = 0;                                     // texture: a read; primvar: slot
    float scale[4] = {1, 1, 1, 1}, bias[4] = {0, 0, 0, 0};  // texture
    Spectrum value{};                                       // constant; primvar: fallback

    bool is_constant() const { return source == Source::constant; }
};

// A point of a triangle: the barycentrics are (1 − b1 − b2, b1, b2).
struct MeshPoint {
    const Mesh& mesh;
    uint32_t triangle;
    float b1, b2;

    // Interpolates up to four floats of a primvar; returns how many, 0 where the mesh lacks it.
    int primvar(uint32_t slot, float out[4]) const;
};

// Reads parameters at one point; a texture place is looked up once.
class ParameterReader {
public:
    ParameterReader(const std::vector<Texture>& textures, const std::vector<TextureRead>& reads,
                    const MeshPoint& point)
        : textures_(textures), reads_(reads), point_(point) {}

    // A scalar source gives its value in all three lanes.
    Spectrum color(const Parameter& parameter);
    // A colour source gives its first lane.
    float number(const Parameter& parameter) { return color(parameter)[0]; }

private:
    const Texel& texel(uint32_t read);

    const std::vector<Texture>& textures_;
    const std::vector<TextureRead>& reads_;
    MeshPoint point_;
    uint64_t done_ = 0;  // bit per read
    Texel texels_[max_texture_reads];
};

}  // namespace usdmlt
