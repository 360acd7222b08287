#include "surfaces/triangulation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace usdmlt::surfaces {
namespace {

struct Vec2d {
    double x, y;
    bool operator==(const Vec2d&) const = default;
};

Vec2d operator-(Vec2d a, Vec2d b) { return {a.x - b.x, a.y - b.y}; }
double cross(Vec2d a, Vec2d b) { return a.x * b.y - a.y * b.x; }

// Twice the vector area (Newell's method).
Vec3d newell_normal(std::span<const Vec3d> polygon) {
    if (polygon.size() == 4)  // the cross product of the diagonals
        return usdmlt::cross(polygon[2] - polygon[0], polygon[3] - polygon[1]);
    Vec3d sum;
    for (size_t i = 2; i < polygon.size(); ++i)
        sum = sum + usdmlt::cross(polygon[i - 1] - polygon[0], polygon[i] - polygon[0]);
    return sum;
}

// The first corner that turns against the polygon's normal; the number of corners if none does.
size_t first_reflex_corner(std::span<const Vec3d> polygon) {
    const Vec3d normal = newell_normal(polygon);
    const double least = -1e-9 * dot(normal, normal);
    const size_t n = polygon.size();
    for (size_t i = 0; i < n; ++i) {
        const Vec3d before = polygon[i] - polygon[(i + n - 1) % n];
        const Vec3d after = polygon[(i + 1) % n] - polygon[i];
        if (dot(usdmlt::cross(before, after), normal) < least) return i;
    }
    return n;
}

// Without the coordinate along which the polygon has the largest area, turning left.
std::vector<Vec2d> flattened(std::span<const Vec3d> polygon) {
    const Vec3d n = newell_normal(polygon);
    const double x = std::fabs(n.x), y = std::fabs(n.y), z = std::fabs(n.z);
    std::vector<Vec2d> flat;
    for (const Vec3d& p : polygon) {
        if (x >= y && x >= z)
            flat.push_back({n.x < 0 ? -p.y : p.y, p.z});
        else if (y >= z)
            flat.push_back({n.y < 0 ? p.x : -p.x, p.z});
        else
            flat.push_back({n.z < 0 ? -p.x : p.x, p.y});
    }
    return flat;
}

// Whether one of `points` is in a triangle, deeper than a tolerance (0: or touches it). Points at
// the triangle's own corners are not: bridges to holes repeat points.
bool holds_any(const std::array<Vec2d, 3>& corners, const std::vector<Vec2d>& points,
               double tolerance) {
    return std::any_of(points.begin(), points.end(), [&](Vec2d p) {
        double depth = std::numeric_limits<double>::infinity();
        for (int i = 0; i < 3; ++i) {
            const Vec2d start = corners[(i + 2) % 3];
            if (p == start) return false;
            depth = std::min(depth, cross(corners[i] - start, p - start));
        }
        return tolerance == 0 ? depth >= 0 : depth > tolerance;
    });
}

// A convex corner of a ring whose triangle holds no other corner, or else the most convex one.
// Only reflex corners can be inside an ear. Ears that none so much as touches come first.
size_t find_ear(const std::vector<Vec2d>& ring) {
    const size_t n = ring.size();
    std::vector<double> turns(n);
    std::vector<Vec2d> reflex;
    double largest = 0;
    for (size_t i = 0; i < n; ++i) {
        turns[i] = cross(ring[i] - ring[(i + n - 1) % n], ring[(i + 1) % n] - ring[i]);
        if (turns[i] <= 0) reflex.push_back(ring[i]);
        largest = std::max(largest, std::fabs(turns[i]));
    }
    for (const double tolerance : {0.0, 1e-12 * largest})
        for (size_t i = 0; i < n; ++i)
            if (turns[i] > 0 &&
                !holds_any({ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]}, reflex, tolerance))
                return i;
    return static_cast<size_t>(std::max_element(turns.begin(), turns.end()) - turns.begin());
}

// One simple polygon by ear clipping (Meisters 1975). A polygon that crosses itself still gives two
// triangles fewer than it has corners.
template <class Emit>
void clip_ears(std::span<const Vec3d> polygon, Emit emit) {
    std::vector<Vec2d> ring = flattened(polygon);
    std::vector<uint32_t> left(ring.size());
    for (uint32_t i = 0; i < left.size(); ++i) left[i] = i;
    while (left.size() > 3) {
        const size_t ear = find_ear(ring), n = left.size();
        emit(left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]);
        ring.erase(ring.begin() + static_cast<std::ptrdiff_t>(ear));
        left.erase(left.begin() + static_cast<std::ptrdiff_t>(ear));
    }
    emit(left[0], left[1], left[2]);
}

// Whether a triangle has an area.
bool is_solid(Vec3d a, Vec3d b, Vec3d c) {
    const Vec3d u = b - a, v = c - a, w = c - b, normal = usdmlt::cross(u, v);
    const double longest = std::max({dot(u, u), dot(v, v), dot(w, w)});
    return dot(normal, normal) > sqr(1e-12 * longest);
}

}  // namespace

bool Polygons::are_sound() const {
    size_t corners = 0;
    for (const int32_t count : counts) {
        if (count < 0) return false;
        corners += static_cast<size_t>(count);
    }
    return corners == indices.size() &&
           std::all_of(indices.begin(), indices.end(),
                       [&](int32_t i) { return i >= 0 && size_t(i) < points.size(); }) &&
           std::all_of(points.begin(), points.end(), [](Vec3f p) { return is_finite(p); });
}

Triangulation triangulate(const Polygons& polygons) {
    size_t triangles = 0;
    for (const int32_t count : polygons.counts) triangles += size_t(std::max(count - 2, 0));
    Triangulation out;
    out.corners.reserve(triangles);
    out.faces.reserve(triangles);
    std::vector<Vec3d> polygon;
    uint32_t start = 0;
    for (size_t face = 0; face < polygons.counts.size(); ++face) {
        const auto sides = static_cast<uint32_t>(polygons.counts[face]);
        const auto emit = [&](uint32_t a, uint32_t b, uint32_t c) {
            out.corners.push_back({start + a, start + b, start + c});
            out.faces.push_back(static_cast<int32_t>(face));
        };
        uint32_t reflex = sides;
        if (sides > 3) {
            polygon.clear();
            for (uint32_t i = 0; i < sides; ++i)
                polygon.push_back(to_double(polygons.points[size_t(polygons.indices[start + i])]));
            reflex = static_cast<uint32_t>(first_reflex_corner(polygon));
        }
        if (reflex < sides && sides > 4) {
            clip_ears(polygon, emit);
        } else {  // the diagonal of a quadrilateral leaves from its reflex corner, if it has one
            const uint32_t first = reflex < sides ? reflex : 0;
            for (uint32_t i = 2; i < sides; ++i)
                emit(first, (first + i - 1) % sides, (first + i) % sides);
        }
        start += sides;
    }
    return out;
}

VisibleTriangles visible_triangles(const Polygons& polygons, bool left_handed,
                                   std::span<const bool> holes) {
    const auto point = [&](uint32_t corner) {
        return to_double(polygons.points[size_t(polygons.indices[corner])]);
    };
    VisibleTriangles out;
    const bool triangles = std::all_of(polygons.counts.begin(), polygons.counts.end(),
                                       [](int32_t count) { return count == 3; });
    if (triangles && !left_handed && holes.empty()) {
        out.as_authored = true;
        for (uint32_t c = 0; c < polygons.indices.size() && out.as_authored; c += 3)
            out.as_authored = is_solid(point(c), point(c + 1), point(c + 2));
        if (out.as_authored) return out;
    }
    out.triangulation = triangulate(polygons);
    auto& [corners, faces] = out.triangulation;
    out.vertices.reserve(corners.size());
    size_t kept = 0;
    for (size_t i = 0; i < corners.size(); ++i) {
        Triangle t = corners[i];
        if (!holes.empty() && holes[size_t(faces[i])]) continue;
        if (!is_solid(point(t.v[0]), point(t.v[1]), point(t.v[2]))) {
            ++out.flat;
            continue;
        }
        if (left_handed) std::swap(t.v[1], t.v[2]);
        corners[kept] = t;
        faces[kept++] = faces[i];
        out.vertices.push_back({});
        for (int j = 0; j < 3; ++j)
            out.vertices.back().v[j] = static_cast<uint32_t>(polygons.indices[t.v[j]]);
    }
    corners.resize(kept);
    faces.resize(kept);
    return out;
}

}  // namespace usdmlt::surfaces
