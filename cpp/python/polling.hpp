// Python's say while units run: signals, and a function that is called now and then.
#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <memory>
#include <optional>

namespace usdmlt {

class Poll {
public:
    explicit Poll(const std::optional<pybind11::function>& function) : function_(function) {}

    // Whether to stop. What Python raises is kept until the units that were started are finished.
    bool operator()(int64_t units) {
        const pybind11::gil_scoped_acquire acquire;
        try {
            if (PyErr_CheckSignals() != 0) throw pybind11::error_already_set();
            return function_ && pybind11::cast<bool>((*function_)(units));
        } catch (pybind11::error_already_set& error) {
            raised_ = std::make_unique<pybind11::error_already_set>(std::move(error));
            return true;
        }
    }
    void raise() {
        if (raised_) throw std::move(*raised_);
    }

private:
    const std::optional<pybind11::function>& function_;
    std::unique_ptr<pybind11::error_already_set> raised_;
};

}  // namespace usdmlt
