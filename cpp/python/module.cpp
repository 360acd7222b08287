// The extension module usdmlt._core.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "python/bind_embree.hpp"
#include "python/bind_film.hpp"
#include "python/bind_layers.hpp"
#include "python/bind_lights.hpp"
#include "python/bind_materials.hpp"
#include "python/bind_media.hpp"
#include "python/bind_metropolis.hpp"
#include "python/bind_mutations.hpp"
#include "python/bind_paths.hpp"
#include "python/bind_patterns.hpp"
#include "python/bind_render.hpp"
#include "python/bind_scene.hpp"
#include "python/bind_surfaces.hpp"

namespace py = pybind11;

namespace {

const char* compiler() {
#if defined(__clang__)
    return "clang " __clang_version__;
#elif defined(__GNUC__)
    return "gcc " __VERSION__;
#elif defined(_MSC_VER)
    return "msvc";
#else
    return "unknown";
#endif
}

const char* instruction_set() {
#if defined(__AVX512F__)
    return "x86-64-v4";
#elif defined(__AVX2__) && defined(__FMA__)
    return "x86-64-v3";
#elif defined(__x86_64__) || defined(_M_X64)
    return "x86-64";
#elif defined(__aarch64__) || defined(_M_ARM64)
    return "arm64";
#else
    return "unknown";
#endif
}

}  // namespace

PYBIND11_MODULE(_core, module) {
    module.doc() = "The C++ core of usdmlt.";
    module.def("build_info", [] {
        py::dict info;
        info["compiler"] = compiler();
        info["instruction_set"] = instruction_set();
#ifdef NDEBUG
        info["assertions"] = false;
#else
        info["assertions"] = true;
#endif
        return info;
    });
    usdmlt::bind_embree(module);
    usdmlt::bind_materials(module);
    usdmlt::bind_lights(module);
    usdmlt::bind_scene(module);
    usdmlt::bind_media(module);
    usdmlt::bind_surfaces(module);
    usdmlt::bind_paths(module);
    usdmlt::bind_patterns(module);
    usdmlt::bind_mutations(module);
    usdmlt::bind_metropolis(module);
    usdmlt::bind_film(module);
    usdmlt::bind_render(module);
    usdmlt::bind_layers(module);
}
