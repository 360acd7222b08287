#include "paths/guide.hpp"

#include <algorithm>
#include <bit>
#include <unordered_set>

#include "paths/subpath.hpp"

namespace usdmlt {
namespace {

constexpr size_t fewest_photons = 64, fewest_in_cell = 4, wanted_in_cell = 24;
// A cone reaches to the direction's neighbour of this rank, and a little farther: half the sun's
// diameter, radians.
constexpr int neighbour = 3;
constexpr float least_angle = 0.005f;

// Of the walks that look for where photons are needed.
constexpr uint32_t eye_subpaths = 4096;
constexpr float coarse_cells = 24;  // across what they see
constexpr int longest_chain = 8;    // narrow vertices of a photon
// Scattering of a higher density than this is narrow, as Dirac components are: a cosine's is 0.3.
constexpr float narrow_density = 3;
// How far from a successful start others are tried, in the unit square.
constexpr float start_radius = 0.02f;

float extent_of(const std::vector<Vec3f>& points) {
    Vec3f lower = points[0], upper = lower;
    for (const Vec3f& p : points) {
        lower = min(lower, p);
        upper = max(upper, p);
    }
    return std::max(length(upper - lower), 1e-20f);
}

bool is_narrow(Component component, float pdf) {
    return component != non_delta || pdf > narrow_density;
}

// L S+ D. False where the walk goes another way.
bool trace_photon(const Scene& scene, float select, Vec2f u_point, Vec2f u_direction, float time,
                  RandomStream& random, RayCounters& counters, Photon& photon) {
    LightPoint point;
    double pdf;
    if (!sample_point(scene.lights, select, u_point, time, point, pdf)) return false;
    Vertex vertices[2];
    light_vertex(scene, point, time, vertices[1]);
    Ray ray;
    if (!sample_light_ray(scene, vertices[1], u_direction, ray, pdf)) return false;
    for (int i = 0;; ++i) {
        Edge edge;
        Vertex& v = vertices[i % 2];
        if (!trace_vertex(scene, vertices[1 - i % 2], ray, Known::light, false, random, counters, v,
                          edge))
            return false;
        if (v.closure.lobe_count == 0) return false;
        ClosureSample sample;
        const Vec2f u = random.next_2d();
        const bool scatters =
            v.closure.sample(-ray.direction, Known::light, random.next_1d(), u, sample);
        const bool narrow = scatters && is_narrow(sample.component, sample.pdf);
        if (i > 0 && v.can_connect() && !narrow) {
            photon = {v.position, -ray.direction};
            return true;
        }
        if (!narrow || i == longest_chain) return false;
        ray = {offset_origin(v, sample.direction), 0, sample.direction, infinite_distance, time};
    }
}

// Whether the walk from the eye leaves vertex i so.
bool leaves_narrowly(const Subpath& path, int i) {
    const SubpathVertex& v = path[i];
    const Vec3f to_next = normalize(path[i + 1].position - v.position);
    return is_narrow(v.component, v.closure.pdf(v.to_previous, to_next, Known::eye));
}

// Cones are narrow where directions are many: clusters and stray directions may share a cell.
void set_cones(DirectionGuide& cell) {
    for (int i = 0; i < cell.count; ++i) {
        float squared[DirectionGuide::capacity];
        for (int j = 0; j < cell.count; ++j)
            squared[j] = sqr(cell.x[i] - cell.x[j]) + sqr(cell.y[i] - cell.y[j]) +
                         sqr(cell.z[i] - cell.z[j]);
        // Rank 0 is the direction itself.
        const int rank = std::min(neighbour, cell.count - 1);
        std::nth_element(squared, squared + rank, squared + cell.count);
        cell.set_cone(i, std::min((squared[rank] + sqr(least_angle)) / 2, 1.0f));
    }
}

}  // namespace

std::vector<Photon> trace_photons(const Scene& scene, uint64_t key, int wanted,
                                  RayCounters& counters) {
    std::vector<Photon> photons;
    if (scene.lights.empty()) return photons;

    // Where the eye needs them: cells of a coarse grid.
    std::vector<Vec3f> seen;
    Subpath path(longest_chain + 2);
    for (uint32_t n = 0; n < eye_subpaths; ++n) {
        Sampler sampler(key, n, 8);
        const Vec2f u = sampler.next_2d();
        const float time = sample_time(scene, sampler);
        trace_camera_subpath(scene, sampler,
                             {u.x * float(scene.camera.width), u.y * float(scene.camera.height)},
                             time, longest_chain + 2, counters, path);
        for (int i = 2; i < path.count; ++i)
            if (path[i].is_surface() && path[i].can_connect() && leaves_narrowly(path, i - 1))
                seen.push_back(path[i].position);
    }
    if (seen.empty()) return photons;
    const Grid grid(extent_of(seen) / coarse_cells);
    std::unordered_set<uint64_t> cells;
    for (const Vec3f& p : seen) cells.insert(grid.key_of(p));

    // The numbers that a light subpath starts with: light, point on it, direction or origin.
    struct Start {
        float select;
        Vec2f point, direction;
    };
    RandomStream random(hash_key(key, 1));
    std::vector<Start> successful;
    const auto try_start = [&](const Start& start) {
        Photon photon;
        const float time = scene.has_motion ? random.next_1d() : 0;
        if (!trace_photon(scene, start.select, start.point, start.direction, time, random, counters,
                          photon) ||
            !cells.contains(grid.key_of(photon.position)))
            return false;
        photons.push_back(photon);
        return true;
    };
    for (int n = 0; n < wanted / 2; ++n) {
        const float select = random.next_1d();
        const Vec2f point = random.next_2d();
        const Start start{select, point, random.next_2d()};
        if (try_start(start)) successful.push_back(start);
    }
    if (successful.empty()) return photons;
    const auto near = [&](Vec2f u) {
        const auto wrap = [](float x) { return x - std::floor(x); };
        const Vec2f d = random.next_2d();
        return Vec2f{wrap(u.x + start_radius * (2 * d.x - 1)),
                     wrap(u.y + start_radius * (2 * d.y - 1))};
    };
    for (int n = 0; n < wanted / 2; ++n) {
        const Start& near_to = successful[size_t(n) % successful.size()];
        const Vec2f point = near(near_to.point);
        try_start({near_to.select, point, near(near_to.direction)});
    }
    return photons;
}

Guide::Guide(const std::vector<Photon>& photons) {
    if (photons.size() < fewest_photons) return;
    std::vector<Vec3f> positions;
    for (const Photon& p : photons) positions.push_back(p.position);
    // The finest grid whose cells hold enough photons.
    const float extent = extent_of(positions);
    float cell_size = extent;
    std::vector<std::pair<uint64_t, uint32_t>> order(photons.size());
    for (float cells = 512; cells >= 2; cells /= 1.5f) {
        cell_size = extent / cells;
        const Grid grid(cell_size);
        for (uint32_t i = 0; i < photons.size(); ++i) order[i] = {grid.key_of(positions[i]), i};
        std::sort(order.begin(), order.end());
        size_t occupied = 0;
        for (size_t i = 0; i < order.size(); ++i)
            occupied += i == 0 || order[i].first != order[i - 1].first;
        if (photons.size() >= wanted_in_cell * occupied) break;
    }

    for (Level& level : levels_) {
        level.grid = Grid(cell_size);
        cell_size *= coarser;
        for (uint32_t i = 0; i < photons.size(); ++i)
            order[i] = {level.grid.key_of(positions[i]), i};
        std::sort(order.begin(), order.end());
        add_cells(photons, order, level);
    }
}

void Guide::add_cells(const std::vector<Photon>& photons,
                      const std::vector<std::pair<uint64_t, uint32_t>>& order, Level& level) {
    const size_t before = cells_.size();
    std::vector<uint64_t> keys;
    for (size_t first = 0, last; first < order.size(); first = last) {
        last = first;
        while (last < order.size() && order[last].first == order[first].first) ++last;
        const size_t found = last - first;
        if (found < fewest_in_cell) continue;
        DirectionGuide cell{};
        cell.count = static_cast<int>(std::min(found, size_t(DirectionGuide::capacity)));
        for (int i = 0; i < DirectionGuide::capacity; ++i) {
            const bool used = i < cell.count;
            const size_t photon = first + found * size_t(i) / size_t(cell.count);
            const Vec3f d = used ? photons[order[photon].second].direction : Vec3f{3, 3, 3};
            cell.x[i] = d.x;
            cell.y[i] = d.y;
            cell.z[i] = d.z;
        }
        set_cones(cell);
        keys.push_back(order[first].first);
        cells_.push_back(cell);
    }
    level.mask = std::bit_ceil(2 * keys.size() + 1) - 1;
    level.table.resize(level.mask + 1);
    for (size_t c = 0; c < keys.size(); ++c) {
        size_t i = mix64(keys[c]) & level.mask;
        while (level.table[i].key != 0) i = (i + 1) & level.mask;
        level.table[i] = {keys[c], static_cast<uint32_t>(before + c)};
    }
}

}  // namespace usdmlt
