// Numbers that stay as they are, and may be shared with whoever else has them, such as NumPy.
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace usdmlt {

template <typename T>
class SharedArray {
public:
    SharedArray() = default;
    // `data` keeps them alive.
    SharedArray(std::shared_ptr<const T> data, size_t size) : data_(std::move(data)), size_(size) {}
    SharedArray(std::vector<T>&& values) {
        const auto owner = std::make_shared<std::vector<T>>(std::move(values));
        data_ = {owner, owner->data()};
        size_ = owner->size();
    }

    size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    const T* data() const { return data_.get(); }
    const T* begin() const { return data(); }
    const T* end() const { return data() + size_; }
    const T& operator[](size_t i) const { return data_.get()[i]; }

private:
    std::shared_ptr<const T> data_;
    size_t size_ = 0;
};

}  // namespace usdmlt
