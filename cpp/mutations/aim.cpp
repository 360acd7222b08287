#include "mutations/aim.hpp"

#include <bit>

namespace usdmlt {
namespace {

// Of the target, in radians as seen from the vertex before it.
constexpr double size_of_points = 0.02, smallest_light = 1e-4, largest_light = 0.2;

constexpr float near_enough = 0.1f, too_far = 3;  // in sizes of the target
constexpr float probe = 1e-3f, longest_step = 0.2f, most_radians = 1e6f;
constexpr int most_corrections = 4;
constexpr float shortest_part = 0.2f;  // of the way from x_i to v
constexpr double least_stretch = 5;    // per radian

float length(Vec2f v) { return std::sqrt(sqr(v.x) + sqr(v.y)); }

// The chain x_i … x_end, and how far from x_end others arrive: in the plane across the old last
// edge, in sizes of the target; at infinity, by direction.
class Chain {
public:
    Chain(MutationContext& context, const Path& x, const Walk& walk, int i)
        : context_(context), x_(x), walk_(walk), start_(i), end_(i + walk.step()) {
        const int step = walk.step();
        while (end_ != 0 && is_passed(x, walk, end_)) end_ += step;
        across_ = Frame::from_normal(direction_along(x, end_ - step, step));
        leaving_ = Frame::from_normal(direction_along(x, i, step));
        const Vertex& target = x[end_];
        const double edge =
            target.infinite ? 1 : usdmlt::length(target.position - x[end_ - step].position);
        size_ = size_of_points * edge;
        // Of a light, by the density of its points: that of several is not far from it.
        if (end_ == 0)
            size_ = std::clamp(std::sqrt(1 / (pi * pdf_point(context.scene.lights, x[0].light))),
                               smallest_light * edge, largest_light * edge);
    }

    uint64_t hash() const {
        uint64_t key = add(0, {x_.time, 0, 0});
        for (int i = start_;; i += walk_.step()) {
            key = add(key, x_[i].infinite ? x_[i].direction : x_[i].position);
            if (i == end_) return key;
        }
    }
    static uint64_t add(uint64_t key, Vec3f p) {
        const auto bits = [](float a) { return uint64_t(std::bit_cast<uint32_t>(a)); };
        return hash_key(hash_key(key, bits(p.x)), bits(p.y) << 32 | bits(p.z));
    }

    // Directions are points of the plane that touches the unit sphere at the old one.
    Vec3f direction(Vec2f w) const { return direction_at(leaving_, w); }
    bool towards(Vec3f direction, Vec2f& w) const {
        const float z = dot(direction, leaving_.z);
        w = Vec2f{dot(direction, leaving_.x), dot(direction, leaving_.y)} * (1 / z);
        return z > 0.1f;
    }

    // Leaves `origin`; `first` becomes the first vertex. False: the chain is another one.
    bool shoot(const Vertex& origin, Vec2f w, Vec2f& miss, Vec3f& first) const {
        Vertex passed[2];
        const Vertex* from = &origin;
        Vec3f next = direction(w);
        RandomStream random(0);
        for (int i = start_ + walk_.step(); i != end_; i += walk_.step()) {
            Vertex& to = passed[i & 1];
            Edge edge;
            const Ray ray = ray_from(*from, next);
            if (!trace_vertex(context_.scene, *from, ray, walk_.role, false, random, context_.rays,
                              to, edge, {MediaStop::Kind::nowhere}))
                return false;
            double pdf;
            if (!pass(x_, i, to, -ray.direction, next, pdf)) return false;
            if (from == &origin) first = to.position;
            from = &to;
        }
        return arrive(ray_from(*from, next), miss);
    }

    // Of the miss by the first direction.
    Matrix2 derivative(const Vertex& origin, Vec2f w, Vec2f miss) const {
        const auto column = [&](Vec2f axis) {
            Vec2f moved;
            Vec3f first;
            for (const float h : {probe, -probe})
                if (shoot(origin, w + axis * h, moved, first)) return (moved - miss) * (1 / h);
            return Vec2f{0, 0};
        };
        const Vec2f x = column({1, 0}), y = column({0, 1});
        return {x.x, y.x, x.y, y.y};
    }

    const Vertex& start() const { return x_[start_]; }
    Vec3f first() const { return x_[start_ + walk_.step()].position; }

private:
    bool arrive(const Ray& ray, Vec2f& miss) const {
        const Vertex& target = x_[end_];
        const float cosine = dot(ray.direction, across_.z);
        if (!(cosine > 0.1f)) return false;
        Vec3f d = ray.direction * (1 / cosine);
        if (!target.infinite) {
            const float t = dot(target.position - ray.origin, across_.z);
            if (!(t > 0)) return false;
            d = ray.origin + d * t - target.position;
        }
        miss = Vec2f{dot(d, across_.x), dot(d, across_.y)} * static_cast<float>(1 / size_);
        return true;
    }

    MutationContext& context_;
    const Path& x_;
    const Walk& walk_;
    int start_, end_;
    Frame across_, leaving_;
    double size_;
};

// Corrects w by Newton's method, with Broyden's updates of the derivative. False: it does not come
// near the target.
bool correct(const Chain& chain, const Vertex& origin, Matrix2& derivative, Vec2f& w,
             Vec3f& first) {
    Vec2f miss;
    if (!chain.shoot(origin, w, miss, first)) return false;
    derivative = chain.derivative(origin, w, miss);
    for (int n = 0; length(miss) > near_enough; ++n) {
        if (n == most_corrections) return length(miss) < too_far;
        Vec2f step = derivative.solve(miss) * -1;
        const float size = length(step);
        if (!(size > 0 && size < most_radians)) return length(miss) < too_far;
        if (size > longest_step) step = step * (longest_step / size);
        Vec2f next;
        for (int halvings = 0; !chain.shoot(origin, w + step, next, first); ++halvings) {
            if (halvings == 2) return false;
            step = step * 0.5f;
        }
        const Vec2f error = next - miss - derivative * step;
        const double d2 = sqr(step.x) + sqr(step.y);
        derivative.xx += error.x * step.x / d2;
        derivative.xy += error.x * step.y / d2;
        derivative.yx += error.y * step.x / d2;
        derivative.yy += error.y * step.y / d2;
        w = w + step;
        miss = next;
    }
    return true;
}

AimedDirection solve(const Chain& chain, const Vertex& v) {
    AimedDirection out;
    Matrix2 derivative;
    Vertex origin = v;
    Vec3f first = chain.first();
    Vec2f w;
    // All of the way at once or, where that fails, in parts.
    for (float done = 0, part = 1; done < 1;) {
        const float next = std::min(done + part, 1.0f);
        const Vec3f old = chain.start().position;
        origin.position = next < 1 ? old + (v.position - old) * next : v.position;
        Vec3f arrived = first;
        if (chain.towards(normalize(first - origin.position), w) &&
            correct(chain, origin, derivative, w, arrived)) {
            done = next;
            first = arrived;
            part *= 2;
        } else if ((part *= 0.5f) < shortest_part) {
            return out;
        }
    }
    out.found = true;
    out.frame = Frame::from_normal(chain.direction(w));
    // The columns of the derivative by directions along the new frame's axes.
    const auto along = [&](Vec3f axis) {
        Vec2f plus;
        chain.towards(out.frame.z + axis * probe, plus);
        return derivative * ((plus - w) * (1 / probe));
    };
    const Vec2f x = along(out.frame.x), y = along(out.frame.y);
    // LᵀL = DᵀD + least².
    const double xx = sqr(double(x.x)) + sqr(double(x.y)) + sqr(least_stretch),
                 xy = double(x.x) * y.x + double(x.y) * y.y,
                 yy = sqr(double(y.x)) + sqr(double(y.y)) + sqr(least_stretch);
    out.stretch.xx = std::sqrt(xx);
    out.stretch.xy = xy / out.stretch.xx;
    out.stretch.yy = std::sqrt(std::max(yy - sqr(out.stretch.xy), 1e-3 * sqr(least_stretch)));
    return out;
}

}  // namespace

AimedDirection aim(MutationContext& context, const Path& x, const Walk& walk, int i,
                   const Vertex& v) {
    const Chain chain(context, x, walk, i);
    const uint64_t key = Chain::add(chain.hash(), v.position);
    if (const AimedDirection* known = context.aims.find(key)) return *known;
    return context.aims.add(key, solve(chain, v));
}

}  // namespace usdmlt
