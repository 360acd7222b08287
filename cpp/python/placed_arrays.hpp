// Arrays of points and matrices as scene descriptions have them, placed in the core's space.
#pragma once

#include <pybind11/numpy.h>

#include "base/frame.hpp"
#include "geometry/mesh.hpp"
#include "python/arrays.hpp"

namespace usdmlt {

namespace py = pybind11;

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<int32_t, py::array::c_style | py::array::forcecast>;

// Affine transform in double, from USD's row-vector 4×4 matrices.
struct Affine3d {
    Vec3d x, y, z, origin;

    Vec3d point(Vec3d p) const { return x * p.x + y * p.y + z * p.z + origin; }
    double determinant() const { return dot(cross(x, y), z); }
    Vec3d normal(Vec3d n) const {
        const Vec3d v = cross(y, z) * n.x + cross(z, x) * n.y + cross(x, y) * n.z;
        return determinant() < 0 ? v * -1 : v;
    }
    Vec3d vector(Vec3d v) const { return x * v.x + y * v.y + z * v.z; }
    // This first, the other one afterwards.
    Affine3d then(const Affine3d& m) const {
        return {m.vector(x), m.vector(y), m.vector(z), m.point(origin)};
    }
    Affine3f inverse() const {
        const double d = 1 / determinant();
        const Vec3d a = cross(y, z) * d, b = cross(z, x) * d, c = cross(x, y) * d;
        return {to_float({a.x, b.x, c.x}), to_float({a.y, b.y, c.y}), to_float({a.z, b.z, c.z}),
                to_float({-dot(a, origin), -dot(b, origin), -dot(c, origin)})};
    }
    Affine3f recentred(Vec3d center) const {
        return {to_float(x), to_float(y), to_float(z), to_float(origin - center)};
    }
};

inline Affine3d affine(const double* m) {
    return {{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}, {m[12], m[13], m[14]}};
}

inline Affine3d affine(const py::handle& matrix) {
    const auto array = py::cast<Doubles>(matrix);
    if (array.size() != 16) throw std::invalid_argument("a transform must be 4x4");
    return affine(array.data());
}

// Numbers of the array's own memory where it has their type and order, else of a copy.
template <class T, class Array>
SharedArray<T> shared(Array array) {
    const auto size = static_cast<size_t>(array.nbytes()) / sizeof(T);
    return {share<T>(std::move(array)), size};
}

inline SharedArray<Triangle> triangles_of(const Indices& array, bool flipped) {
    if (!flipped) return shared<Triangle>(array);
    const int32_t* t = array.data();
    std::vector<Triangle> out(static_cast<size_t>(array.size() / 3));
    for (size_t i = 0; i < out.size(); ++i)
        out[i] = {uint32_t(t[3 * i]), uint32_t(t[3 * i + 2]), uint32_t(t[3 * i + 1])};
    return out;
}

inline std::vector<Vec3f> placed_points(const Floats& points, const Affine3d& m, Vec3d center) {
    const float* p = points.data();
    const auto count = static_cast<size_t>(points.shape(0));
    std::vector<Vec3f> out;
    out.reserve(count + 1);  // Embree reads 16 bytes at the last vertex
    for (size_t i = 0; i < count; ++i)
        out.push_back(to_float(m.point({p[3 * i], p[3 * i + 1], p[3 * i + 2]}) - center));
    return out;
}

}  // namespace usdmlt
