#include "geometry/embree_library.hpp"

#include <map>
#include <mutex>
#include <stdexcept>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#else
#include <dlfcn.h>
#endif

namespace usdmlt::embree {
namespace {

#ifdef _WIN32
void* open_library(const std::string& path, std::string& error) {
    void* handle = LoadLibraryExA(path.c_str(), nullptr, LOAD_WITH_ALTERED_SEARCH_PATH);
    if (!handle) error = "error " + std::to_string(GetLastError());
    return handle;
}
void* find_symbol(void* handle, const char* name) {
    return reinterpret_cast<void*>(GetProcAddress(static_cast<HMODULE>(handle), name));
}
#else
void* open_library(const std::string& path, std::string& error) {
    void* handle = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!handle) error = dlerror();
    return handle;
}
void* find_symbol(void* handle, const char* name) { return dlsym(handle, name); }
#endif

template <class Function>
void resolve(void* handle, const std::string& path, const char* name, Function& function) {
    void* symbol = find_symbol(handle, name);
    if (!symbol)
        throw std::runtime_error("Embree library " + path + " has no function " + name +
                                 "; usdmlt needs Embree 4");
    function = reinterpret_cast<Function>(symbol);
}

std::shared_ptr<const Library> load_uncached(const std::string& path) {
    std::string error;
    void* handle = open_library(path, error);
    if (!handle) throw std::runtime_error("cannot load the Embree library " + path + ": " + error);
    auto library = std::make_shared<Library>();
    library->path = path;
#define USDMLT_RESOLVE(name) resolve(handle, path, #name, library->name)
    USDMLT_RESOLVE(rtcNewDevice);
    USDMLT_RESOLVE(rtcReleaseDevice);
    USDMLT_RESOLVE(rtcGetDeviceProperty);
    const DevicePointer device(library->rtcNewDevice("threads=1"), {library.get()});
    if (!device) throw std::runtime_error("Embree library " + path + " gives no device");
    // The version comes first: another major version may lack functions or differ in layout.
    const auto property = [&](int p) {
        return static_cast<int>(library->rtcGetDeviceProperty(device.get(), p));
    };
    const int major = property(property_version_major);
    library->version = std::to_string(major) + "." +
                       std::to_string(property(property_version_minor)) + "." +
                       std::to_string(property(property_version_patch));
    if (major != 4)
        throw std::runtime_error("Embree library " + path + " is version " + library->version +
                                 "; usdmlt needs Embree 4");
    USDMLT_RESOLVE(rtcGetDeviceError);
    USDMLT_RESOLVE(rtcSetDeviceErrorFunction);
    USDMLT_RESOLVE(rtcNewScene);
    USDMLT_RESOLVE(rtcReleaseScene);
    USDMLT_RESOLVE(rtcSetSceneFlags);
    USDMLT_RESOLVE(rtcSetSceneBuildQuality);
    USDMLT_RESOLVE(rtcCommitScene);
    USDMLT_RESOLVE(rtcGetSceneBounds);
    USDMLT_RESOLVE(rtcNewGeometry);
    USDMLT_RESOLVE(rtcReleaseGeometry);
    USDMLT_RESOLVE(rtcCommitGeometry);
    USDMLT_RESOLVE(rtcAttachGeometry);
    USDMLT_RESOLVE(rtcSetSharedGeometryBuffer);
    USDMLT_RESOLVE(rtcSetGeometryUserData);
    USDMLT_RESOLVE(rtcSetGeometryUserPrimitiveCount);
    USDMLT_RESOLVE(rtcSetGeometryBoundsFunction);
    USDMLT_RESOLVE(rtcSetGeometryIntersectFunction);
    USDMLT_RESOLVE(rtcSetGeometryOccludedFunction);
    USDMLT_RESOLVE(rtcSetGeometryIntersectFilterFunction);
    USDMLT_RESOLVE(rtcSetGeometryOccludedFilterFunction);
    USDMLT_RESOLVE(rtcSetGeometryInstancedScene);
    USDMLT_RESOLVE(rtcSetGeometryTimeStepCount);
    USDMLT_RESOLVE(rtcSetGeometryTransform);
    USDMLT_RESOLVE(rtcIntersect1);
    USDMLT_RESOLVE(rtcOccluded1);
#undef USDMLT_RESOLVE
    return library;
}

}  // namespace

std::shared_ptr<const Library> load(const std::string& path) {
    static std::mutex mutex;
    static std::map<std::string, std::shared_ptr<const Library>> loaded;
    const std::lock_guard lock(mutex);
    auto& entry = loaded[path];
    if (!entry) entry = load_uncached(path);
    return entry;
}

DevicePointer new_device(const Library& library, const std::string& isa) {
    const std::string config = isa.empty() ? "" : "isa=" + isa;
    Device device = library.rtcNewDevice(config.c_str());
    if (!device || library.rtcGetDeviceError(device) != 0)
        throw std::runtime_error("Embree gives no device for instruction set '" + isa + "'");
    return {device, {&library}};
}

}  // namespace usdmlt::embree
