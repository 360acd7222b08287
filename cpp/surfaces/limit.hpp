// Where the vertices of a refined cage go in the limit, and the tangent plane there.
//
// Limit masks: Halstead, Kass and DeRose (1993) for Catmull–Clark, Loop (1987) and Hoppe et al.
// (1994) for triangles, Biermann, Levin and Zorin (2000) for creases.
#pragma once

#include <cstdint>
#include <vector>

#include "base/vec.hpp"
#include "surfaces/cage.hpp"
#include "surfaces/refinement.hpp"

namespace usdmlt::surfaces {

// From the vertices of a cage of quadrilaterals (Loop: triangles) to the limit surface.
//
// Catmull–Clark: (n² V + 4 Σ E + Σ F) / (n (n + 5)) with the opposite corners F of the faces; Loop:
// (V / (8β/3) + Σ E) / (n + 3/(8β)); creases: (4 V + E + E) / 6. What is still sharp stays so.
Stencils limit_positions(const Cage& cage, Scheme scheme);

// The corners around vertices, counter-clockwise, apart where creases divide them.
struct Sectors {
    std::vector<int32_t> sector, position;  // of each corner, and the how-manieth of it
    std::vector<int32_t> size;              // faces of each sector
    std::vector<uint8_t> closed;            // whether it goes all the way round
};
// A single sharp edge, a dart, divides nothing.
Sectors find_sectors(const Cage& cage);

// Two tangents per sector; none, that is zero, at corners.
//
// They are the left eigenvectors of the subdivision matrix around a vertex V with edge ends E_j and
// opposite corners F_j. Closed sectors of n faces, t = 2π/n: the sum of
// cos(jt) A E_j + (cos(jt) + cos((j + 1)t)) F_j, and with sines, where
// A = 1 + cos t + cos(t/2) √(2 (9 + cos t)). Open ones of k faces, t = π/k: E_0 − E_k along the
// crease; across it the same sines, and for V and the ends what the equations of their columns
// leave: see CreaseEnds. Loop's have E_j only, and A = 1. (Biermann et al. have another mask across
// creases, for their modified rules.)
struct Tangents {
    Stencils along, across;
};
Tangents tangents(const Cage& cage, Scheme scheme, const Sectors& sectors);

// Unit normals, and which of them each corner has, from the vertices of the cage and where these
// are in the limit. Smooth schemes have one per sector; corners, and where the surface has no
// tangent plane, get the mean normal of the faces beside them. Bilinear patches have one per
// corner.
struct Normals {
    std::vector<Vec3d> values;
    std::vector<int32_t> of_corner;
};
Normals limit_normals(const Cage& cage, Scheme scheme, const Vec3d* vertices, const Vec3d* limit);

}  // namespace usdmlt::surfaces
