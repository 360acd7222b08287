// Light linking: which lights illuminate which meshes (UsdLuxLightAPI's collection:lightLink).
//
// It is a factor 0 or 1 of the emission Le(x0 → x1), by the pair of the light at x0 and the mesh at
// x1, and by nothing else of the path: what reflects linked light lights everything, and what a
// light is not linked to still hides it. The lens sees all light. Densities know nothing of it.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/mesh.hpp"

namespace usdmlt {

// What is no mesh, such as the lens: all light arrives there.
inline constexpr uint32_t every_receiver = invalid_index;

struct LightLinks {
    uint32_t collections = 0;
    // Whether each kind of receiver is in each collection. Empty: no light is linked.
    std::vector<uint8_t> members;
    std::vector<uint32_t> of_light;  // collection of each light; invalid_index: of everything

    bool empty() const { return members.empty(); }
    bool illuminates(uint32_t light, uint32_t receiver) const {
        if (members.empty() || receiver == every_receiver) return true;
        const uint32_t collection = of_light[light];
        return collection == invalid_index ||
               members[size_t(receiver) * collections + collection] != 0;
    }
};

}  // namespace usdmlt
