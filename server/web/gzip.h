// Bytes packed and unpacked as gzip (RFC 1952).
#pragma once

#include <stddef.h>
#include <stdint.h>

// Both give new memory. gzip_unpack: NULL where it does not unpack to just `size` bytes.
uint8_t *gzip_pack(const uint8_t *bytes, size_t size, size_t *out_size);
uint8_t *gzip_unpack(const uint8_t *packed, size_t packed_size, size_t size);
