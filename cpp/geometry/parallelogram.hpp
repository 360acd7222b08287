// Flat shapes, as they lie among triangles.
#pragma once

#include "base/vec.hpp"

namespace usdmlt {

// corner + u·edge_u + v·edge_v, u and v in [0, 1]: all of it, or the ellipse that touches its
// edges.
struct Parallelogram {
    Vec3f corner, edge_u, edge_v;
    bool ellipse = false;
};

}  // namespace usdmlt
