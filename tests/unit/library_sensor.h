// A SENSOR and a STRING as OpenIGTLink's own C++ classes make it.
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// Returns the bytes of the message: header and body.
size_t library_sensor(const char *device, uint64_t unit, const double *values, int count,
                      uint8_t *out, size_t size);

// The same of a STRING.
size_t library_string(const char *device, double utc_s, const char *text, uint8_t *out,
                      size_t size);

#ifdef __cplusplus
}
#endif
