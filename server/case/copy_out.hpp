// Values that C frees, of a vector.
#pragma once

#include <cstdlib>
#include <cstring>
#include <new>
#include <vector>

// The caller releases them with free. Throws bad_alloc.
template <typename T> T *copy_out(const std::vector<T> &values) {
    T *copy = static_cast<T *>(malloc(values.size() * sizeof(T)));
    if (!copy)
        throw std::bad_alloc();
    memcpy(copy, values.data(), values.size() * sizeof(T));
    return copy;
}
