#include "materials/nodes.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "materials/noise.hpp"

namespace usdmlt {

namespace {

Value splat(float x) { return {{x, x, x, x}}; }
Vec3f vector(const Value& v) { return {v[0], v[1], v[2]}; }

template <typename F>
Value map(const Value& a, const F& f) {
    return {{f(a[0]), f(a[1]), f(a[2]), f(a[3])}};
}
template <typename F>
Value map(const Value& a, const Value& b, const F& f) {
    return {{f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])}};
}
template <typename F>
Value map(const Value& a, const Value& b, const Value& c, const F& f) {
    return {{f(a[0], b[0], c[0]), f(a[1], b[1], c[1]), f(a[2], b[2], c[2]), f(a[3], b[3], c[3])}};
}

// A node that works lane by lane, from a function of floats.
template <auto f>
Value unary(const Value in[], const NodeContext&) {
    return map(in[0], [](float x) { return f(x); });
}
template <auto f>
Value binary(const Value in[], const NodeContext&) {
    return map(in[0], in[1], [](float x, float y) { return f(x, y); });
}
template <auto f>
Value ternary(const Value in[], const NodeContext&) {
    return map(in[0], in[1], in[2], [](float x, float y, float z) { return f(x, y, z); });
}
// One that picks its third or fourth input by comparing the first two.
template <auto f>
Value choice(const Value in[], const NodeContext&) {
    return f(in[0][0], in[1][0]) ? in[2] : in[3];
}

float dot(const Value& a, const Value& b, int width) {
    float sum = 0;
    for (int i = 0; i < width; ++i) sum += a[i] * b[i];
    return sum;
}

// ---- Reading the surface

Value primvar(const Value in[], const NodeContext& c) {
    float v[4] = {0, 0, 0, 0};
    switch (c.point.primvar(c.data, v)) {
        case 0:
            return in[0];
        case 1:
            return splat(v[0]);
        case 3:
            return {{v[0], v[1], v[2], 1}};
        default:
            return {{v[0], v[1], v[2], v[3]}};
    }
}

Value texture(const Value in[], const NodeContext& c) {
    return c.textures[c.data].lookup({in[0][0], in[0][1]});
}

// The tile that the coordinate lies in, read within its own unit square. What no tile covers is
// transparent black.
Value udim(const Value in[], const NodeContext& c) {
    const float u = std::floor(in[0][0]), v = std::floor(in[0][1]);
    if (!(u >= 0 && u < 10 && v >= 0 && v < 1000)) return splat(0);
    const uint32_t number = 1001 + uint32_t(u) + 10 * uint32_t(v);
    const auto& tiles = c.program.tile_sets[c.data].tiles;
    const auto tile = std::lower_bound(tiles.begin(), tiles.end(), number,
                                       [](const auto& t, uint32_t n) { return t.number < n; });
    if (tile == tiles.end() || tile->number != number) return splat(0);
    return c.textures[tile->texture].lookup({in[0][0] - u, in[0][1] - v});
}

Value position(const Value[], const NodeContext& c) {
    const Vec3f p = c.point.position();
    return {{p.x, p.y, p.z, 1}};
}

Value normal(const Value[], const NodeContext& c) {
    const Vec3f n = c.point.normal();
    return {{n.x, n.y, n.z, 0}};
}

// Rows of A in A·(s, t, 1).
Value affine(const Value in[], const NodeContext&) {
    const auto row = [&](const Value& m) { return m[0] * in[0][0] + m[1] * in[0][1] + m[2]; };
    return {{row(in[1]), row(in[2]), 0, 0}};
}

// ---- Lanes

Value extract(const Value in[], const NodeContext& c) { return splat(in[0][int(c.data & 3)]); }

Value combine(const Value in[], const NodeContext& c) {
    return {{in[0][0], in[1][0], c.width > 2 ? in[2][0] : 0, c.width > 3 ? in[3][0] : 1}};
}

// From a width of `data`: what was not there is 0, a fourth lane 1.
Value convert(const Value in[], const NodeContext& c) {
    Value v = in[0];
    if (c.data == 2) v.c[2] = 0;
    if (c.data == 2 || c.data == 3) v.c[3] = 1;
    return v;
}

// ---- Arithmetic

bool greater(float a, float b) { return a > b; }
bool greater_or_equal(float a, float b) { return a >= b; }
bool equal(float a, float b) { return a == b; }
float sign(float x) { return x > 0 ? 1.0f : x < 0 ? -1.0f : 0.0f; }
float add(float a, float b) { return a + b; }
float subtract(float a, float b) { return a - b; }
float multiply(float a, float b) { return a * b; }
float divide(float a, float b) { return a / b; }
float modulo(float a, float b) { return b == 0 ? 0.0f : a - b * std::floor(a / b); }
float clamp(float x, float low, float high) { return std::min(std::max(x, low), high); }
float lerp3(float foreground, float background, float mix) {
    return background + (foreground - background) * mix;
}
float smoothstep(float x, float low, float high) {
    if (x >= high) return 1;
    if (!(x > low)) return 0;
    const float t = (x - low) / (high - low);
    return t * t * (3 - 2 * t);
}

// ---- Vectors

Value dot_product(const Value in[], const NodeContext& c) {
    return splat(dot(in[0], in[1], c.width));
}
Value cross_product(const Value in[], const NodeContext&) {
    const Vec3f v = cross(vector(in[0]), vector(in[1]));
    return {{v.x, v.y, v.z, 0}};
}
Value magnitude(const Value in[], const NodeContext& c) {
    return splat(std::sqrt(dot(in[0], in[0], c.width)));
}
Value normalized(const Value in[], const NodeContext& c) {
    const float len = std::sqrt(dot(in[0], in[0], c.width));
    const float scale = len > 0 ? 1 / len : 0.0f;
    return map(in[0], [&](float x) { return x * scale; });
}
// Clockwise by degrees, as MaterialX's rotate2d turns a vector.
Value rotate2d(const Value in[], const NodeContext&) {
    const float a = -in[1][0] * (pi / 180), c = std::cos(a), s = std::sin(a);
    return {{c * in[0][0] - s * in[0][1], s * in[0][0] + c * in[0][1], 0, 0}};
}

// ---- Colour

// Smith 1978, "Color gamut transform pairs"; hue in [0, 1).
Value rgb_to_hsv(const Value in[], const NodeContext&) {
    const float r = in[0][0], g = in[0][1], b = in[0][2];
    const float top = std::max({r, g, b}), range = top - std::min({r, g, b});
    float h = 0;
    if (range > 0) {
        if (r == top)
            h = (g - b) / range;
        else if (g == top)
            h = 2 + (b - r) / range;
        else
            h = 4 + (r - g) / range;
        h /= 6;
        if (h < 0) h += 1;
    }
    return {{h, top > 0 ? range / top : 0, top, in[0][3]}};
}
Value hsv_to_rgb(const Value in[], const NodeContext&) {
    const float hue = 6 * (in[0][0] - std::floor(in[0][0]));
    const float s = in[0][1], v = in[0][2];
    const auto lane = [&](float offset) {
        const float k = std::fmod(offset + hue, 6.0f);
        return v - v * s * clamp(std::min(k, 4 - k), 0, 1);
    };
    return {{lane(5), lane(3), lane(1), in[0][3]}};
}

// The complex index of a metal of normal reflectance r and edge tint g (Gulbrandsen 2014, "Artist
// friendly metallic Fresnel", eq. 2 to 4, JCGT 3(4)).
float artistic_index(float reflectivity, float edge) {
    const float r = clamp(reflectivity, 0, 0.99f), root = std::sqrt(r);
    const float least = (1 - r) / (1 + r), most = (1 + root) / (1 - root);
    return clamp(edge, 0, 1) * least + (1 - clamp(edge, 0, 1)) * most;
}
float artistic_extinction(float reflectivity, float edge) {
    const float r = clamp(reflectivity, 0, 0.99f), n = artistic_index(r, edge);
    return std::sqrt(std::max((r * sqr(n + 1) - sqr(n - 1)) / (1 - r), 0.0f));
}

// ---- Patterns

// data: octaves. Inputs: position, lacunarity, diminish.
Value fractal3d(const Value in[], const NodeContext& c) {
    return splat(noise::fractal(vector(in[0]), int(c.data), in[1][0], in[2][0]));
}
Value noise2d(const Value in[], const NodeContext&) {
    return splat(noise::perlin(Vec2f{in[0][0], in[0][1]}));
}
Value noise3d(const Value in[], const NodeContext&) { return splat(noise::perlin(vector(in[0]))); }
Value checker(const Value in[], const NodeContext&) {
    return splat(modulo(std::floor(in[0][0]) + std::floor(in[0][1]), 2));
}

const Node table[] = {
    {"primvar", 1, primvar, true},  // fallback; data: slot
    {"texture", 1, texture, true},  // (s, t); data: texture
    {"udim", 1, udim, true},        // (s, t); data: tile set
    {"position", 0, position, true},
    {"normal", 0, normal, true},
    {"affine", 3, affine},
    {"extract", 1, extract},  // data: lane
    {"combine2", 2, combine},
    {"combine3", 3, combine},
    {"combine4", 4, combine},
    {"convert", 1, convert},  // data: width of the input
    {"absolute", 1, unary<[](float x) { return std::fabs(x); }>},
    {"sign", 1, unary<sign>},
    {"floor", 1, unary<[](float x) { return std::floor(x); }>},
    {"ceil", 1, unary<[](float x) { return std::ceil(x); }>},
    {"round", 1, unary<[](float x) { return std::floor(x + 0.5f); }>},
    {"sqrt", 1, unary<[](float x) { return std::sqrt(x); }>},
    {"ln", 1, unary<[](float x) { return std::log(x); }>},
    {"exp", 1, unary<[](float x) { return std::exp(x); }>},
    {"sin", 1, unary<[](float x) { return std::sin(x); }>},
    {"cos", 1, unary<[](float x) { return std::cos(x); }>},
    {"tan", 1, unary<[](float x) { return std::tan(x); }>},
    {"asin", 1, unary<[](float x) { return std::asin(x); }>},
    {"acos", 1, unary<[](float x) { return std::acos(x); }>},
    {"atan2", 2, binary<[](float y, float x) { return std::atan2(y, x); }>},
    {"add", 2, binary<add>},
    {"subtract", 2, binary<subtract>},
    {"multiply", 2, binary<multiply>},
    {"divide", 2, binary<divide>},
    {"modulo", 2, binary<modulo>},
    {"power", 2, binary<[](float a, float b) { return std::pow(a, b); }>},
    {"min", 2, binary<[](float a, float b) { return std::min(a, b); }>},
    {"max", 2, binary<[](float a, float b) { return std::max(a, b); }>},
    {"clamp", 3, ternary<clamp>},            // in, low, high
    {"mix", 3, ternary<lerp3>},              // foreground, background, mix
    {"smoothstep", 3, ternary<smoothstep>},  // in, low, high
    {"if_greater", 4, choice<greater>},
    {"if_greater_or_equal", 4, choice<greater_or_equal>},
    {"if_equal", 4, choice<equal>},
    {"dot", 2, dot_product},
    {"cross", 2, cross_product},
    {"magnitude", 1, magnitude},
    {"normalize", 1, normalized},
    {"rotate2d", 2, rotate2d},
    {"rgb_to_hsv", 1, rgb_to_hsv},
    {"hsv_to_rgb", 1, hsv_to_rgb},
    {"artistic_index", 2, binary<artistic_index>},
    {"artistic_extinction", 2, binary<artistic_extinction>},
    {"noise2d", 1, noise2d},
    {"noise3d", 1, noise3d},
    {"fractal3d", 3, fractal3d},
    {"checker", 1, checker},
};

}  // namespace

const Node* find_node(const std::string& name) {
    const Node* found = std::find_if(std::begin(table), std::end(table),
                                     [&](const Node& n) { return name == n.name; });
    return found == std::end(table) ? nullptr : found;
}

std::vector<std::string> node_names() {
    std::vector<std::string> names;
    for (const Node& node : table) names.emplace_back(node.name);
    return names;
}

}  // namespace usdmlt
