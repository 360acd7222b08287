// How the sums of a film become a picture, given which units are in them.
#pragma once

#include "film/film.hpp"
#include "film/unit_set.hpp"

namespace usdmlt {

struct Development {
    int64_t mutations_per_unit = 0;  // of Metropolis light transport; 0: splats are normalised by
                                     // the number of camera samples
    double exposure = 1;

    double splats_per_pixel(const Film& film, const UnitSet& units) const {
        const double pixels = double(film.width()) * film.height();
        return mutations_per_unit > 0 ? double(units.count()) * double(mutations_per_unit) / pixels
                                      : double(film.sample_count()) / pixels;
    }
    void picture(const Film& film, const UnitSet& units, float* rgba) const {
        film.develop(rgba, splats_per_pixel(film, units), exposure);
    }
    void layer(const Film& film, const UnitSet& units, int index, float* rgb) const {
        film.develop_layer(index, rgb, splats_per_pixel(film, units), exposure);
    }
    void error(const Film& film, const UnitSet& units, float* out) const {
        film.develop_error(out, splats_per_pixel(film, units), units.count(), exposure);
    }
};

}  // namespace usdmlt
