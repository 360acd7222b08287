#include "lights/dome.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/warps.hpp"
#include "lights/light.hpp"

namespace usdmlt {

namespace {

constexpr double pi_d = std::numbers::pi;

// Rows of the density's vertices: 0 is the north pole, 1 … h the texel rows, h + 1 the south pole.
double row_theta(int row, int height) { return std::clamp((row - 0.5) / height, 0.0, 1.0) * pi_d; }

// A place of the lat-long image: the four vertices around it and the fractions between them.
struct Place {
    int column[2];  // of texels; wraps around
    int row;        // of vertices: row and row + 1
    float fx, fy;
    float sin_theta;

    // `d`: dome space, any length.
    Place(const DomeLight& light, Vec3f d) {
        const int w = light.texture->width, h = light.texture->height;
        const float horizontal = std::sqrt(d.x * d.x + d.z * d.z);
        const float s = 0.5f - std::atan2(d.x, d.z) * (0.5f * inv_pi);
        const float t = std::atan2(horizontal, d.y) * inv_pi;
        sin_theta = horizontal / std::sqrt(length_squared(d));

        const float x = s * static_cast<float>(w) - 0.5f, left = std::floor(x);
        const int i = static_cast<int>(left);
        column[0] = i < 0 ? i + w : i;
        column[1] = column[0] + 1 < w ? column[0] + 1 : 0;
        fx = x - left;

        const float y = t * static_cast<float>(h) + 0.5f;
        row = std::clamp(static_cast<int>(y), 0, h);
        fy = y - static_cast<float>(row);
        // The outer rows of cells are half as high.
        if (row == 0) fy = 2 * fy - 1;
        if (row == h) fy = 2 * fy;
        fy = clamp01(fy);
    }

    template <typename Value>
    auto interpolate(const Value& value) const {
        return (value(column[0], row) * (1 - fx) + value(column[1], row) * fx) * (1 - fy) +
               (value(column[0], row + 1) * (1 - fx) + value(column[1], row + 1) * fx) * fy;
    }
};

// Texel of a vertex; beyond the poles the outer rows repeat.
Spectrum vertex_color(const DomeLight& light, int column, int row) {
    const Texel t = light.texture->texel(column, std::clamp(row - 1, 0, light.texture->height - 1));
    return {t[0], t[1], t[2]};
}

// Texels that are not finite (a sun beyond half's range) are not sampled.
float weight(const DomeLight& light, const Spectrum& color, int row) {
    const float value = static_cast<float>(importance(light.radiance * color));
    return std::isfinite(value) ? value * light.row_sine[row] : 0;
}

float vertex_weight(const DomeLight& light, int column, int row) {
    return weight(light, vertex_color(light, column, row), row);
}

// In dome space: density over (s, t) ∝ the interpolated weights; dω = 2π² sinθ ds dt.
double pdf_local(const DomeLight& light, Vec3f d) {
    const Place place(light, d);
    if (!(place.sin_theta > 0)) return 0;
    const float interpolated =
        place.interpolate([&](int column, int row) { return vertex_weight(light, column, row); });
    return interpolated / (light.cells.total() * 2 * sqr(pi_d) * place.sin_theta);
}

Vec3f sample_local(const DomeLight& light, Vec2f u) {
    const int w = light.texture->width, h = light.texture->height;
    const auto cell = light.cells.sample(u.x, u.y);
    const int left = static_cast<int>(cell.x), top = static_cast<int>(cell.y);
    const int right = left + 1 < w ? left + 1 : 0;
    const double w00 = vertex_weight(light, left, top), w10 = vertex_weight(light, right, top);
    const double w01 = vertex_weight(light, left, top + 1);
    const double w11 = vertex_weight(light, right, top + 1);
    const double fy = sample_linear(cell.v, w00 + w10, w01 + w11);
    const double fx = sample_linear(cell.u, w00 + fy * (w01 - w00), w10 + fy * (w11 - w10));
    const double s = (left + 0.5 + fx) / w;
    const double theta0 = row_theta(top, h), theta1 = row_theta(top + 1, h);
    const auto theta = static_cast<float>(theta0 + fy * (theta1 - theta0));
    const auto phi = static_cast<float>((0.5 - s) * 2 * pi_d);
    const float r = std::sin(theta);
    return {r * std::sin(phi), std::cos(theta), r * std::cos(phi)};
}

}  // namespace

DomeLight::DomeLight(const Affine3f& transform, const Spectrum& radiance, const Texture* texture)
    : radiance(radiance), texture(texture), to_world(transform) {
    to_world.origin = {};
    determinant = std::fabs(to_world.determinant());
    if (!(determinant > 0)) {
        this->radiance = Spectrum(0.0f);
        to_world = {};
        determinant = 1;
    }
    from_world = to_world.inverse();
    if (!texture) return;

    const int w = texture->width, h = texture->height;
    row_sine.assign(h + 2, 0.0f);
    for (int row = 1; row <= h; ++row)
        row_sine[row] = static_cast<float>(std::sin(row_theta(row, h)));
    std::vector<float> weights(size_t(w) * (h + 2), 0.0f);
    double sum[3] = {0, 0, 0};
    for (int row = 1; row <= h; ++row) {
        // A texel's share of the sphere.
        const double share =
            (std::cos((row - 1) * pi_d / h) - std::cos(row * pi_d / h)) / (2.0 * w);
        for (int column = 0; column < w; ++column) {
            const Spectrum color = vertex_color(*this, column, row);
            weights[size_t(row) * w + column] = weight(*this, color, row);
            if (!is_finite(color)) continue;
            for (int i = 0; i < 3; ++i) sum[i] += color[i] * share;
        }
    }
    average = Spectrum(static_cast<float>(sum[0]), static_cast<float>(sum[1]),
                       static_cast<float>(sum[2]));
    cells = Distribution2D(w, h + 1, [&](uint32_t x, uint32_t y) {
        const uint32_t right = x + 1 < uint32_t(w) ? x + 1 : 0;
        const float* row = weights.data() + size_t(y) * w;
        const double height = (row_theta(y + 1, h) - row_theta(y, h)) / pi_d;
        return 0.25 * (double(row[x]) + row[right] + row[x + w] + row[right + w]) * height / w;
    });
    if (cells.empty()) this->radiance = Spectrum(0.0f);
}

Vec3f sample_incoming(const DomeLight& light, Vec2f u) {
    if (!light.texture) return square_to_sphere(u);
    return normalize(light.to_world.vector(sample_local(light, u)));
}

// The world's solid angle is |det|·|q|³ of the dome's, q the direction in its space.
double pdf_incoming(const DomeLight& light, Vec3f direction) {
    if (!light.texture) return 0.25 / pi_d;
    const Vec3f q = light.from_world.vector(direction);
    const double q2 = length_squared(q);
    return pdf_local(light, q) / (light.determinant * q2 * std::sqrt(q2));
}

Spectrum incoming_radiance(const DomeLight& light, Vec3f direction) {
    if (!light.texture) return light.radiance;
    const Place place(light, light.from_world.vector(direction));
    return light.radiance *
           place.interpolate([&](int column, int row) { return vertex_color(light, column, row); });
}

Spectrum integrated_radiance(const DomeLight& light) {
    return light.radiance * light.average * static_cast<float>(4 * pi_d);
}

}  // namespace usdmlt
