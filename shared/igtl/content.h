// The contents of OpenIGTLink's messages, written as bytes: igtl/message.h puts the rest around
// them. Each function returns the bytes that it wrote. Lengths are millimetres; a name counts with
// at most 20 bytes.
#pragma once

#include "base/pose.h"
#include "igtl/message.h"

#include <stddef.h>
#include <stdint.h>

#define IGTL_TRANSFORM_SIZE 48
#define IGTL_POSITION_SIZE 28
#define IGTL_TDATA_SIZE 70  // for each tool
#define IGTL_QTDATA_SIZE 50 // for each tool
#define IGTL_START_SIZE 36
#define IGTL_COORDINATES_SIZE 33 // the name of coordinates, with the final 0
#define IGTL_TEXT_SIZE 256       // of a string or a status, with the final 0
#define IGTL_STATUS_SIZE_MAX (30 + IGTL_TEXT_SIZE)
#define IGTL_STRING_SIZE_MAX (4 + IGTL_TEXT_SIZE)

size_t igtl_write_transform(pose T_world_tool, uint8_t out[IGTL_TRANSFORM_SIZE]);
size_t igtl_write_position(pose T_world_tool, uint8_t out[IGTL_POSITION_SIZE]);

// One tool; a TDATA or QTDATA is a row of them.
size_t igtl_write_tdata(const char *name, pose T_world_tool, uint8_t out[IGTL_TDATA_SIZE]);
size_t igtl_write_qtdata(const char *name, pose T_world_tool, uint8_t out[IGTL_QTDATA_SIZE]);

// STT_TDATA and STT_QTDATA. interval_ms: the shortest between two messages.
size_t igtl_write_start(int interval_ms, const char *coordinates, uint8_t out[IGTL_START_SIZE]);

// code: 1 is OK. Of the text IGTL_TEXT_SIZE - 1 bytes count.
size_t igtl_write_status(int code, int64_t subcode, const char *name, const char *text,
                         uint8_t out[IGTL_STATUS_SIZE_MAX]);

// UTF-8, of which IGTL_TEXT_SIZE - 1 bytes count.
size_t igtl_write_string(const char *text, uint8_t out[IGTL_STRING_SIZE_MAX]);

// CAPABILITY: the types of messages, 12 bytes for each.
size_t igtl_write_capability(const char *const *types, int count, uint8_t *out);

// POLYDATA: triangles, counter-clockwise seen from outside.
size_t igtl_polydata_size(int vertex_count, int triangle_count);
size_t igtl_write_polydata(const float *positions, int vertex_count, const uint32_t *triangles,
                           int triangle_count, uint8_t *out);
