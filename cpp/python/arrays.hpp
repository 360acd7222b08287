// Plain numbers of NumPy arrays and of vectors as each other's, without a copy.
#pragma once

#include <pybind11/numpy.h>

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace usdmlt {

// The memory of an array, which lives as long as the pointer.
template <typename T>
std::shared_ptr<const T> share(pybind11::array array) {
    const auto* data = static_cast<const T*>(array.data());
    auto* owner = new pybind11::array(std::move(array));
    return {data, [owner](const T*) {
                if (!Py_IsInitialized()) return;  // the interpreter took it along
                const pybind11::gil_scoped_acquire gil;
                delete owner;
            }};
}

// Takes the vector over. `T` is a number, or a struct of `width` numbers of type `Number`.
template <class Number, class T>
pybind11::array_t<Number> to_array(std::vector<T>&& values) {
    static_assert(sizeof(T) % sizeof(Number) == 0);
    constexpr auto width = static_cast<pybind11::ssize_t>(sizeof(T) / sizeof(Number));
    auto* owner = new std::vector<T>(std::move(values));
    const pybind11::capsule base(owner, [](void* p) { delete static_cast<std::vector<T>*>(p); });
    std::vector<pybind11::ssize_t> shape{static_cast<pybind11::ssize_t>(owner->size())};
    if (width > 1) shape.push_back(width);
    return pybind11::array_t<Number>(shape, reinterpret_cast<const Number*>(owner->data()), base);
}

// A view that keeps `owner` alive; what is written to it is written to the vector.
template <class Number, class T>
pybind11::array_t<Number> view(const std::vector<T>& values, const pybind11::object& owner) {
    constexpr auto width = static_cast<pybind11::ssize_t>(sizeof(T) / sizeof(Number));
    std::vector<pybind11::ssize_t> shape{static_cast<pybind11::ssize_t>(values.size())};
    if (width > 1) shape.push_back(width);
    return pybind11::array_t<Number>(shape, reinterpret_cast<const Number*>(values.data()), owner);
}

}  // namespace usdmlt
