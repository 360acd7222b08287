// coat over (specular over (diffuse · opacity + transmission · (1 − opacity))) + emission, the
// structure of MaterialX's graph of UsdPreviewSurface (libraries/bxdf/usd_preview_surface.mtlx),
// with the reflectances of the specification: r = (1 − ior) / (1 + ior);
//     metallic workflow: s = lerp(1, diffuseColor, metallic), F0 = lerp(r² s, s, metallic), F90 =
//     s,
//                        diffuse and transmission × (1 − metallic);
//     specular workflow: F0 = specularColor, F90 = 1;
//     coat:              F0 = r², F90 = 1, weight clearcoat.
// GGX of alpha = roughness².
//
// Where opacity < 1 the surface bounds a medium of index ior. The refracting lobe is smooth and has
// no Fresnel loss of its own: the specular lobe above it already takes its share. (A dielectric
// there, as MaterialX's graph reads word for word, would lose it twice.) From inside, the specular
// and coat lobes see the refracted angle and total reflection, so that a smooth, clear surface
// reflects F and transmits 1 − F from both sides.
#include "materials/preview_surface.hpp"

namespace usdmlt {

void push_preview_surface(ClosureBuilder& builder, const PreviewSurfaceInputs& in) {
    const float eta = sane_index(in.ior);
    const Spectrum normal_reflectance(sqr((1 - eta) / (1 + eta)));
    const Spectrum white(1.0f);
    const float metallic = in.specular_workflow ? 0.0f : unit_interval(in.metallic);
    const float opacity = unit_interval(in.opacity);
    const float transmission = (1 - metallic) * (1 - opacity);

    Lobe specular{LobeType::schlick};
    specular.is_interface = transmission > 0;
    specular.eta = eta;
    specular.alpha_x = specular.alpha_y = sqr(in.roughness);
    Lobe coat = specular;
    if (in.specular_workflow) {
        specular.color0 = in.specular_color;
        specular.color90 = white;
    } else {
        const Spectrum tint = white * (1 - metallic) + in.diffuse_color * metallic;
        specular.color0 = tint * (normal_reflectance * (1 - metallic) + white * metallic);
        specular.color90 = tint;
    }

    coat.color0 = normal_reflectance;
    coat.color90 = white;
    coat.alpha_x = coat.alpha_y = sqr(in.clearcoat_roughness);
    coat.coverage = unit_interval(in.clearcoat);
    coat.weight = Spectrum(coat.coverage);

    Lobe diffuse{LobeType::diffuse};
    diffuse.weight = in.diffuse_color * ((1 - metallic) * opacity);

    Lobe refraction{LobeType::schlick};
    refraction.reflects = false;
    refraction.transmits = true;
    refraction.color0 = Spectrum();
    refraction.eta = eta;
    refraction.weight = Spectrum(transmission);

    const bool has_coat = coat.coverage > 0;
    if (has_coat) builder.push_lobe(coat);
    builder.push_lobe(specular);
    builder.push_lobe(diffuse);
    if (transmission > 0) {
        builder.push_lobe(refraction);
        builder.add();
    }
    builder.layer();
    if (has_coat) builder.layer();
    builder.push_emission(in.emissive_color);
    builder.add();
}

}  // namespace usdmlt
