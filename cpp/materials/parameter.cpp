#include "materials/parameter.hpp"

namespace usdmlt {

int MeshPoint::primvar(uint32_t slot, float out[4]) const {
    if (slot >= mesh.primvars.size() || mesh.primvars[slot].empty()) return 0;
    const CornerValues& values = mesh.primvars[slot];
    const Triangle& vertices = mesh.triangles[triangle];
    const float *v0 = values.at(vertices, triangle, 0), *v1 = values.at(vertices, triangle, 1),
                *v2 = values.at(vertices, triangle, 2);
    for (int i = 0; i < values.width; ++i)
        out[i] = v0[i] + b1 * (v1[i] - v0[i]) + b2 * (v2[i] - v0[i]);
    return values.width;
}

const Texel& ParameterReader::texel(uint32_t i) {
    Texel& texel = texels_[i];
    if (done_ >> i & 1) return texel;
    done_ |= uint64_t(1) << i;
    const TextureRead& read = reads_[i];
    float st[4] = {0, 0, 0, 0};
    point_.primvar(read.primvar, st);
    const float* m = read.transform;
    texel = textures_[read.texture].lookup(
        {m[0] * st[0] + m[1] * st[1] + m[2], m[3] * st[0] + m[4] * st[1] + m[5]});
    return texel;
}

Spectrum ParameterReader::color(const Parameter& p) {
    switch (p.source) {
        case Parameter::Source::constant:
            break;
        case Parameter::Source::texture: {
            const Texel& t = texel(p.index);
            const auto channel = [&](int i) { return t[i] * p.scale[i] + p.bias[i]; };
            if (p.channel == Parameter::Channel::rgb)
                return Spectrum(channel(0), channel(1), channel(2));
            return Spectrum(channel(static_cast<int>(p.channel)));
        }
        case Parameter::Source::primvar: {
            float v[4] = {0, 0, 0, 0};
            const int width = point_.primvar(p.index, v);
            if (width == 1) return Spectrum(v[0]);
            if (width > 1) return Spectrum(v[0], v[1], v[2]);
            break;
        }
    }
    return p.value;
}

}  // namespace usdmlt
