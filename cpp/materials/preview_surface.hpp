// UsdPreviewSurface as a closure.
#pragma once

#include "materials/closure_builder.hpp"

namespace usdmlt {

struct PreviewSurfaceInputs {
    Spectrum diffuse_color, emissive_color, specular_color;
    float metallic, roughness, clearcoat, clearcoat_roughness, opacity, ior;
    bool specular_workflow;
};

// Pushes one operand.
void push_preview_surface(ClosureBuilder& builder, const PreviewSurfaceInputs& inputs);

}  // namespace usdmlt
