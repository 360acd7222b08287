// Perspective (pinhole or thin lens) and orthographic cameras.
//
// Raster coordinates: x right, y down, pixels of the image cover [0, width] × [0, height]; a pixel
// filter reaches a little beyond. Importance is uniform over the film, so that
//     We·cosθ / (p_lens · p_ω) = 1   (perspective),     We·|cosθ1| / p(x1) = 1   (orthographic).
// An orthographic camera is a direction at infinity, the mirror image of a distant light.
//
// A camera that moves has a pose for every time of the shutter's interval; its lens and window stay
// as they are, so that its densities do not depend on time but through the pose.
#pragma once

#include <algorithm>
#include <vector>

#include "base/frame.hpp"
#include "base/warps.hpp"
#include "geometry/motion.hpp"

namespace usdmlt {

struct CameraRay {
    Vec3f origin, direction;
    float tnear, tfar;
};

// What is on the side of n·p + d < 0 is not seen (UsdGeomCamera, clippingPlanes).
struct ClippingPlane {
    Vec3f normal;
    float offset;

    float side(Vec3f p) const { return dot(normal, p) + offset; }
};

struct CameraPose {
    Vec3f position;            // of the lens centre
    Vec3f right, up, forward;  // orthonormal; may be left-handed
};

struct Camera {
    bool orthographic = false;
    std::vector<CameraPose> poses{1};  // at equidistant times; one: it does not move
    float left = -0.5f, top = 0.5f;    // window, at distance 1 or in scene units
    float window_width = 1, window_height = 1;
    int width = 1, height = 1;  // pixels
    float lens_radius = 0, focus_distance = 1;
    float near = 0, far = 1e30f;                 // along the view axis
    std::vector<ClippingPlane> clipping_planes;  // in the space of the first pose

    bool moves() const { return poses.size() > 1; }
    CameraPose pose(float time) const { return moves() ? interpolated_pose(time) : poses[0]; }

    double window_area() const { return double(window_width) * window_height; }

    // Offset of a lens point from the centre, from the unit square.
    Vec3f sample_lens(Vec2f u, float time) const {
        const CameraPose at = pose(time);
        if (lens_radius == 0) return at.position;
        const Vec2f d = square_to_disk(u) * lens_radius;
        return at.position + at.right * d.x + at.up * d.y;
    }
    double pdf_lens() const {
        return lens_radius > 0 ? 1 / (double(pi) * lens_radius * lens_radius) : 1;
    }

    // The ray of a raster point through a lens point (which an orthographic camera ignores).
    CameraRay ray(Vec2f raster, Vec3f lens_point, float time) const {
        const auto [position, right, up, forward] = pose(time);
        const float x = left + window_width * raster.x / width;
        const float y = top - window_height * raster.y / height;
        if (orthographic) return clipped({position + right * x + up * y, forward, near, far}, time);
        const Vec3f focus = position + (right * x + up * y + forward) * focus_distance;
        const Vec3f direction = lens_radius > 0 ? normalize(focus - lens_point)
                                                : normalize(right * x + up * y + forward);
        const float cos_theta = dot(direction, forward);
        return clipped({lens_point, direction, near / cos_theta, far / cos_theta}, time);
    }

    // The part of a ray that the planes leave: an interval, as what they leave is convex.
    CameraRay clipped(CameraRay ray, float time) const {
        if (clipping_planes.empty()) return ray;
        const Vec3f origin = to_first_pose(ray.origin, time);
        const Vec3f direction = turned_to_first_pose(ray.direction, time);
        for (const ClippingPlane& plane : clipping_planes) {
            const float slope = dot(plane.normal, direction), side = plane.side(origin);
            if (slope > 0) ray.tnear = std::max(ray.tnear, -side / slope);
            if (slope < 0) ray.tfar = std::min(ray.tfar, -side / slope);
            if (slope == 0 && side < 0) ray.tfar = ray.tnear;
        }
        if (!(ray.tnear < ray.tfar)) ray.tnear = ray.tfar = 0;
        return ray;
    }

    // How far the segment from a point that is seen along `direction`, towards the lens, is in
    // what is seen: what is nearer to the lens hides nothing. `t`: of the near plane.
    float seen_until(Vec3f from, Vec3f direction, float t, float time) const {
        if (clipping_planes.empty()) return t;
        from = to_first_pose(from, time);
        direction = turned_to_first_pose(direction, time);
        for (const ClippingPlane& plane : clipping_planes) {
            const float slope = dot(plane.normal, direction);
            if (slope < 0) t = std::min(t, std::max(-plane.side(from) / slope, 0.0f));
        }
        return t;
    }

    // The raster point whose ray through the lens point meets `p`; false outside the clipping
    // range. `direction` is unit, from the lens to p.
    bool project(Vec3f p, Vec3f lens_point, float time, Vec2f& raster, Vec3f& direction) const {
        const auto [position, right, up, forward] = pose(time);
        const Vec3f d = p - (orthographic ? position : lens_point);
        const float depth = dot(d, forward);
        if (!(depth > near && depth < far) || !(depth > 0 || orthographic)) return false;
        for (const ClippingPlane& plane : clipping_planes)
            if (plane.side(to_first_pose(p, time)) < 0) return false;
        float x, y;
        if (orthographic) {
            direction = forward;
            x = dot(d, right);
            y = dot(d, up);
        } else {
            direction = normalize(d);
            const Vec3f on_focus_plane = lens_point + d * (focus_distance / depth) - position;
            x = lens_radius > 0 ? dot(on_focus_plane, right) / focus_distance
                                : dot(d, right) / depth;
            y = lens_radius > 0 ? dot(on_focus_plane, up) / focus_distance : dot(d, up) / depth;
        }
        raster = {(x - left) / window_width * width, (top - y) / window_height * height};
        return std::isfinite(raster.x) && std::isfinite(raster.y);
    }

    // Perspective: density of a direction in solid angle, uniform over the window:
    // p_ω = 1/(A cos³θ) for every lens point.
    double pdf_direction(Vec3f direction, float time) const {
        const double c = dot(direction, pose(time).forward);
        return c > 0 ? 1 / (window_area() * c * c * c) : 0;
    }
    // Orthographic: area density of the ray's origin on the film plane.
    double pdf_origin() const { return 1 / window_area(); }

    // Of the ray in either measure: direction, or origin for an orthographic camera.
    double pdf_ray(Vec3f direction, float time) const {
        return orthographic ? pdf_origin() : pdf_direction(direction, time);
    }

    // We towards a direction: p_lens·p_ω/cosθ, or 1/A for an orthographic camera.
    double importance(Vec3f direction, float time) const {
        if (orthographic) return pdf_origin();
        const double pdf = pdf_direction(direction, time);
        return pdf > 0 ? pdf_lens() * pdf / dot(direction, pose(time).forward) : 0;
    }

private:
    CameraPose interpolated_pose(float time) const {
        const TimeSegment t(time, poses.size());
        const CameraPose &a = poses[t.first], &b = poses[t.first + 1];
        CameraPose out;
        out.position = interpolate(a.position, b.position, t.fraction);
        out.forward = normalize(interpolate(a.forward, b.forward, t.fraction));
        const Vec3f right = interpolate(a.right, b.right, t.fraction);
        out.right = normalize(right - out.forward * dot(right, out.forward));
        const Vec3f up = cross(out.right, out.forward);
        out.up = dot(up, a.up) < 0 ? -up : up;
        return out;
    }

    // What moves with the camera, where it was at first.
    Vec3f turned_to_first_pose(Vec3f v, float time) const {
        if (!moves()) return v;
        const CameraPose at = pose(time);
        const CameraPose& first = poses[0];
        return first.right * dot(v, at.right) + first.up * dot(v, at.up) +
               first.forward * dot(v, at.forward);
    }
    Vec3f to_first_pose(Vec3f p, float time) const {
        if (!moves()) return p;
        return poses[0].position + turned_to_first_pose(p - pose(time).position, time);
    }
};

}  // namespace usdmlt
