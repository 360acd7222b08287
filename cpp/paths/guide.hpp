// Where walks from the eye should look for light that came through Dirac vertices: directions
// (photons) by cell of a grid over the surfaces (after Jensen 1995, "Importance driven path tracing
// using the photon map").
//
// Light of this kind is found neither by next-event estimation nor by joining subpaths: L S D S E
// can only be made by walking from the eye into the light. A guide is built in a pilot, and is a
// function of position from then on, so that densities which include it are exact.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "paths/trace.hpp"

namespace usdmlt {

struct Photon {
    Vec3f position, direction;  // direction: unit, towards where the light came from
};

// Photons L S+ D where walks from the eye arrive by way of Dirac vertices, E … S+ D: about `wanted`
// light subpaths of the stream `key`. Half of them start near others that were successful.
std::vector<Photon> trace_photons(const Scene& scene, uint64_t key, int wanted,
                                  RayCounters& counters);

// Cells of a grid by a number that is never 0: 21 bits of each coordinate.
struct Grid {
    float cells_per_unit = 0;

    Grid() = default;
    explicit Grid(float cell_size) : cells_per_unit(1 / cell_size) {}
    uint64_t key_of(Vec3f p) const {
        const auto coordinate = [&](float x) {
            return static_cast<uint64_t>(static_cast<int64_t>(std::floor(x * cells_per_unit)) +
                                         (1 << 20)) &
                   0x1fffff;
        };
        return (coordinate(p.x) << 42 | coordinate(p.y) << 21 | coordinate(p.z)) | uint64_t(1)
                                                                                       << 63;
    }
};

class Guide {
public:
    explicit Guide(const std::vector<Photon>& photons);

    bool empty() const { return cells_.empty(); }

    // Null where no such light was seen.
    const DirectionGuide* at(Vec3f position) const {
        if (cells_.empty()) return nullptr;
        for (const Level& level : levels_) {
            const uint64_t key = level.grid.key_of(position);
            for (size_t i = mix64(key) & level.mask;; i = (i + 1) & level.mask) {
                if (level.table[i].key == key) return &cells_[level.table[i].cell];
                if (level.table[i].key == 0) break;
            }
        }
        return nullptr;
    }

private:
    struct Slot {
        uint64_t key = 0;
        uint32_t cell = 0;
    };

    // Coarser ones serve where the finest has too few photons.
    struct Level {
        Grid grid;
        size_t mask = 0;
        std::vector<Slot> table;
    };
    static constexpr float coarser = 3;

    void add_cells(const std::vector<Photon>& photons,
                   const std::vector<std::pair<uint64_t, uint32_t>>& order, Level& level);

    std::array<Level, 3> levels_;
    std::vector<DirectionGuide> cells_;
};

}  // namespace usdmlt
